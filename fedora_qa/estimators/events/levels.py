"""Levels of pixels from events: bracketed samples, and the change between two frames.

Between two events of one polarity, ``t1 <= t < t2``, the level has changed from the first reference by a fraction of
the threshold. The cubic through these two events, the event before and the event after them interpolates this fraction.
(A straight line is not enough: events are denser before a turning point than after it, so that its error does not
average out.) Between two samples a and b

    L(b) - L(a) = C+ dP - C- dM + delta d(C+ rate+ - C- rate-)

with dP and dM the brighter and darker events between them (with fractions), rate the events per second at the samples,
d the difference between b and a, and delta the delay of the timestamps: a level that is interpolated from late events
is the level at delta earlier. Regression on whole counts would be biased by their rounding; fractions have no such
bias.

At any other time the level is not known, and a sum of events ends with the last one. The level that this sum stands for
lags behind the true one, in the direction of the motion. The level at a frame follows from the last event before it and
the first event after it. Let f be the share of the time between both that has passed, U the threshold of the polarity
of the last event and D that of the next one.

- *Same polarity*: the level passes from 0 to D, and the straight line f D is its mean.
- *Other polarity*: the level first rises by o further (the excursion; "falls" where the last event was a darker one),
  and then returns by o + D. No event bounds o but 0 <= o < U. At constant speed the path has the length 2 o + D, and
  the level is min(p, 2 o - p), p = f (2 o + D).
  Levels are uniform relative to thresholds, so that o is uniform. The mean over o is::

      f (U + D) - f D r / U      where r = f D / (1 - 2 f) < U and f < 1/2
      U (1 - f) - f D            elsewhere

  With r the least o at which the level still rises. The line, -f D, leaves the excursion out (o = 0). The mean
  excursion lies between 0 and twice U / 2, so that the distance between both bounds what another distribution of o
  changes, to first order.

Where there are no events before a frame, or none after it, the reference stands for the level. It lags. To leave such
pixels out selects those that fire again soon, in which the motion leads to an error of the opposite sign.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import NormalBlocks, normal_blocks
from fedora_qa.estimators.fitting.huber_regression import huber_regression_weights

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

DISAGREEMENT_KNEE = 0.05
"""Difference of the two estimates of a level, as a share of the threshold, beyond which a pair loses weight.

A pair spans about five events, so that an error of this size is 1% of its change: the precision that a threshold needs.
A different knee would only exchange bias for scatter. Both are measured afterwards, on the weighted pairs."""

MOST_EVENTS = 400_000
"""Number of events beyond which only every second, third, ... pixel is used: there are enough pairs."""

MOST_PAIRS = 20_000
"""Number of pairs beyond which only every second, third, ... pair is used. Bounds on the errors of the frames then
limit the fit, and not chance."""

_PARAMETERS = 4
_FEWEST = 4
"""Least number of events of a pixel with a sample: the cubic needs four."""


@dataclass(frozen=True, slots=True)
class LevelPairs:
    """m pairs of successive level samples of a pixel.

    Attributes
    ----------
    pixels
        (m,) row * width + column.
    earlier, later
        (m,) frames of the two samples.
    regressors
        (m, 4): dP, -dM (counts), d rate+, -d rate- (1/s).
    gaps_s
        (m,) time between the two events that bracket a sample, s; the longer of both samples.
    straightened
        (m, 2) change of dP and -dM if straight lines between events replace cubics, counts.
    """

    pixels: NDArray[np.int32]
    earlier: NDArray[np.int32]
    later: NDArray[np.int32]
    regressors: Float64
    gaps_s: Float64
    straightened: Float64

    def __len__(self) -> int:
        return len(self.pixels)

    def with_straight_lines(self) -> "LevelPairs":
        """Return the pairs with straight lines between events instead of cubics."""
        regressors = self.regressors.copy()
        regressors[:, :2] += self.straightened
        return replace(self, regressors=regressors)

    def take(self, chosen: NDArray[np.bool_]) -> "LevelPairs":
        """Return the pairs where a mask (m,) is True."""
        return LevelPairs(*(getattr(self, name)[chosen] for name in LevelPairs.__slots__))

    def tightest(self, wanted: int) -> "LevelPairs":
        """Return the pairs of the shortest gaps, ``wanted`` of them or more.

        The largest gap is a power of 2 s. During a gap only the thresholds bound the light of a pixel: the shorter the
        gap, the smaller the error of the level.
        """
        if len(self) <= wanted:
            return self
        needed = float(np.partition(self.gaps_s, wanted - 1)[wanted - 1])
        return self.take(self.gaps_s <= 2.0 ** np.ceil(np.log2(needed)))

    def ends_of(self, images: NDArray[np.floating]) -> Float64:
        """Return the values of ``images`` (n, h, w) at the earlier and at the later samples, (2, m)."""
        flat = images.reshape(len(images), -1)
        return np.array([flat[self.earlier, self.pixels], flat[self.later, self.pixels]], dtype=np.float64)


class LevelImages(NamedTuple):
    """Light of the pixels of the event camera at frame times, and which of them have a level.

    Attributes
    ----------
    light, other_light
        (n, h, w) light by two reconstructions, DN. A pixel has a level where neither is below ``least``.
    error
        (n, h, w) bound on the error of the light, DN; infinite where the light is not known.
    least
        Light below which the level of a pixel is not known, DN.
    hidden
        (k,) pixels without a level at all times, row * width + column, sorted.
    """

    light: NDArray[np.float32]
    other_light: NDArray[np.float32]
    error: NDArray[np.float32]
    least: float
    hidden: NDArray[np.int64]


class SampleRules(NamedTuple):
    """Rules for the events that bracket a sample.

    Attributes
    ----------
    every
        One pixel in ``every`` is used.
    longest_gap_ns
        Longest time between the two events that bracket a sample, ns.
    least_gap_ns
        Events of a pixel that are closer, ns, break its chain of samples.
    off_over_on
        Declared ratio C- / C+.
    """

    every: int
    longest_gap_ns: int
    least_gap_ns: int
    off_over_on: float


def level_pairs(
    events: PixelEvents,
    frame_times_ns: NDArray[np.int64],
    images: LevelImages,
    *,
    longest_gap_ns: int,
    least_gap_ns: int = 1,
    off_over_on: float = 1.0,
) -> LevelPairs:
    """Find the pairs of successive level samples at frame times.

    Parameters
    ----------
    events
        Events by pixel of the event camera.
    frame_times_ns
        (n,) strictly increasing timestamps of the images, ns.
    images
        Light, its errors and hidden pixels: they determine at which pixels and frames there can be samples.
    longest_gap_ns
        Longest time between the two events that bracket a sample, ns.
    least_gap_ns
        Events of a pixel that are closer, ns, break its chain of samples.
    off_over_on
        Declared ratio C- / C+. It has an effect only on the curvature of the cubic.

    Returns
    -------
    LevelPairs
        Only a part of the pairs where there are more than ``MOST_EVENTS`` events or ``MOST_PAIRS`` pairs.
    """
    coordinates, regressors = np.empty((len(events), 3), np.int32), np.empty((len(events), _PARAMETERS + 3))
    every = max(1, -(-len(events) // MOST_EVENTS))
    rules = SampleRules(every, longest_gap_ns, max(least_gap_ns, 1), off_over_on)
    count = sample_levels(events.starts, events.timestamped, frame_times_ns, images, rules, coordinates, regressors)
    rows = slice(0, count, max(1, -(-count // MOST_PAIRS)))
    pixels, earlier, later = coordinates[rows].T.copy()
    own, gaps_s, straightened = regressors[rows, :4], regressors[rows, 4], regressors[rows, 5:]
    return LevelPairs(pixels, earlier, later, own.copy(), gaps_s.copy(), straightened.copy())


def precision_weights(pairs: LevelPairs, levels: Float64, other_levels: Float64, threshold: float) -> Float64:
    """Return the weights of pairs by the difference of two estimates of their levels.

    There are two estimates by frames (two reconstructions), and two by events (cubics and straight lines). With d the
    difference in thresholds over ``DISAGREEMENT_KNEE``, the weight is 1 / (1 + d^2)^2 (Geman and McClure 1985). Errors
    of footprints at edges are not noise; they reduce contrast. With the inverse variance 1 / (1 + d^2) as weight,
    errors of d = 4 would change the result half as much as errors of d = 1; with its square, an eighteenth as much. The
    residual has no effect on the weight, so that no threshold is preferred.

    Parameters
    ----------
    pairs
        (m,) level pairs.
    levels, other_levels
        (2, m) levels at both samples by two reconstructions of the frames, in the unit of the threshold.
    threshold
        Mean of the declared thresholds.

    Returns
    -------
    Float64
        (m,), 0 to 1.
    """
    difference = levels - other_levels
    of_frames = np.hypot(difference[0], difference[1]) / threshold
    of_events = np.abs(pairs.straightened).sum(axis=1)
    # w = 1 / (1 + d^2)^2, d^2 = (frames^2 + events^2) / knee^2 (Geman and McClure 1985).
    weights: Float64 = (1.0 + (of_frames**2 + of_events**2) / DISAGREEMENT_KNEE**2) ** -2.0
    return weights


def accumulate(
    pairs: LevelPairs,
    change: Float64,
    block_of_pair: NDArray[np.intp],
    blocks: int,
    times_s: Float64,
    weights: Float64 | None = None,
) -> NormalBlocks:
    """Return robust normal equations of the changes of levels on the regressors of pairs, summed by block.

    Parameters
    ----------
    pairs
        (m,) level pairs.
    change, block_of_pair, times_s
        (m,) change of the level from the earlier to the later sample, number of the block (0 to b - 1), and time, s.
    blocks
        Number b of blocks.
    weights
        (m,) weights of the pairs; 1 where None. They are multiplied by Huber's weights of a fit to these pairs.

    Returns
    -------
    NormalBlocks
        b blocks of four parameters, one for each column of ``LevelPairs.regressors``.
    """
    if weights is None:
        weights = np.ones(len(pairs))
    # Rows times the root of their weight have one variance, as Huber's estimate assumes.
    root = np.sqrt(weights)
    robust = weights * huber_regression_weights(pairs.regressors * root[:, np.newaxis], change * root)
    return normal_blocks(pairs.regressors, change, robust, block_of_pair, blocks, times_s)


@njit(cache=True)
def sample_levels(
    starts: Int32,
    timestamped: Int64,
    frame_times: Int64,
    images: LevelImages,
    rules: SampleRules,
    coordinates: Int32,
    regressors: Float64,
) -> int:
    """Write a row for each two successive level samples of a pixel.

    A sample is a frame time t1 <= t < t2 between two events of one polarity that are at most the longest gap apart. Its
    pixel is not darker than the least light in either of two images, and the error of its light is finite. The
    distances to the event before and to the event after the two are a third to three times their gap, because a cubic
    through less evenly spaced events oscillates. Hidden pixels have no samples. Events closer than the least gap break
    the chain of a pixel, because events between them can be missing.

    Parameters
    ----------
    starts, timestamped
        (h * w + 1,) and (e,) events by pixel, as in ``PixelEvents``.
    frame_times
        (n,) strictly increasing timestamps of the images, ns.
    images
        (n, h, w) light, and the hidden pixels.
    rules
        Rules for the events that bracket a sample. The ratio of the thresholds has an effect in first order only.
    coordinates
        (m, 3) receives pixel, earlier and later frame.
    regressors
        (m, 7) receives dP and -dM (counts, with fractions), d rate+ and -d rate- (1/s), the longer of the two gaps (s),
        and the change of dP and -dM by straight lines.

    Returns
    -------
    int
        Number of rows written.
    """
    _, height, width = images.light.shape
    rows, concealed = 0, 0
    for row in range(height):
        for column in range(width):
            pixel = row * width + column
            begin, stop = starts[pixel], starts[pixel + 1]
            if stop - begin < _FEWEST or (rules.every > 1 and (column + 3 * row) % rules.every != 0):
                continue
            # Pixels and hidden pixels are both in ascending order: one pass over the hidden pixels is enough.
            while concealed < len(images.hidden) and images.hidden[concealed] <= pixel:
                concealed += 1
            if concealed > 0 and images.hidden[concealed - 1] == pixel:
                continue
            frame, chained, sampled = 0, False, 0
            on = (timestamped[begin] & 1) + (timestamped[begin + 1] & 1) + (timestamped[begin + 2] & 1)
            level_on, level_off, slope, gap_s, line_on, line_off = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(begin + 3, stop):
                first, second = timestamped[i - 2], timestamped[i - 1]
                brighter = second & 1
                t1, t2, t3 = first >> 1, second >> 1, timestamped[i] >> 1
                on_before, off_before, on = on, i - begin - on, on + (timestamped[i] & 1)
                if t3 - t2 < rules.least_gap_ns:
                    chained = False
                    continue
                gap = t2 - t1
                if first & 1 != brighter or gap <= 0 or gap > rules.longest_gap_ns:
                    continue
                t0 = timestamped[i - 3] >> 1
                # gap / 3 <= t1 - t0, t3 - t2 <= 3 gap, in whole nanoseconds.
                if not (gap <= 3 * (t1 - t0) <= 9 * gap and gap <= 3 * (t3 - t2) <= 9 * gap):
                    continue
                while frame < len(frame_times) and frame_times[frame] < t2:
                    frame += 1
                if frame == 0 or frame_times[frame - 1] < t1:
                    continue
                light, other_light = images.light[frame - 1, row, column], images.other_light[frame - 1, row, column]
                bright = light >= images.least and other_light >= images.least
                if not (bright and images.error[frame - 1, row, column] < np.inf):
                    continue
                ratio = rules.off_over_on
                # In thresholds of this polarity: an event of the other sign changes the level by -C-/C+, or -C+/C-.
                step = 1.0 if timestamped[i] & 1 == brighter else -(ratio if brighter else 1.0 / ratio)
                # Seconds since the first frame have the precision that cubics need.
                since = frame_times[0]
                fraction, rate = _cubic_between(
                    (t0 - since) * 1e-9,
                    (t1 - since) * 1e-9,
                    (t2 - since) * 1e-9,
                    (t3 - since) * 1e-9,
                    step,
                    (frame_times[frame - 1] - since) * 1e-9,
                )
                # The event at t2 is counted; the sample lies before it.
                now_on = on_before + (fraction - 1.0 if brighter else 0.0)
                now_off = off_before + (0.0 if brighter else fraction - 1.0)
                now_slope, now_gap_s = (rate if brighter else -rate), gap * 1e-9
                straight = (frame_times[frame - 1] - t1) / gap - fraction
                now_line_on, now_line_off = (straight, 0.0) if brighter else (0.0, straight)
                if chained:
                    coordinates[rows, 0], coordinates[rows, 1], coordinates[rows, 2] = pixel, sampled, frame - 1
                    regressors[rows, 0], regressors[rows, 1] = now_on - level_on, level_off - now_off
                    # Each sample has the rate of one polarity: d rate+ in this column, -d rate- in the next.
                    regressors[rows, 2] = max(now_slope, 0.0) - max(slope, 0.0)
                    regressors[rows, 3] = min(now_slope, 0.0) - min(slope, 0.0)
                    regressors[rows, 4] = max(now_gap_s, gap_s)
                    regressors[rows, 5], regressors[rows, 6] = now_line_on - line_on, line_off - now_line_off
                    rows += 1
                chained, sampled, gap_s, slope = True, frame - 1, now_gap_s, now_slope
                level_on, level_off, line_on, line_off = now_on, now_off, now_line_on, now_line_off
    return rows


@njit(cache=True)
def _cubic_between(t0: float, t1: float, t2: float, t3: float, step: float, t: float) -> tuple[float, float]:
    """Return the level at t, and its rate, of the cubic through (t0, -1), (t1, 0), (t2, 1), (t3, 1 + step).

    The level at t0 is one event lower than at t1 for both polarities of the event at t0.
    """
    first, second, third = 1.0 / (t1 - t0), 1.0 / (t2 - t1), step / (t3 - t2)
    earlier, later = (second - first) / (t2 - t0), (third - second) / (t3 - t1)
    bend = (later - earlier) / (t3 - t0)
    # Newton's divided differences: L(t) = L[t1, t2] a + L[t0, t1, t2] a b + L[t0, t1, t2, t3] a b c; the rate is L'(t).
    a, b, c = t - t1, t - t2, t - t0
    level = a * second + a * b * (earlier + bend * c)
    rate = second + (a + b) * earlier + (a * b + (a + b) * c) * bend
    return level, rate


@njit(cache=True)
def mark_usable(edge_aware_dn: Float32, uniform_dn: Float32, error_dn: Float32, least_dn: float, usable: Bool) -> None:
    """Mark the pixels that have a level: not darker than ``least_dn`` in either image, with a finite error.

    Parameters
    ----------
    edge_aware_dn, uniform_dn
        (h, w) light by both reconstructions, DN.
    error_dn
        (h, w) bound on the error of the light, DN; infinite where the light is not known.
    least_dn
        Light below which the level is not known because of rounding, DN.
    usable
        (h, w) receives True for pixels that have a level.
    """
    for row in range(usable.shape[0]):
        for column in range(usable.shape[1]):
            darker = min(edge_aware_dn[row, column], uniform_dn[row, column])
            usable[row, column] = (darker >= least_dn) & (error_dn[row, column] < np.inf)


@dataclass(frozen=True, slots=True)
class LevelChanges:
    """Changes of the level between two frames.

    Attributes
    ----------
    mean
        (h, w) mean change over the excursions of the level between events, in the unit of the thresholds.
    line
        (h, w) change without excursions.
    is_known
        (h, w) True where there are events before and after both frames; elsewhere the reference stands for the level at
        one of them, or at both.
    """

    mean: Float64
    line: Float64
    is_known: Bool


def level_changes(
    events: PixelEvents, shape: tuple[int, int], frame_times_ns: tuple[int, int], thresholds: tuple[float, float]
) -> LevelChanges:
    """Return the changes of the level between two frames.

    Parameters
    ----------
    events
        Events by pixel, also some before the first frame and some after the second one.
    shape
        Rows and columns of the sensor.
    frame_times_ns
        Times of the earlier and of the later frame, ns.
    thresholds
        Change of the level by a darker and by a brighter event, both positive.

    Returns
    -------
    LevelChanges
        In the unit of the thresholds.
    """
    mean, line = np.zeros(shape[0] * shape[1]), np.zeros(shape[0] * shape[1])
    is_known = np.zeros(len(mean), np.bool_)
    write_level_changes(events.starts, events.timestamped, frame_times_ns, thresholds, mean, line, is_known)
    return LevelChanges(mean.reshape(shape), line.reshape(shape), is_known.reshape(shape))


@njit(cache=True)
def mean_level(share: float, turned: bool, last: float, following: float) -> float:
    """Return the mean level between two events, relative to that at the first of them.

    Parameters
    ----------
    share
        Share of the time between both events that has passed, 0 to 1.
    turned
        Whether their polarities differ.
    last, following
        Thresholds of the polarities of the first and of the second event, both positive.

    Returns
    -------
    float
        Positive in the direction of the first event.
    """
    if not turned:
        return share * following
    # r = f D / (1 - 2 f), the least excursion at which the level still rises.
    if share < 0.5 and share * following < last * (1 - 2 * share):
        least = share * following / (1 - 2 * share)
        return share * (last + following) - share * following * least / last
    return last * (1 - share) - share * following


@njit(cache=True)
def write_level_changes(
    starts: Int32,
    timestamped: Int64,
    frame_times: tuple[int, int],
    thresholds: tuple[float, float],
    mean: Float64,
    line: Float64,
    is_known: Bool,
) -> None:
    """Write the fields of ``LevelChanges`` for h * w pixels.

    Parameters
    ----------
    starts, timestamped
        (h * w + 1,) and (m,) events by pixel, as in ``PixelEvents``.
    frame_times
        Times of the earlier and of the later frame, ns.
    thresholds
        Change of the level by a darker and by a brighter event, both positive.
    mean, line, is_known
        (h * w,) receive the changes and where they are known.
    """
    for pixel in range(len(mean)):
        begin, stop = np.int64(starts[pixel]), np.int64(starts[pixel + 1])
        # The first event after each frame; 2 t + p > 2 frame + 1 exactly if t > frame, for both polarities.
        after = begin
        while after < stop and timestamped[after] <= 2 * frame_times[0] + 1:
            after += 1
        after_later, level = after, 0.0
        while after_later < stop and timestamped[after_later] <= 2 * frame_times[1] + 1:
            level += thresholds[1] if timestamped[after_later] & 1 else -thresholds[0]
            after_later += 1
        mean_change, line_change = level, level
        for i, frame, sign in ((after, frame_times[0], -1.0), (after_later, frame_times[1], 1.0)):
            if not begin < i < stop:
                continue
            last, following = timestamped[i - 1], timestamped[i]
            share = (frame - (last >> 1)) / ((following >> 1) - (last >> 1))
            turned = (last & 1) != (following & 1)
            direction = 1.0 if last & 1 else -1.0
            threshold = thresholds[following & 1]
            mean_change += sign * direction * mean_level(share, turned, thresholds[last & 1], threshold)
            line_change += sign * direction * share * (-threshold if turned else threshold)
        mean[pixel], line[pixel] = mean_change, line_change
        is_known[pixel] = after != begin and after_later != stop
