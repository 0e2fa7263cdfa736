"""Events of one pixel and polarity at one timestamp, where timestamps lie on a grid: which are no coincidence.

Timestamps that are moved up to multiples of a tick give two events of a pixel the same timestamp if their interval is
shorter than the tick. Of intervals u (in ticks) with density f, the expected number of pairs whose timestamps differ by
k ticks is, as the phase of the grid is independent of the light,

    n_0 = integral of f(u) max(0, 1 - u),     n_k = integral of f(u) max(0, 1 - |u - k|),  k >= 1.

If f does not fall from 0 on, n_0 <= n_k / 2, with equality for a constant density. Duplicated events are added to n_0
alone. The density does fall where an edge passes a pixel within a tick. Such an edge also passes neighbouring pixels
within a few ticks, so that pairs count only at *quiet* pixels: no neighbour has two events of that polarity fewer than
``NEAR`` ticks apart, ``AROUND`` ticks before or after. Events of the pixel itself are no criterion, as they would
select n_0 and n_k differently.

Events without a cause in the light (shot noise, hot pixels) have exponential intervals, f = exp(-m u) with m events a
tick, which falls. Pixels with more than ``MOST_PER_TICK`` events of a polarity a tick do not count; for the others

    n_0 : n_k = (m - 1 + exp(-m)) : (1 - exp(-m))^2 exp(-(k - 1) m)

at m = ``MOST_PER_TICK`` bounds the ratio, also that of a constant density. Given n = n_0 + n_1 + ... + n_j pairs, n_0
has the binomial distribution of that ratio, whatever the unknown rate.

Where timestamps lie on no grid, the tick is a microsecond. Events of a pixel coincide where their timestamps err
independently of each other, by jitter or by spurious events. The density of their signed interval is then constant over
``NEAR_US``, so that intervals of 0 and of 1 to K us occur in the ratio 1 : 2 K, and n_0 of n pairs up to K us is
binomial again. A stream without any pair up to K us is exact: its least interval is longer, and even one coincidence is
a repeat. With f coincidences expected, an inexact stream has a coincidence and no other pair with the probability
``f exp(-2 K f)`` at most, which is below 1 / (2 e K) for every f.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import gammainc, ndtri_exp

from fedora_qa.estimators.fitting.tails import log_chance_of_hits

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]

NEAR: Final = 8
"""Interval, in ticks, up to which events of a neighbour are close, and up to which pairs are counted."""

AROUND: Final = 16
"""Time before and after a pair, in ticks, in which neighbours must be quiet: an edge that passes a pixel within a tick
passes its neighbours within a few."""

NEAR_US: Final = 64
"""Interval K, in microseconds, of pairs that count as close where timestamps lie on no grid.

The longer, the fewer inexact streams have a coincidence and no close pair: 0.3% at most. It is shorter than the time
between events of a pixel of an exact stream: the refractory time of sensors, 0.1 ms and more, and the time between two
thresholds, as a slope of one threshold of 0.2 in 64 us is the full range of 8 bits (5.5 nat) within 1.8 ms.
"""

MOST_PER_TICK: Final = 1 / 16
"""Most events of a pixel and polarity a tick, in the mean."""

TILE_PX: Final = 8
"""Side of the tiles of which each counts once in a tick: pixels of one edge fire alike."""

FEWEST_EVENTS: Final = 8
"""Least number of events of a doubled tick."""

_DETECTED: Final = 5.0
"""Deviate at which the scale of the counts is set: about that of a limit at the false-alarm rate of a file."""


class ChanceCount(NamedTuple):
    """How many coincidences a correct stream has.

    Attributes
    ----------
    expected
        Their number.
    standard_error
        The excess of the least count with a deviate of 5, over that deviate.
    """

    expected: float
    standard_error: float


@njit(cache=True)
def count_quiet_pairs(
    starts: Int32,
    timestamped: Int64,
    shape: tuple[int, int],
    tick: int,
    start: int,
    stop: int,
    most: float,
    counts: Int64,
) -> tuple[int, int]:
    """Count the pairs of successive events of one polarity at quiet pixels, by the ticks between them.

    Parameters
    ----------
    starts, timestamped
        Events by pixel, as in ``PixelEvents``.
    shape
        Rows and columns of the sensor. Pixels at its rim, which lack neighbours, do not count.
    tick
        Step of the timestamps, ns.
    start, stop
        Pairs count whose later event lies in this interval, ns, half-open.
    most
        Most events of a polarity of a pixel.
    counts
        (k + 1,) receives the numbers of pairs that are 0 to k ticks apart.

    Returns
    -------
    tuple[int, int]
        Pixel and timestamp, ns, of the earliest pair at one timestamp; -1 and ``stop`` without one.
    """
    height, width = shape
    near = (len(counts) - 1) * tick
    first_pixel, first_time = -1, stop
    for row in range(1, height - 1):
        for column in range(1, width - 1):
            pixel = row * width + column
            for polarity in range(2):
                count = 0
                for i in range(starts[pixel], starts[pixel + 1]):
                    count += timestamped[i] & 1 == polarity
                if count < 2 or count > most:
                    continue
                earlier = np.int64(-1)
                for i in range(starts[pixel], starts[pixel + 1]):
                    if timestamped[i] & 1 != polarity:
                        continue
                    later = timestamped[i] >> 1
                    between = later - earlier
                    begin, end = earlier - AROUND * tick, later + AROUND * tick
                    is_pair = earlier >= 0 and between <= near and start <= later < stop
                    if is_pair and _is_quiet(starts, timestamped, pixel, width, polarity, begin, end, near):
                        counts[between // tick] += 1
                        if between < tick and later < first_time:
                            first_pixel, first_time = pixel, later
                    earlier = later
    return first_pixel, first_time


@njit(cache=True)
def _is_quiet(
    starts: Int32, timestamped: Int64, pixel: int, width: int, polarity: int, begin: np.int64, end: np.int64, near: int
) -> bool:
    """Return whether no neighbour has two events of a polarity within ``near``, from ``begin`` to ``end``, ns."""
    for row in range(-1, 2):
        for column in range(-1, 2):
            neighbour = pixel + row * width + column
            if neighbour == pixel:
                continue
            low, high = starts[neighbour], starts[neighbour + 1]
            while low < high:
                middle = (low + high) // 2
                if timestamped[middle] < 2 * begin:
                    low = middle + 1
                else:
                    high = middle
            earlier = np.int64(-1)
            for i in range(low, starts[neighbour + 1]):
                time = timestamped[i] >> 1
                if time > end:
                    break
                if timestamped[i] & 1 == polarity:
                    if earlier >= 0 and time - earlier <= near:
                        return False
                    earlier = time
    return True


def chance_of_repeats(counts: Int64) -> ChanceCount:
    """Return how many pairs at one timestamp a correct stream has at quiet pixels.

    Each number j of ticks gives a bound, as the density does not fall. The bound under which the observed count has the
    least probability is taken, of ``NEAR`` tests.

    Parameters
    ----------
    counts
        (NEAR + 1,) numbers of pairs that are 0 to ``NEAR`` ticks apart.

    Returns
    -------
    ChanceCount
        Of pairs at one timestamp.
    """
    m, ticks = MOST_PER_TICK, np.arange(1, NEAR + 1)
    at_once = m - 1 + np.exp(-m)
    shares = at_once / (at_once + np.cumsum((1 - np.exp(-m)) ** 2 * np.exp(-(ticks - 1) * m)))
    apart = np.cumsum(counts[1:])

    def deviates(repeats: int) -> Float64:
        # P(n_0 or more of n pairs), binomial.
        chances = [log_chance_of_hits(repeats, repeats + int(apart[j]), float(shares[j])) for j in range(NEAR)]
        return np.asarray(-ndtri_exp(np.minimum(chances, 0.0)))

    repeats = int(counts[0])
    best = int(np.argmax(deviates(max(repeats, 1))))
    expected = float(apart[best] * shares[best] / (1 - shares[best]))
    return _scaled(expected, lambda count: float(deviates(count)[best]))


def chance_of_coincidences(close: int) -> ChanceCount:
    """Return how many events have pixel and timestamp of another by chance where timestamps lie on no grid.

    Parameters
    ----------
    close
        Number of pairs of successive events of a pixel that are 1 to ``NEAR_US`` us apart.

    Returns
    -------
    ChanceCount
        Of coincidences; both 0 without close pairs, as an exact stream has none.
    """
    if not close:
        return ChanceCount(0.0, 0.0)
    share = 1 / (2 * NEAR_US + 1)
    return _scaled(
        close / (2 * NEAR_US), lambda count: float(-ndtri_exp(log_chance_of_hits(count, count + close, share)))
    )


def chance_of_doubled_ticks(expected: float) -> ChanceCount:
    """Return the scale of a number of doubled ticks, which are independent of each other by chance.

    Parameters
    ----------
    expected
        Their number by chance.

    Returns
    -------
    ChanceCount
        Of doubled ticks.
    """

    def deviate(count: int) -> float:
        # P(N >= k) = P(k, mu), the regularised incomplete gamma function (Abramowitz and Stegun 1964, 26.4.21).
        return float(-ndtri_exp(np.log(max(float(gammainc(count, expected)), 1e-300))))

    return _scaled(expected, deviate)


def _scaled(expected: float, deviate: Callable[[int], float]) -> ChanceCount:
    """Return the count by chance, on the scale of the least count with a deviate of ``_DETECTED``."""
    # The tails are heavier than a normal one: no smaller count has the deviate.
    count = int(expected + _DETECTED * np.sqrt(expected)) + 1
    while deviate(count) < _DETECTED:
        count += 1
    return ChanceCount(expected, (count - expected) / deviate(count))


@njit(cache=True)
def tally_ticks(
    x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int], doubled: Int64
) -> tuple[int, int]:
    """Count tiles whose pixels all have an even number of events of each polarity in a tick.

    Parameters
    ----------
    x, y, t, p
        (m,) events: columns, rows, timestamps (ns) and polarities (0 or 1), in the order of time.
    shape
        Rows and columns of the sensor.
    doubled
        (k + 1,) receives the numbers of doubled ticks (``find_repeats``) with 0 to k tiles; those of more count as k.

    Returns
    -------
    tuple[int, int]
        Of all other ticks: the number of tiles with an event, and of those that are even.
    """
    side = np.int64(TILE_PX)
    tiles_wide = (shape[1] - 1) // side + 1
    odd = np.zeros((2, *shape), np.bool_)
    unpaired = np.zeros(((shape[0] - 1) // side + 1) * tiles_wide, np.int64)
    counted = np.zeros(len(unpaired), np.bool_)
    begin, all_tiles, all_even = 0, 0, 0
    for i in range(len(t)):
        tile = (np.int64(y[i]) // side) * tiles_wide + np.int64(x[i]) // side
        odd[p[i], y[i], x[i]] ^= True
        unpaired[tile] += 1 if odd[p[i], y[i], x[i]] else -1
        if i + 1 < len(t) and t[i + 1] == t[i]:
            continue
        tiles, even = 0, 0
        for j in range(begin, i + 1):
            tile = (np.int64(y[j]) // side) * tiles_wide + np.int64(x[j]) // side
            if not counted[tile]:
                counted[tile] = True
                tiles += 1
                even += unpaired[tile] == 0
        for j in range(begin, i + 1):
            tile = (np.int64(y[j]) // side) * tiles_wide + np.int64(x[j]) // side
            odd[p[j], y[j], x[j]], counted[tile], unpaired[tile] = False, False, 0
        if even == tiles and i + 1 - begin >= FEWEST_EVENTS:
            doubled[min(tiles, len(doubled) - 1)] += 1
        else:
            all_tiles += tiles
            all_even += even
        begin = i + 1
    return all_tiles, all_even
