"""What a canary is planted on: the file as it was found, and what the check measured on it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.types import Measurement
from fedora_qa.sequence.facts import Facts

MULTIPLES: Final = (3.0, 10.0, 30.0)
"""Sizes of a canary, as multiples of the detection limit of the check: the first that is detected suffices.

Three times leaves room for the fewer windows on which it is first tried. More is tried because the stated limit is that
of the place where the file is worst: a canary may sit on louder pixels, or spoil the data by which it is detected. A
check that does not detect thirty times its limit either does not work.
"""


class UnplantableError(Exception):
    """No fault can be planted that the check would have to detect; the message says why."""


@dataclass(frozen=True, slots=True)
class CanaryConditions:
    """A file and one check's measurements on it.

    Attributes
    ----------
    measurements
        What the check measured on the file as it is.
    place_ns
        An instant with motion around it, where faults of one place are planted.
    multiple
        Size of the canary, as a multiple of the detection limit of the check.
    """

    facts: Facts
    measurements: tuple[Measurement, ...]
    place_ns: int
    multiple: float

    def size(self, *endings: str, at_least: float = 0.0) -> float:
        """Return a size that is clearly above the check's limit.

        Parameters
        ----------
        endings
            How the names of the measurements end; the sharpest of them counts.
        at_least
            Size below which the fault would be no fault, in the measurements' unit; taken where there is no limit.

        Raises
        ------
        UnplantableError
            There is neither.
        """
        # A detection limit of None or 0 states nothing.
        limits = [m.least_detectable for m in self.measurements if m.name.endswith(endings) and m.least_detectable]
        size = max(self.multiple * min(limits, default=0.0), at_least)
        if size <= 0:
            raise UnplantableError(f"the check states no limit of {' or '.join(endings)}")
        return size

    def measured_stream(self, rule: str) -> str | None:
        """Return the first stream of which the check states ``<stream>.<rule>``; None where there is none."""
        return next((m.name.removesuffix(f".{rule}") for m in self.measurements if m.name.endswith(f".{rule}")), None)

    def row_at_place(self, stream: str) -> int:
        """Return the first row of a stream (not of events) from the place on, with rows on both of its sides."""
        times_ns = self.facts.clocks[stream].times_ns
        # The first and the last row have one neighbour only, and the fault needs both.
        return int(np.clip(np.searchsorted(times_ns, self.place_ns), 1, max(len(times_ns) - 2, 1)))

    def period_ns(self, stream: str) -> int:
        """Return the median step between the timestamps of a stream (not of events)."""
        steps: NDArray[np.int64] = np.diff(self.facts.clocks[stream].times_ns)
        return int(np.median(steps)) if len(steps) else 0
