"""Grids on which timestamps lie: seconds of single precision, combs that a part of them meets, ticks that many share.

A comb of g ticks meets one in g of the occupied ticks where timestamps do not depend on it. Ticks count once however
many events they hold: an edge that lets a whole column fire at once is one observation, not many.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.conventions import US_PER_S
from fedora_qa.estimators.fitting.tails import log_chance_of_hits

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

_LEAST_SPACING_US: Final = 2.0
"""Below, single-precision seconds are about as fine as a microsecond, and every timestamp can be one."""

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

_CROWD: Final = 8
"""Events at one timestamp, and such timestamps in a window, from which on they are no coincidence."""

_MOST_CROWDED: Final = 0.9
"""Ratio of the events that lie at such timestamps, where timestamps have a tick of their own."""


def single_precision_spacing_us(times_us: NDArray[np.float64]) -> float:
    """Return the coarsest spacing of single-precision seconds if all timestamps (n,) could have been such, 0 otherwise.

    A float32 has 24 bits (IEEE 754): seconds above 2^k are 2^(k-23) s apart, 3.8 us from 32 s on. Timestamps must round
    to the microsecond of such a number; by chance a timestamp does so with probability one over the spacing in us. The
    result is 0 where chance alone would let all of them do so more often than once in a million files.

    Parameters
    ----------
    times_us
        (n,) timestamps as the file holds them, us.

    Returns
    -------
    float
        us.
    """
    seconds = np.asarray(times_us, dtype=np.float64) / US_PER_S
    single = seconds.astype(np.float32)
    spacing_us = np.abs(np.spacing(single)).astype(np.float64) * US_PER_S
    coarse = spacing_us >= _LEAST_SPACING_US
    if not coarse.any():
        return 0.0
    nearest_us = np.rint(single[coarse].astype(np.float64) * US_PER_S)
    if not np.array_equal(nearest_us, np.rint(times_us[coarse])):
        return 0.0
    return float(spacing_us.max()) if surely_no_chance(spacing_us[coarse]) else 0.0


def surely_no_chance(grids_us: NDArray[np.float64]) -> bool:
    """Whether random timestamps would all lie on their grids, spacings (n,) us, less often than once in a million."""
    # Each lies on its grid with probability 1 / g (g in us, timestamps of 1 us): the product is below 1e-6.
    return float(np.log10(grids_us).sum()) > 6.0


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
    first, last = int(timestamps[0]), int(timestamps[-1])
    ticks = last - first + 1
    occupied = timestamps[np.diff(timestamps, prepend=timestamps[0] - 1) > 0]
    # Timestamps may be years apart: ticks are visited where they are crowded, timestamps where they are not.
    count = _hits_by_tick if ticks < len(occupied) * _TICKS_PER_TIMESTAMP else _hits_by_timestamp
    # Multiples of g from a to b: floor(b / g) - ceil(a / g) + 1, with ceil(a / g) = -floor(-a / g).
    whole = last // _WHOLE + -first // _WHOLE + 1
    numbers = [_numbers(first, last, step) for step in FLOAT32_STEPS_US]
    teeth = np.asarray(np.concatenate([whole, *([upto - begin + 1] for begin, upto in numbers)]))
    return CombCounts(len(occupied), ticks, np.minimum(count(occupied), teeth), teeth)  # beyond 2^53 teeth merge


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


def crowded_step_ns(times_ns: Int64) -> int:
    """Return the usual distance of timestamps that nine of ten events share with many others; 0 where they do not.

    Parameters
    ----------
    times_ns
        (n,) timestamps of a window, sorted.

    Returns
    -------
    int
        ns.
    """
    if not are_crowded(times_ns, _CROWD, _MOST_CROWDED):
        return 0
    first = np.flatnonzero(np.diff(times_ns, prepend=times_ns[:1] - 1))
    counts = np.diff(first, append=len(times_ns))
    crowded = counts >= max(_CROWD, 0.1 * float(counts.max(initial=0)))
    if np.count_nonzero(crowded) < _CROWD or counts[crowded].sum() < _MOST_CROWDED * len(times_ns):
        return 0
    # Between crowded timestamps only: a stray event between two of them would shorten a step.
    return int(np.median(np.diff(times_ns[first[crowded]])))


@njit(cache=True)
def are_crowded(t: Int64, crowd: int, ratio: float) -> bool:
    """Whether ``ratio`` of the events or more lie at ``crowd`` or more timestamps of ``crowd`` or more events each."""
    crowds, alone, begin = 0, 0, 0
    for i in range(len(t)):
        if i + 1 == len(t) or t[i + 1] != t[i]:
            count = i + 1 - begin
            crowds += count >= crowd
            alone += count if count < crowd else 0
            # The usual window has no tick of its own, and is left as soon as too many events lie alone.
            if len(t) - alone < ratio * len(t):
                return False
            begin = i + 1
    return crowds >= crowd
