"""Work by length of a sequence, and what datasets of known length cost."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

S_PER_HOUR: Final = 3600


@dataclass(frozen=True, slots=True)
class Measured:
    """A check of one sequence of known length by one effort.

    Attributes
    ----------
    length_s
        Length of the sequence, s.
    cpu_s
        Processor time of the command over all its processes, start included, s.
    wall_s
        Time of the command, start included, s.
    read_bytes
        Bytes of the sequence on disk that the check needs.
    """

    length_s: float
    cpu_s: float
    wall_s: float
    read_bytes: float


@dataclass(frozen=True, slots=True)
class UnitCost:
    """What a sequence costs: so much for itself, and so much for each second of it. Core seconds, and bytes to read."""

    cpu_s: float
    cpu_s_per_s: float
    read_bytes_per_s: float

    def core_h(self, dataset: "Dataset") -> float:
        """Return the core hours of a dataset."""
        return (dataset.sequences * self.cpu_s + dataset.length_s * self.cpu_s_per_s) / S_PER_HOUR

    def read_bytes(self, dataset: "Dataset") -> float:
        """Return the bytes that are read of a dataset."""
        return dataset.length_s * self.read_bytes_per_s

    @property
    def bytes_per_core_s(self) -> float:
        """Bytes a second that keep one core busy."""
        return self.read_bytes_per_s / self.cpu_s_per_s


@dataclass(frozen=True, slots=True)
class Dataset:
    """A release: how many sequences, and how long they are together, s."""

    name: str
    sequences: int
    length_s: float


PAPER: Final = Dataset("the five sequences of the FEDORA paper", 5, 165 + 220 + 159 + 112 + 112)
DSEC: Final = Dataset("53 sequences like DSEC's", 53, 3193)
"""Lengths of DSEC: Gehrig et al., IEEE RA-L 2021."""
SIMULATED: Final = Dataset("1,000 simulated flights of a minute", 1000, 60_000)


def unit_cost(shorter: Measured, longer: Measured) -> UnitCost:
    """Return the line through two lengths.

    Raises
    ------
    ValueError
        If the lengths do not ascend, or the longer one took no more processor time.
    """
    length_s = longer.length_s - shorter.length_s
    cpu_s_per_s = (longer.cpu_s - shorter.cpu_s) / length_s if length_s > 0 else math.nan
    if not cpu_s_per_s > 0:
        raise ValueError(
            f"Expected a longer sequence that takes more processor time, got {shorter.cpu_s:g} s for "
            f"{shorter.length_s:g} s and {longer.cpu_s:g} s for {longer.length_s:g} s; measure again on a quiet machine"
        )
    return UnitCost(
        cpu_s=max(shorter.cpu_s - cpu_s_per_s * shorter.length_s, 0.0),
        cpu_s_per_s=cpu_s_per_s,
        read_bytes_per_s=longer.read_bytes / longer.length_s,
    )


def unit_costs(measured: Mapping[str, Sequence[Measured]]) -> dict[str, UnitCost]:
    """Return the unit cost by effort, from the two longest sequences."""
    longest = {effort: sorted(every, key=lambda each: each.length_s)[-2:] for effort, every in measured.items()}
    return {effort: unit_cost(shorter, longer) for effort, (shorter, longer) in longest.items()}
