"""A coarse grid that a part of the stamps lies on, among others that do not.

A comb of g ticks meets the occupied ticks at one in g where stamps know nothing of it. Ticks count once however many
events they hold, so that an edge which lets a whole column fire at once is one witness, not many.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.clocks.comb_kernels import count_hits
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
"""All combs look at a tick some eight times, 10 ns, and at a stamp 2000 times, 7 us: here both take as long, about."""

_TIMESTAMPS_TOGETHER: Final = 1 << 12


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
        # So many are met by chance once in two times or more: the median is not below the mean, rounded down.
        more = self.hits > np.floor(self.teeth * share)
        deviates = np.zeros(len(self.hits))
        chances = log_chance_of_hits(self.hits[more], self.teeth[more], share)
        deviates[more] = np.maximum(-ndtri_exp(np.minimum(chances, 0.0)), 0.0)
        return deviates


def comb_counts(timestamps: Int64) -> CombCounts:
    """Count the occupied ticks under every comb through 0; ``stamps`` are whole ticks, sorted.

    Looks at every tick of the stretch where it is crowded, at every stamp where it is not: stamps may be years apart.
    """
    if not len(timestamps):
        none = np.zeros(len(STEPS), np.int64)
        return CombCounts(0, 0, none, none)
    ticks = int(timestamps[-1]) - int(timestamps[0]) + 1
    occupied = timestamps[np.diff(timestamps, prepend=timestamps[0] - 1) > 0]
    count = _hits_by_tick if ticks < len(occupied) * _TICKS_PER_TIMESTAMP else _hits_by_timestamp
    teeth = _teeth(int(timestamps[0]), int(timestamps[-1]))
    return CombCounts(len(occupied), ticks, np.minimum(count(occupied), teeth), teeth)  # beyond 2^53 teeth merge


def _teeth(first: int, last: int) -> Int64:
    """Count the teeth of each comb from the first tick to the last."""
    return np.asarray(np.concatenate([last // _WHOLE + -first // _WHOLE + 1, *(
        [upto - begin + 1] for begin, upto in (_numbers(first, last, step) for step in FLOAT32_STEPS_US)
    )]))  # fmt: skip


def _numbers(first: int, last: int, step: float) -> tuple[int, int]:
    """Return the numbers of the first and the last tooth."""
    return int(np.ceil(first / step)), int(np.floor(last / step))


def _hits_by_tick(occupied: Int64) -> Int64:
    first, last = int(occupied[0]), int(occupied[-1])
    there = np.zeros(last - first + 1, np.bool_)
    there[occupied - first] = True
    hits = np.empty(len(STEPS), np.int64)
    count_hits(there, first, FINEST, hits[: len(_WHOLE)])
    for i, step in enumerate(FLOAT32_STEPS_US, len(_WHOLE)):
        begin, upto = _numbers(first, last, step)
        ticks = np.rint(np.arange(begin, upto + 1) * step).astype(np.int64) - first
        hits[i] = np.count_nonzero(there[np.clip(ticks, 0, last - first)])
    return hits


def _hits_by_timestamp(occupied: Int64) -> Int64:
    """Count the same: of a tick that a tooth rounds to it is the nearest tooth."""
    first, last = int(occupied[0]), int(occupied[-1])
    hits = np.zeros(len(STEPS), np.int64)
    for start in range(0, len(occupied), _TIMESTAMPS_TOGETHER):
        hits[: len(_WHOLE)] += np.count_nonzero(
            occupied[start : start + _TIMESTAMPS_TOGETHER, None] % _WHOLE == 0, axis=0
        )
    for i, step in enumerate(FLOAT32_STEPS_US, len(_WHOLE)):
        begin, upto = _numbers(first, last, step)
        numbers = np.rint(occupied / step)
        hits[i] = np.count_nonzero((numbers >= begin) & (numbers <= upto) & (np.rint(numbers * step) == occupied))
    return hits
