"""Grids on which timestamps lie: seconds of single precision, combs, and ticks that many events share.

A comb is the set of all multiples of one step, its teeth. A comb of g ticks meets (contains) one in g of the occupied
ticks if the timestamps do not depend on it. Each occupied tick counts once, however many events it holds: an edge that
triggers a whole column of pixels at once is one observation.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.conventions import NS_PER_US, US_PER_S
from fedora_qa.estimators.fitting.tails import log_chance_of_hits

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

_LEAST_SPACING_US: Final = 2.0
"""Least spacing of single-precision seconds that is tested, us. With a spacing of about 1 us every timestamp in whole
microseconds can come from a single-precision number."""

FINEST: Final = 2
COARSEST: Final = 2000
"""Least and largest step of the combs of whole ticks, ticks. Every whole number between them is tried."""

FLOAT32_STEPS_US: Final = tuple(1e6 * 2.0**-k for k in range(17, 12, -1))
"""Spacing of float32 seconds from 64 s on, us: 7.63 to 122. Each is twice the one before. Before 64 s the spacing is at
most 3.8 us."""

# Steps of all combs, (k,).
STEPS: Final = (*map(float, range(FINEST, COARSEST + 1)), *FLOAT32_STEPS_US)

# Steps of whole ticks: the first part of ``STEPS``.
_WHOLE: Final = np.arange(FINEST, COARSEST + 1)

_TICKS_PER_TIMESTAMP: Final = 500
"""Ticks for each occupied tick at which ``_hits_by_tick`` and ``_hits_by_timestamp`` take equally long. By ticks all
combs together read a tick about eight times (10 ns); by timestamps they divide a timestamp 2000 times (7 us)."""

_TIMESTAMPS_PER_BLOCK: Final = 1 << 12

_CROWD: Final = 8
"""Least number of events at a crowded timestamp, and least number of crowded timestamps in a window. Fewer can be a
coincidence."""

_MOST_CROWDED: Final = 0.9
"""Least share (0 to 1) of the events that lie at crowded timestamps where the timestamps have a coarse step."""

_BESIDE_US: Final = 64
"""Time before and after a timestamp, us, in which events are counted to compare. The rate of events is the same there,
unless an edge triggers many pixels within a microsecond; edges do so at times that lie on no grid."""

_LOG_CHANCE_OF_CROWD: Final = float(np.log(1e-6))
"""Natural logarithm of the probability that a window without a grid has a crowded timestamp."""


def single_precision_spacing_us(times_us: NDArray[np.float64]) -> float:
    """Return the coarsest spacing of single-precision seconds if all timestamps can be such numbers, 0 otherwise.

    A float32 has 24 bits (IEEE 754): seconds above 2^k are 2^(k-23) s apart, 3.8 us from 32 s on. Each timestamp must
    be such a number, rounded to a microsecond. By chance a timestamp is one with a probability of 1 over the spacing in
    us. The result is 0 where all timestamps would be such numbers by chance in more than one of a million files.

    Parameters
    ----------
    times_us
        (n,) timestamps as the file holds them, us.

    Returns
    -------
    float
        The spacing at the latest timestamps, us; 0 where the timestamps are not of single precision.
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
    """Return whether random timestamps lie all on their grids with a probability below 1e-6.

    Parameters
    ----------
    grids_us
        (n,) spacing of the grid at each timestamp, us.

    Returns
    -------
    bool
        True where chance is excluded.
    """
    # A timestamp in whole us lies on a grid of g us with probability 1 / g: prod(1 / g) < 1e-6.
    return float(np.log10(grids_us).sum()) > 6.0


@dataclass(frozen=True, slots=True)
class CombCounts:
    """Occupied ticks of a window, and how many of them each of the k combs of ``STEPS`` meets.

    Attributes
    ----------
    occupied
        Number of ticks that hold a timestamp.
    ticks
        Number of ticks from the first timestamp to the last, both included.
    hits
        (k,) number of teeth of each comb that are occupied ticks.
    teeth
        (k,) number of teeth of each comb from the first timestamp to the last.
    """

    occupied: int
    ticks: int
    hits: Int64
    teeth: Int64

    def deviates(self) -> Float64:
        """Return how improbable so many hits are by chance.

        Returns
        -------
        Float64
            (k,) deviates of a standard normal distribution with the same tail probability, 0 at least.
        """
        occupancy = self.occupied / max(self.ticks, 1)
        # floor(mean) hits or more have a probability of at least 1/2: a binomial median is not below floor(mean).
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
    # Timestamps may be years apart: all ticks are read where many are occupied, all timestamps where few are.
    count = _hits_by_tick if ticks < len(occupied) * _TICKS_PER_TIMESTAMP else _hits_by_timestamp
    # Multiples of g from a to b: floor(b / g) - ceil(a / g) + 1, with ceil(a / g) = -floor(-a / g).
    whole = last // _WHOLE + -first // _WHOLE + 1
    numbers = [_numbers(first, last, step) for step in FLOAT32_STEPS_US]
    teeth = np.asarray(np.concatenate([whole, *([upto - begin + 1] for begin, upto in numbers)]))
    return CombCounts(len(occupied), ticks, np.minimum(count(occupied), teeth), teeth)  # beyond 2^53 teeth merge


def is_on_comb(timestamps: Int64, step: float) -> NDArray[np.bool_]:
    """Return which timestamps lie on a comb through 0.

    Parameters
    ----------
    timestamps
        (n,) whole ticks.
    step
        Of ``STEPS``, ticks.

    Returns
    -------
    ndarray of bool
        (n,) True on a tooth, rounded to whole ticks.
    """
    on_comb: NDArray[np.bool_]
    if step.is_integer():
        on_comb = timestamps % int(step) == 0  # exact beyond 2^53 as well
    else:
        on_comb = np.rint(np.rint(timestamps / step) * step) == timestamps
    return on_comb


def _numbers(first: int, last: int, step: float) -> tuple[int, int]:
    """Return the numbers of the first and the last tooth between two ticks, both included."""
    return int(np.ceil(first / step)), int(np.floor(last / step))


def _hits_by_tick(occupied: Int64) -> Int64:
    """Return the hits (k,) of all combs among occupied ticks (n,), by reading the ticks of each comb."""
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
    """Return the same as ``_hits_by_tick``, by dividing each occupied tick by each step.

    If a tooth rounds to a tick, it is the tooth nearest to that tick.
    """
    first, last = int(occupied[0]), int(occupied[-1])
    hits = np.zeros(len(STEPS), np.int64)
    # In blocks: the remainders of 4096 timestamps by all combs take 65 MB.
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
    """Count the occupied ticks on each of k combs through tick 0, whose steps are successive whole numbers.

    Parameters
    ----------
    occupied
        (t,) True where a tick holds a timestamp.
    first
        Number of the tick at index 0.
    finest
        Step of the first comb, ticks; comb i has the step ``finest + i``.
    hits
        (k,) receives the counts.
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
    """Return the median distance of crowded timestamps if nine of ten events lie at crowded timestamps, 0 otherwise.

    Parameters
    ----------
    times_ns
        (n,) timestamps of the events of a window, sorted, ns.

    Returns
    -------
    int
        Median distance of neighbouring crowded timestamps, ns; 0 where too few events lie at such timestamps.
    """
    if not are_crowded(times_ns, _CROWD, _MOST_CROWDED):
        return 0
    first = np.flatnonzero(np.diff(times_ns, prepend=times_ns[:1] - 1))
    counts = np.diff(first, append=len(times_ns))
    crowded = counts >= max(_CROWD, 0.1 * float(counts.max(initial=0)))
    if np.count_nonzero(crowded) < _CROWD or counts[crowded].sum() < _MOST_CROWDED * len(times_ns):
        return 0
    # Between crowded timestamps only: a single event between two of them would shorten a step.
    return int(np.median(np.diff(times_ns[first[crowded]])))


def moved_together(chosen_ns: Int64, times_ns: Int64) -> NDArray[np.bool_]:
    """Return which timestamps are those to which a part of the events was moved: a grid, or the ends of a stream.

    Crowded timestamps between the ends are a grid where they have a common step.

    Parameters
    ----------
    chosen_ns
        (k,) timestamps, ns.
    times_ns
        (n,) timestamps of the events of a window and of its halo, sorted, ns. Whole microseconds.

    Returns
    -------
    NDArray[np.bool_]
        (k,) True for timestamps on such a grid, crowded or not, and for the first and the last one of the events where
        these are crowded.
    """
    crowded_ns = crowded_timestamps(times_ns)
    # Whoever limits timestamps to those of the stream moves events to its ends, whatever the grid.
    is_end = np.isin(crowded_ns, times_ns[[0, -1]]) if len(crowded_ns) else np.zeros(0, np.bool_)
    moved = np.isin(chosen_ns, crowded_ns[is_end])
    within_ns = crowded_ns[~is_end]
    steps_ns = np.diff(within_ns)
    step_ns = int(np.gcd.reduce(steps_ns)) if len(steps_ns) else 0
    if step_ns > NS_PER_US and surely_no_chance(np.full(len(steps_ns), step_ns / NS_PER_US)):
        moved |= (chosen_ns - within_ns[0]) % step_ns == 0
    return moved


def crowded_timestamps(times_ns: Int64) -> Int64:
    """Return the timestamps whose number of events is improbable beside those of the ``_BESIDE_US`` before and after.

    Of M + c events, M at the timestamp and c beside it, M is binomial with the share of one microsecond.

    Parameters
    ----------
    times_ns
        (n,) timestamps of the events of a window and of its halo, sorted, ns. Whole microseconds.

    Returns
    -------
    NDArray[np.int64]
        (k,) in ascending order, ns.
    """
    distinct_ns, counts = np.unique(times_ns, return_counts=True)
    beside_ns = _BESIDE_US * NS_PER_US
    before = np.searchsorted(times_ns, distinct_ns - beside_ns, "left")
    after = np.searchsorted(times_ns, distinct_ns + beside_ns, "right")
    # Number of microseconds that are compared: fewer at the ends.
    compared_us = 1 + (
        np.minimum(distinct_ns - distinct_ns[:1], beside_ns) + np.minimum(distinct_ns[-1:] - distinct_ns, beside_ns)
    ) / NS_PER_US  # fmt: skip
    log_chances = log_chance_of_hits(counts, after - before, 1 / compared_us)
    chances = log_chances + np.log(max(len(distinct_ns), 1))
    crowded: Int64 = distinct_ns[chances < _LOG_CHANCE_OF_CROWD]
    return crowded


@njit(cache=True)
def are_crowded(t: Int64, crowd: int, ratio: float) -> bool:
    """Return whether enough events lie at timestamps that many events share.

    Parameters
    ----------
    t
        (n,) timestamps, sorted.
    crowd
        Least number of events at a crowded timestamp, and least number of crowded timestamps.
    ratio
        Least share of the events, 0 to 1, that lie at crowded timestamps.

    Returns
    -------
    bool
        False where there are fewer crowded timestamps, or where a smaller share of the events lies at them.
    """
    crowds, alone, begin = 0, 0, 0
    for i in range(len(t)):
        if i + 1 == len(t) or t[i + 1] != t[i]:
            count = i + 1 - begin
            crowds += count >= crowd
            alone += count if count < crowd else 0
            # Most windows have few crowded timestamps: the loop ends as soon as the share cannot be reached.
            if len(t) - alone < ratio * len(t):
                return False
            begin = i + 1
    return crowds >= crowd
