"""Rates of events: pixels that fire too often, silences of the whole sensor, and events without company.

A silence of the whole sensor is compared with the counts in bins of the same length beside it. If the rate of a stream
itself fluctuates, the counts follow a gamma-Poisson distribution. With mean m and a relative variance 1/r of the rate,
the probability of an empty bin is (1 + m / r)^-r (Greenwood and Yule 1920). The bins give 1/r: the variance of the rate
between bins plus the variance of their mean. If motion stops and starts again, the bins beside the silence are empty or
uneven as well, so that the silence is probable. A lost packet does not change the bins beside it.

The order of the bins would not matter if they were independent. The rate of a scene is not: the fewer edges are in
view, as with high thresholds, the more it comes and goes with each of them, and bins at some distance belong to other
edges. The nearest four bins are therefore compared by themselves as well: their mean and variance are those at a
shorter lag. Beside a lost packet both have the same mean, and the probability is nearly the same.

An event without company is the only one of its pixel while the neighbours are silent. Noise of a sensor fires at
random: everywhere, at any time, in pixels of any brightness. Of n blocks of 3 x 3 pixels without another event in an
interval of time, noise of r events a second leaves n exp(-r s) silent in the middle and n r s exp(-r s) with one event
there: their ratio is r s, whatever happens elsewhere. Edges leave lone events too, where they begin and end, but only
in the tiles that they cross. So the rate of the quieter tiles is that of the noise.

A spatiotemporal neighbour as what tells a signal from background activity: T. Delbruck, Frame-free dynamic digital
vision, Int. Symp. Secure-Life Electronics (2008), section 5.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.pixels import EVENT, FIRST, LAST, RUN, tally_events, tally_run_lengths

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

_RING: Final = 2
"""Largest distance of neighbours along each axis, px: a pixel has 24 neighbours."""

_MIDDLE, _THIRD = 12, 3
"""Ranks of the 24 neighbours, counted from the largest: the 12th (13th from the smallest), which serves as their
median, and the third."""

_FEWEST_PAIRS: Final = 20
"""Least number of pairs of runs for even ones: a hot pixel has them by chance with a probability of 0.72^20 = 0.1%."""

TILES = 8
"""Tiles a side of the image."""

_QUIET = 0.25
"""Quantile of the rates of tiles: three quarters of an image with noise have at least its rate."""

BINS: Final = 16
"""Number of bins on each side of a silence."""
# Least number of bins of a side that is used, and number of those that are also used by themselves.
_FEWEST_BINS: Final = 4
_LONGEST: Final = 32
"""Largest number of silences of a segment that are examined; they are the longest ones."""


@dataclass(frozen=True, slots=True)
class PixelCounts:
    """Numbers of events and runs of every pixel. They are integers, so that joining is exact.

    Attributes
    ----------
    packed
        (h, w) one number for each pixel, in the layout of ``tally_events``.
    run_pairs, squared_run_differences
        (h, w) number of pairs of successive runs of equal polarity that were added together, and the sum of the squared
        differences of their lengths.
    """

    packed: Int64
    run_pairs: Int64
    squared_run_differences: Int64

    @classmethod
    def of_nothing(cls, shape: tuple[int, int]) -> "PixelCounts":
        """Return the counts of a sensor of ``shape`` (rows, columns) without events."""
        return cls(np.zeros(shape, np.int64), np.zeros(shape, np.int64), np.zeros(shape, np.int64))

    @property
    def events(self) -> Int64:
        """Number of events (h, w) of both polarities."""
        return (self.packed & (RUN - 1)) // EVENT

    @property
    def runs(self) -> Int64:
        """Number of runs (h, w): successive events of one polarity. It is one more than the number of reversals."""
        return self.packed // RUN

    @property
    def first(self) -> Int64:
        """Polarity (h, w) of the first event, -1 where there is none."""
        return np.where(self.packed == 0, -1, self.packed & FIRST)

    @property
    def last(self) -> Int64:
        """Polarity (h, w) of the last event, -1 where there is none."""
        return np.where(self.packed == 0, -1, (self.packed & LAST) // LAST)

    @property
    def even(self) -> NDArray[np.bool_]:
        """Whether at most half of the successive runs of equal polarity differ (h, w), by one event."""
        return (self.run_pairs >= _FEWEST_PAIRS) & (2 * self.squared_run_differences <= self.run_pairs)

    def add(self, x: NDArray[np.uint16], y: NDArray[np.uint16], p: NDArray[np.uint8]) -> None:
        """Count the events that come next, in place; runs of separate calls are not compared with each other.

        Parameters
        ----------
        x, y
            (m,) columns and rows, px; all events lie on the sensor.
        p
            (m,) polarities in the order of time: 1 brighter, 0 darker.
        """
        tally_events(x, y, p, self.packed)
        tally_run_lengths(x, y, p, self.run_pairs, self.squared_run_differences)

    def then(self, later: "PixelCounts") -> "PixelCounts":
        """Join with the counts of later events; a run that continues over the border counts once."""
        goes_on = (self.last == later.first) & (self.packed > 0)
        # First polarity of the earlier part, last of the later one; a run that spans the border counts once.
        both = self.packed - (self.packed & LAST) + later.packed - (later.packed & FIRST) - goes_on * RUN
        return PixelCounts(
            np.where(self.packed == 0, later.packed, np.where(later.packed == 0, self.packed, both)),
            self.run_pairs + later.run_pairs,
            self.squared_run_differences + later.squared_run_differences,
        )


@dataclass(frozen=True, slots=True)
class NeighbourExcess:
    """Events of pixels compared with those of their 24 neighbours.

    Attributes
    ----------
    events
        (h, w) events less those of the neighbour with the third largest number, so that neighbouring hot pixels do not
        hide each other.
    swings
        (h, w) events by which a correct pixel can exceed its neighbours: one for each swing of the scene, and all of a
        pixel that follows the swings evenly.
    error
        (h, w) standard deviation of the excess: Poisson errors of the neighbour and of the swings, and the scatter of
        the neighbours.
    median
        (h, w) median number of events of the neighbours.
    """

    events: Float64
    swings: Float64
    error: Float64
    median: Float64

    @property
    def z(self) -> Float64:
        """Excess (h, w) over the neighbours and the swings, in standard deviations."""
        return (self.events - self.swings) / self.error


def neighbour_excess(counts: PixelCounts) -> NeighbourExcess:
    """Compare every pixel with its 24 neighbours.

    An image that moves over a pixel moves over its neighbours as well. Edges and textures cause differences between
    neighbours. Their size is the distance of the third largest neighbour from the median (1.1 standard deviations of a
    normal distribution).

    Where a scene swings to and fro, neighbours differ equally in every swing, and the differences do not average out.
    Let a swing change the signal by A thresholds, and let the signal be r thresholds beyond its reference where it
    turns, 0 <= r < 1: then floor(A - r) events follow. Of two pixels with the same A, one gives at most one event more
    in each swing than the other; if A is just above 1, one pixel fires in every swing and the other never. Therefore
    one event of each run of equal polarity is no excess, for as many runs as the scene has swings. The number of swings
    is the largest number of runs that a pixel and three of its neighbours have all reached. A single hot pixel does not
    increase this number, even if its polarity alternates; a hot pixel of one polarity has one run. Chance decides in
    which swings the signal passes the threshold once or twice, so that the number of these events varies at most by the
    Poisson error.

    Parameters
    ----------
    counts
        Events and runs of every pixel of the sensor, which has at least three rows and columns.

    Returns
    -------
    NeighbourExcess
        Arrays (h, w), in events.
    """
    events, runs = counts.events, counts.runs
    high, median = _ranked(events, _MIDDLE)
    borne_out = np.minimum(runs, _ranked(runs, _THIRD)[0])
    swings_of_scene = borne_out.max(initial=0.0)
    swings = np.where(
        counts.even & (runs <= swings_of_scene), np.maximum(events, runs), np.minimum(runs, swings_of_scene)
    ).astype(np.float64)
    # error^2 = high + (high - median)^2 + swings + 1: Poisson variances of the third largest and of the swings, the
    # scatter of the neighbours, and one event.
    error = np.sqrt(high + (high - median) ** 2 + swings + 1.0)
    return NeighbourExcess(events - high, swings, error, median)


def _ranked(counts: Int64, depth: int) -> tuple[Float64, Float64]:
    """Return the third and the ``depth``-th largest count (h, w) of the neighbours; borders mirror the image."""
    third, deepest = np.empty((2, *counts.shape), np.int32)
    rank_neighbours(np.pad(counts.astype(np.int32), _RING, mode="reflect"), third, deepest, depth)
    return third.astype(np.float64), deepest.astype(np.float64)


@njit(cache=True)
def rank_neighbours(around: Int32, third: Int32, deepest: Int32, depth: int) -> None:
    """Find the third largest and the ``depth``-th largest count of the 24 neighbours of every pixel.

    Parameters
    ----------
    around
        (h + 4, w + 4) counts, with two more pixels on each side.
    third, deepest
        (h, w) receive the third largest and the ``depth``-th largest count.
    depth
        Rank, counted from the largest; 3 at least.
    """
    # For a row of pixels at a time: each neighbour is inserted among the largest so far, which are in order.
    height, width = third.shape
    largest, passed_on = np.empty((depth, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        largest[:] = np.iinfo(np.int32).min
        for down in range(2 * _RING + 1):
            for right in range(2 * _RING + 1):
                if down == _RING and right == _RING:
                    continue
                for i in range(width):
                    passed_on[i] = around[row + down, right + i]
                for place in range(depth):
                    _pass_on(largest[place], passed_on)
        for i in range(width):
            third[row, i], deepest[row, i] = largest[2, i], largest[depth - 1, i]


@njit(cache=True)
def _pass_on(largest: Int32, passed_on: Int32) -> None:
    """Keep the larger of two rows (w,), element by element, and pass the smaller one on."""
    for column in range(len(largest)):
        kept, other = largest[column], passed_on[column]
        largest[column], passed_on[column] = max(kept, other), min(kept, other)


@dataclass(frozen=True, slots=True)
class EventSilence:
    """A segment of time without events.

    Attributes
    ----------
    start_ns, stop_ns
        Timestamps of the last event before the segment and of the first event after it, ns from the origin.
    length_ns
        Time that is certainly empty, ns: the distance of the timestamps less one tick.
    expected
        Number of events expected in this time by the rate of the bins beside it.
    z
        Deviate of a standard normal distribution with the same tail probability; 0 at least.
    """

    start_ns: int
    stop_ns: int
    length_ns: int
    expected: float
    z: float


def least_probable_silence(
    times_ns: Int64, start_ns: int, stop_ns: int, tick_ns: int, begins_ns: int | None = None
) -> tuple[EventSilence | None, int]:
    """Return the least probable silence that ends in [start, stop), and the number of silences that end there.

    Parameters
    ----------
    times_ns
        (n,) sorted timestamps of events, ns: all events between the ends, and events beyond both ends for the bins.
    start_ns, stop_ns
        Half-open interval in which the silences end, ns.
    tick_ns
        Step of the timestamps, ns.
    begins_ns
        Timestamp of the first event of the file, ns; None where it has no effect. At the beginning all pixels are at
        their references and fire little. A silence counts only where at least ``_FEWEST_BINS`` of its lengths lie
        between the first event and the silence.

    Returns
    -------
    silence
        None where no silence has enough bins beside it.
    count
        Number of distances between successive different timestamps.
    """
    longest_ns, ends_ns = np.zeros(_LONGEST, np.int64), np.zeros(_LONGEST, np.int64)
    first, stop = np.searchsorted(times_ns, [start_ns, stop_ns])
    count, silences = longest_silences(times_ns[max(first - 1, 0) : stop], start_ns, stop_ns, longest_ns, ends_ns)
    from_ns, upto_ns = start_ns, stop_ns
    if len(times_ns):
        # Events are complete between the ends, and beyond them as far as ``times_ns`` extends.
        from_ns, upto_ns = min(start_ns, int(times_ns[0])), max(stop_ns, int(times_ns[-1]))
    # An event lies within the tick before its timestamp: between timestamps one tick apart no time is certainly empty.
    informative = longest_ns[:count] > tick_ns
    if begins_ns is not None:
        informative &= ends_ns[:count] - longest_ns[:count] - _FEWEST_BINS * (longest_ns[:count] - tick_ns) >= begins_ns
    after_ns, before_ns = ends_ns[:count][informative], (ends_ns - longest_ns)[:count][informative]
    # Bins of the length of each silence, on its left and on its right, (2, k, bins).
    steps_ns = np.arange(BINS + 1) * (after_ns - before_ns - tick_ns)[:, np.newaxis]
    left_ns, right_ns = before_ns[:, np.newaxis] - steps_ns[:, ::-1], after_ns[:, np.newaxis] - tick_ns + steps_ns
    counts = np.diff(np.searchsorted(times_ns, np.stack([left_ns, right_ns]), side="right"))
    inside = np.stack([left_ns[:, :-1] >= from_ns, right_ns[:, 1:] <= upto_ns])
    enough = inside.sum(axis=2) >= _FEWEST_BINS
    # All bins of a side, and the nearest: the last on the left, the first on the right.
    nearest = np.zeros((2, 1, BINS), np.bool_)
    nearest[0, :, -_FEWEST_BINS:], nearest[1, :, :_FEWEST_BINS] = True, True
    means, log_chances = log_chance_of_empty_bin(
        np.concatenate([counts, counts]), np.concatenate([inside, inside & nearest])
    )
    log_chances = np.where(np.concatenate([enough, enough]), log_chances, -np.inf)
    # The bins by which the silence is most probable count; -inf where neither side has enough of them.
    likeliest, each = np.argmax(log_chances, axis=0), np.arange(len(before_ns))
    chance, expected = log_chances[likeliest, each], means[likeliest, each]
    z = np.where(np.isfinite(chance), np.maximum(-ndtri_exp(chance), 0.0), -np.inf)
    if not np.isfinite(z).any():
        return None, silences
    worst = int(np.argmax(z))
    start, stop = int(before_ns[worst]), int(after_ns[worst])
    return EventSilence(start, stop, stop - start - tick_ns, float(expected[worst]), float(z[worst])), silences


def log_chance_of_empty_bin(counts: NDArray[Any], inside: NDArray[np.bool_]) -> tuple[Float64, Float64]:
    """Return the mean of counts in bins, and the logarithm of the probability that one more bin is empty.

    Parameters
    ----------
    counts
        (..., bins) numbers of events.
    inside
        (..., bins) True for the bins that count.

    Returns
    -------
    means, log_chances
        (...) each; a mean of 0 makes an empty bin certain.
    """
    bins = inside.sum(axis=-1)
    means = (counts * inside).sum(axis=-1) / np.maximum(bins, 1)
    variances = ((counts - means[..., np.newaxis]) ** 2 * inside).sum(axis=-1) / np.maximum(bins - 1, 1)
    # The variance is at least that of Poisson, m: a smaller one by chance would give the rate a negative variance.
    positive = means > 0
    mean, variance = np.where(positive, means, 1.0), np.where(positive, np.maximum(variances, means), 1.0)
    # 1/r = (v - m + v / bins) / m^2: variance of the rate between bins, without that of Poisson, plus that of the mean.
    uncertainty = (variance - mean + variance / np.maximum(bins, 1)) / mean**2
    # log P(empty bin) = -r log(1 + m / r) (Greenwood and Yule 1920).
    log_chances = np.where(positive, -np.log1p(mean * uncertainty) / uncertainty, 0.0)
    return means, log_chances


@njit(cache=True)
def longest_silences(t: Int64, start: int, stop: int, lengths: Int64, ends: Int64) -> tuple[int, int]:
    """Find the longest distances between successive timestamps whose later timestamp lies in [start, stop).

    Parameters
    ----------
    t
        (n,) sorted timestamps, ns.
    start, stop
        Half-open interval, ns.
    lengths, ends
        (m,) receive the distances, longest first, and the later timestamps, ns. Of equal distances the earlier comes
        first.

    Returns
    -------
    tuple[int, int]
        Number of distances that were written, and number of all distances above 0.
    """
    count, silences = 0, 0
    for i in range(1, len(t)):
        length = t[i] - t[i - 1]
        if length <= 0 or t[i] < start or t[i] >= stop:
            continue
        silences += 1
        if count == len(lengths) and length <= lengths[count - 1]:
            continue
        count = min(count + 1, len(lengths))
        # Insertion sort: shorter distances move back by one place, and the shortest one is dropped.
        place = count - 1
        while place > 0 and lengths[place - 1] < length:
            lengths[place], ends[place] = lengths[place - 1], ends[place - 1]
            place -= 1
        lengths[place], ends[place] = length, t[i]
    return count, silences


@dataclass(frozen=True, slots=True)
class LoneEvents:
    """Pixels of all intervals with silent neighbours, by tile.

    Attributes
    ----------
    lone
        (TILES, TILES) with one event, of either polarity.
    silent
        (TILES, TILES) without an event.
    weighted_ns
        (TILES, TILES) sum of the intervals' lengths over the silent pixels, ns: whole numbers, so that sums do not
        depend on their order.
    """

    lone: Int64
    silent: Int64
    weighted_ns: Int64

    def __add__(self, other: "LoneEvents") -> "LoneEvents":
        """Add those of other intervals."""
        return LoneEvents(self.lone + other.lone, self.silent + other.silent, self.weighted_ns + other.weighted_ns)

    @property
    def quiet_rate_hz(self) -> float:
        """Rate of lone events of a pixel, 1/s, that three quarters of the tiles reach; a tile never silent has none."""
        rates_hz = np.divide(
            NS_PER_S * self.lone, self.weighted_ns, out=np.zeros((TILES, TILES)), where=self.weighted_ns > 0
        )
        return float(np.quantile(rates_hz, _QUIET))

    @property
    def mean_rate_hz(self) -> float:
        """Rate of lone events of a pixel in all tiles, 1/s; 0 where none was seen."""
        seconds = float(self.weighted_ns.sum()) / NS_PER_S
        return float(self.lone.sum()) / seconds if seconds else 0.0


def count_lone_events(counts: Int32, intervals_ns: Int64) -> LoneEvents:
    """Count pixels with one event and with none, of those whose neighbours have none.

    Parameters
    ----------
    counts
        (n, 2, h, w) darker and brighter events of n intervals.
    intervals_ns
        (n,) their lengths, ns.

    Returns
    -------
    LoneEvents
        By tile.
    """
    lone, silent = np.zeros((2, TILES, TILES), np.int64)
    weighted_ns = np.zeros((TILES, TILES), np.int64)
    for between, length_ns in zip(counts, intervals_ns, strict=True):
        of_interval = np.zeros((2, TILES, TILES), np.int64)
        _count(between, of_interval)
        lone += of_interval[0]
        silent += of_interval[1]
        # The ratio of lone to silent pixels is r s: sum(lone) estimates r sum(s silent).
        weighted_ns += length_ns * of_interval[1]
    return LoneEvents(lone, silent, weighted_ns)


@njit(cache=True)
def _count(between: Int32, totals: Int64) -> None:
    """Add the pixels with one event, and those with none, whose eight neighbours have none, by tile."""
    height, width = between.shape[1], between.shape[2]
    tiles_down, tiles_across = totals.shape[1], totals.shape[2]
    # Events of both polarities in the last three rows, and in three rows together.
    recent, together = np.zeros((3, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        line, off, on = recent[row % 3], between[0, row], between[1, row]
        for column in range(width):
            line[column] = off[column] + on[column]
        if row < 2:
            continue
        for column in range(width):
            together[column] = recent[0, column] + recent[1, column] + recent[2, column]
        middle, of_row = recent[(row - 1) % 3], totals[:, (row - 1) * tiles_down // height]
        for tile in range(tiles_across):
            # Columns c with c * tiles_across // width == tile, without those at the border.
            first = max(-(-tile * width // tiles_across), 1)
            stop = min(-(-(tile + 1) * width // tiles_across), width - 1)
            if first >= stop:
                continue
            own, left, here, right = (middle[first:stop], together[first - 1 : stop - 1], together[first:stop],
                                      together[first + 1 : stop + 1])  # fmt: skip
            lone, silent = np.int32(0), np.int32(0)
            for column in range(len(own)):
                of_block = left[column] + here[column] + right[column]
                silent += np.int32(of_block == 0)
                lone += np.int32((of_block == 1) & (own[column] == 1))
            of_row[0, tile] += lone
            of_row[1, tile] += silent
