"""A coarse grid that a part of the stamps lies on, among others that do not.

A comb of g ticks meets the occupied ticks at one in g where stamps know nothing of it. Ticks count once however many
events they hold, so that an edge which lets a whole column fire at once is one witness, not many.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.tails import log_chance_of_hits

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

FINEST: Final = 2
COARSEST: Final = 2000
"""Grids that are tried, in ticks: every whole number."""

FLOAT32_STEPS_US: Final = tuple(1e6 * 2.0**-k for k in range(17, 12, -1))
"""Steps of seconds in float32 at 64 s and beyond, each twice the last, us: 7.63 to 122. Earlier ones are finer than a
microsecond or two."""

STEPS: Final = (*map(float, range(FINEST, COARSEST + 1)), *FLOAT32_STEPS_US)


@dataclass(frozen=True, slots=True)
class CombCounts:
    """Occupied ticks of a stretch, and how many of them each comb of ``STEPS`` meets: ``hits`` of ``teeth`` (k,)."""

    occupied: int
    ticks: int
    hits: Int64
    teeth: Int64

    def deviates(self) -> Float64:
        """Return how improbable so many hits are by chance (k,), as deviates of a normal distribution, 0 at least."""
        share = self.occupied / max(self.ticks, 1)
        chances = log_chance_of_hits(self.hits, self.teeth, share)
        deviates: Float64 = np.maximum(-ndtri_exp(np.minimum(chances, 0.0)), 0.0)
        return deviates


def comb_counts(stamps: Int64) -> CombCounts:
    """Count the occupied ticks under every comb through 0; ``stamps`` are whole ticks, sorted."""
    if not len(stamps):
        none = np.zeros(len(STEPS), np.int64)
        return CombCounts(0, 0, none, none)
    first, last = int(stamps[0]), int(stamps[-1])
    occupied = np.zeros(last - first + 1, np.bool_)
    occupied[stamps - first] = True
    hits, teeth = np.zeros(len(STEPS), np.int64), np.zeros(len(STEPS), np.int64)
    for i, step in enumerate(STEPS):
        if step.is_integer():
            comb = occupied[(-first) % int(step) :: int(step)]
        else:
            numbers = np.arange(int(np.ceil(first / step)), int(np.floor(last / step)) + 1)
            comb = occupied[np.clip(np.rint(numbers * step).astype(np.int64) - first, 0, last - first)]
        hits[i], teeth[i] = np.count_nonzero(comb), len(comb)
    return CombCounts(int(np.count_nonzero(occupied)), len(occupied), hits, teeth)
