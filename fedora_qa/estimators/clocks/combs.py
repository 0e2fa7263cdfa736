"""A coarse grid on which a part of the timestamps lie, among others that do not.

A comb of g ticks meets one in g of the occupied ticks where timestamps do not depend on it. Ticks count once however
many events they hold: an edge that lets a whole column fire at once is one observation, not many.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.fitting.tails import log_chance_of_hits

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

FINEST: Final = 2
COARSEST: Final = 2000
"""Grids that are tried, in ticks: every whole number."""

FLOAT32_STEPS_US: Final = tuple(1e6 * 2.0**-k for k in range(17, 12, -1))
"""Steps of seconds in float32 at 64 s and beyond, each twice the last, us: 7.63 to 122. Earlier ones are finer than a
microsecond or two."""

STEPS: Final = (*map(float, range(FINEST, COARSEST + 1)), *FLOAT32_STEPS_US)

_WHOLE: Final = np.arange(FINEST, COARSEST + 1)

_TICKS_PER_TIMESTAMP: Final = 500
"""Ticks for each timestamp at which both ways of counting take about as long: all combs together visit a tick some
eight times, in 10 ns, and a timestamp 2000 times, in 7 us."""

_TIMESTAMPS_PER_BLOCK: Final = 1 << 12


@dataclass(frozen=True, slots=True)
class CombCounts:
    """Occupied ticks of a window, and how many of them each comb of ``STEPS`` meets: ``hits`` of ``teeth`` (k,)."""

    occupied: int
    ticks: int
    hits: Int64
    teeth: Int64

    def deviates(self) -> Float64:
        """Return how improbable so many hits are by chance (k,), as deviates of a normal distribution, 0 at least."""
        occupancy = self.occupied / max(self.ticks, 1)
        # floor(mean) hits or more occur by chance at least every other time: the median is not below floor(mean).
        more = self.hits > np.floor(self.teeth * occupancy)
        deviates = np.zeros(len(self.hits))
        chances = log_chance_of_hits(self.hits[more], self.teeth[more], occupancy)
        deviates[more] = np.maximum(-ndtri_exp(np.minimum(chances, 0.0)), 0.0)
        return deviates


def comb_counts(timestamps: Int64) -> CombCounts:
    """Count the occupied ticks under every comb through 0.

    Parameters
    ----------
    timestamps
        (n,) whole ticks, sorted.

    Returns
    -------
    CombCounts
        Hits and teeth of each comb of ``STEPS``.
    """
    if not len(timestamps):
        none = np.zeros(len(STEPS), np.int64)
        return CombCounts(0, 0, none, none)
    ticks = int(timestamps[-1]) - int(timestamps[0]) + 1
    occupied = timestamps[np.diff(timestamps, prepend=timestamps[0] - 1) > 0]
    # Timestamps may be years apart: ticks are visited where they are crowded, timestamps where they are not.
    count = _hits_by_tick if ticks < len(occupied) * _TICKS_PER_TIMESTAMP else _hits_by_timestamp
    teeth = _teeth(int(timestamps[0]), int(timestamps[-1]))
    return CombCounts(len(occupied), ticks, np.minimum(count(occupied), teeth), teeth)  # beyond 2^53 teeth merge


def _teeth(first: int, last: int) -> Int64:
    """Count the teeth of each comb from the first tick to the last."""
    # Multiples of g from a to b: floor(b / g) - ceil(a / g) + 1, with ceil(a / g) = -floor(-a / g).
    return np.asarray(np.concatenate([last // _WHOLE + -first // _WHOLE + 1, *(
        [upto - begin + 1] for begin, upto in (_numbers(first, last, step) for step in FLOAT32_STEPS_US)
    )]))  # fmt: skip


def _numbers(first: int, last: int, step: float) -> tuple[int, int]:
    """Return the numbers of the first and the last tooth."""
    return int(np.ceil(first / step)), int(np.floor(last / step))


def _hits_by_tick(occupied: Int64) -> Int64:
    first, last = int(occupied[0]), int(occupied[-1])
    is_occupied = np.zeros(last - first + 1, np.bool_)
    is_occupied[occupied - first] = True
    hits = np.empty(len(STEPS), np.int64)
    count_hits(is_occupied, first, FINEST, hits[: len(_WHOLE)])
    for i, step in enumerate(FLOAT32_STEPS_US, len(_WHOLE)):
        begin, upto = _numbers(first, last, step)
        ticks = np.rint(np.arange(begin, upto + 1) * step).astype(np.int64) - first
        hits[i] = np.count_nonzero(is_occupied[np.clip(ticks, 0, last - first)])
    return hits


def _hits_by_timestamp(occupied: Int64) -> Int64:
    """Count the same: of a tick that a tooth rounds to it is the nearest tooth."""
    first, last = int(occupied[0]), int(occupied[-1])
    hits = np.zeros(len(STEPS), np.int64)
    # By blocks: the remainders of 4096 timestamps by all combs take 65 MB.
    for start in range(0, len(occupied), _TIMESTAMPS_PER_BLOCK):
        hits[: len(_WHOLE)] += np.count_nonzero(
            occupied[start : start + _TIMESTAMPS_PER_BLOCK, None] % _WHOLE == 0, axis=0
        )
    for i, step in enumerate(FLOAT32_STEPS_US, len(_WHOLE)):
        begin, upto = _numbers(first, last, step)
        numbers = np.rint(occupied / step)
        hits[i] = np.count_nonzero((numbers >= begin) & (numbers <= upto) & (np.rint(numbers * step) == occupied))
    return hits


@njit(cache=True)
def count_hits(occupied: NDArray[np.bool_], first: int, finest: int, hits: Int64) -> None:
    """Write how many occupied ticks lie on the combs through 0 of ``finest`` ticks, of one more, and so on, (k,).

    ``occupied`` (t,) marks ticks from ``first`` on.
    """
    for comb in range(len(hits)):
        step = np.uint64(finest + comb)
        # The first tick on the comb, counted from ``first``.
        tick, hit_count = np.uint64((-first) % (finest + comb)), 0
        while tick < np.uint64(len(occupied)):
            hit_count += occupied[tick]
            tick += step
        hits[comb] = hit_count
