"""What a canary is planted on: the unchanged file, and the measurements of the check on it.

The canaries stand with the faults, by subject: the fault that a check must detect, with a size that follows from its
detection limit. Where it can be undone, the canary builds that fault and calls ``plant``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Fault, InapplicableError, ReversibleFault
from fedora_qa.record.types import Measurement
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

MULTIPLES: Final = (3.0, 10.0, 30.0)
"""Sizes of a canary, as multiples of the detection limit of the check, tried in this order until one is detected.

The first size is three times the limit, because a canary is tried on fewer windows than the file has. Larger sizes are
tried because the limit holds for the worst place of the file: the canary may lie on noisier pixels, or damage the data
by which it is detected. A check that does not detect thirty times its limit does not work.
"""


class UnplantableError(Exception):
    """No fault can be planted that the check would have to detect; the message states the reason."""


@dataclass(frozen=True, slots=True)
class CanaryConditions:
    """A file and the measurements of one check on it.

    Attributes
    ----------
    sequence
        The file.
    facts
        The clocks, streams and declarations of the file.
    measurements
        The measurements of the check on the unchanged file.
    place_ns
        Instant with motion around it, ns from the origin of the file: faults of one place are planted there.
    multiple
        Size of the canary, as a multiple of the detection limit of the check.
    """

    sequence: SequenceRows
    facts: Facts
    measurements: tuple[Measurement, ...]
    place_ns: int
    multiple: float

    def size(self, *endings: str, at_least: float = 0.0) -> float:
        """Return the size of the fault: ``multiple`` times the detection limit of the check.

        Parameters
        ----------
        endings
            Endings of the names of the measurements that count. The least detection limit of these is taken.
        at_least
            Least size of the fault, in the unit of the measurements. It is the result where there is no limit.

        Returns
        -------
        float
            In the unit of the measurements, above 0.

        Raises
        ------
        UnplantableError
            If the check states no detection limit and ``at_least`` is 0.
        """
        # Measurements with a detection limit of None or 0 do not count.
        limits = [m.least_detectable for m in self.measurements if m.name.endswith(endings) and m.least_detectable]
        size = max(self.multiple * min(limits, default=0.0), at_least)
        if size <= 0:
            raise UnplantableError(f"the check states no limit of {' or '.join(endings)}")
        return size

    def planted(self, fault: ReversibleFault) -> Fault:
        """Return a fault that can be undone, planted in the file.

        Raises
        ------
        UnplantableError
            If the file lacks what the fault needs.
        """
        try:
            return fault.plant(self.facts, self.sequence)
        except InapplicableError as error:
            raise UnplantableError(str(error)) from error

    def measured_stream(self, rule: str) -> str | None:
        """Return the first stream for which the check measured ``<stream>.<rule>``; None where there is none."""
        return next((m.name.removesuffix(f".{rule}") for m in self.measurements if m.name.endswith(f".{rule}")), None)

    def row_at_place(self, stream: str) -> int:
        """Return the first row of a stream (not of events) at or after the place that has rows on both sides."""
        times_ns = self.facts.clocks[stream].times_ns
        # The first and the last row have only one neighbour, and the faults need both.
        return int(np.clip(np.searchsorted(times_ns, self.place_ns), 1, max(len(times_ns) - 2, 1)))

    def period_ns(self, stream: str) -> int:
        """Return the median step between the timestamps of a stream (not of events), ns; 0 with fewer than two."""
        steps: NDArray[np.int64] = np.diff(self.facts.clocks[stream].times_ns)
        return int(np.median(steps)) if len(steps) else 0


PlantCanary = Callable[[CanaryConditions], Fault]
"""Returns the fault, whose size follows from the conditions; raises ``UnplantableError`` where it cannot be planted."""
