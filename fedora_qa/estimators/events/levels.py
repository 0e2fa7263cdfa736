"""Bracketed level samples: where events determine exactly how far a pixel has moved.

Between two events of one polarity, ``t1 <= t < t2``, the level has moved from the first reference by a fraction of the
threshold, which the cubic through these and one event on either side interpolates. (A straight line is not enough:
events are denser before a turning point than after it, so that its error does not average out.) Between two samples

    L(b) - L(a) = C+ dP - C- dM + delta d(C+ rate+ - C- rate-)

with dP and dM the brighter and darker events between them (fractions included), rate the events per second at the
samples, and delta the delay of the timestamps: a level interpolated from late events is that of delta before. Naive
regression on whole counts is biased by their rounding; here it is gone.
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
"""Pairs whose two estimates of a level differ by more than this share of the threshold lose weight.

A pair spans some five events, so that an error of this size is 1% of its change: the precision wanted of a threshold.
Where the knee lies trades bias for scatter only. Both are measured after it, on the pairs as they are weighed."""

MOST_EVENTS = 400_000
"""Beyond so many events, every second, third, ... pixel is followed: where pixels fire that often, pairs abound."""

MOST_PAIRS = 20_000
"""Beyond so many pairs, every second, third, ... is taken: then bounds of the frames limit the fit, not chance."""

_PARAMETERS = 4
_FEWEST = 4
"""Events of a pixel below which it has no sample: the cubic needs four."""


@dataclass(frozen=True, slots=True)
class LevelPairs:
    """Successive level samples of pixels.

    Attributes
    ----------
    pixels
        (m,) row * width + column.
    earlier, later
        (m,) frames of the two samples.
    regressors
        (m, 4): dP, -dM (counts), d rate+, -d rate- (1/s).
    gaps_s
        (m,) time between the two events of a sample, the longer of both.
    straightened
        (m, 2): what straight lines between events, instead of cubics, would add to dP and -dM.
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
        """Return the pairs as straight lines between events would have them."""
        regressors = self.regressors.copy()
        regressors[:, :2] += self.straightened
        return replace(self, regressors=regressors)

    def take(self, chosen: NDArray[np.bool_]) -> "LevelPairs":
        """Return the pairs of a mask."""
        return LevelPairs(*(getattr(self, name)[chosen] for name in LevelPairs.__slots__))

    def tightest(self, wanted: int) -> "LevelPairs":
        """Return about ``wanted`` pairs or more, those of the shortest gaps, cut on a geometric ladder.

        The light of a pixel during its gap is only bounded by the thresholds; the shorter the gap, the less the level
        can err.
        """
        if len(self) <= wanted:
            return self
        needed = float(np.partition(self.gaps_s, wanted - 1)[wanted - 1])
        return self.take(self.gaps_s <= 2.0 ** np.ceil(np.log2(needed)))

    def ends_of(self, images: NDArray[np.floating]) -> Float64:
        """Return what ``images`` (n, h, w) hold at the earlier and at the later sample, (2, m)."""
        flat = images.reshape(len(images), -1)
        return np.array([flat[self.earlier, self.pixels], flat[self.later, self.pixels]], dtype=np.float64)


class LevelImages(NamedTuple):
    """Light of the event camera's pixels at frame times, and which of them have a level.

    Attributes
    ----------
    light, other_light
        (n, h, w) by two reconstructions, in single precision: neither may be below ``least``.
    error
        (n, h, w), infinite where the light is not known.
    least
        Light below which a pixel's level is not known.
    hidden
        (m,) pixels without a level, row * width + column, sorted.
    """

    light: NDArray[np.float32]
    other_light: NDArray[np.float32]
    error: NDArray[np.float32]
    least: float
    hidden: NDArray[np.int64]


class SampleRules(NamedTuple):
    """Which events bracket a sample: one pixel in ``every``, gaps in ns, and the ratio of the thresholds."""

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
    """Find the level samples at frame times.

    Parameters
    ----------
    events
        By pixel of the event camera.
    frame_times_ns
        (n,) of the images, advancing.
    images
        What decides at which pixels and frames there are samples.
    longest_gap_ns
        Between the two events that bracket a sample.
    least_gap_ns
        Events of a pixel closer than this break its chain.
    off_over_on
        The declared ratio of the thresholds; it only bends the cubic.

    Returns
    -------
    LevelPairs
        Of successive samples of a pixel; a share of them where events or pairs abound.
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
    """Return weights of pairs by how far two estimates of their levels lie apart.

    Cubics and straight lines are the two estimates by events. With d the distance in thresholds over
    ``DISAGREEMENT_KNEE`` the weight is 1 / (1 + d^2)^2 (Geman and McClure 1985). Errors of footprints at edges are no
    noise but take contrast away; under the inverse variance 1 / (1 + d^2) those of d = 4 would still pull half as much
    as those of d = 1. Squared, it is an eighteenth. The residual has no part in it, so that no threshold is favoured.

    Parameters
    ----------
    pairs
        (m,) level pairs.
    levels, other_levels
        (2, m) at both ends by two reconstructions of the frames, in the unit of the threshold.
    threshold
        The mean of the declared ones.

    Returns
    -------
    Float64
        (m,), 0 to 1.
    """
    difference = levels - other_levels
    of_frames = np.hypot(difference[0], difference[1]) / threshold
    of_events = np.abs(pairs.straightened).sum(axis=1)
    # 1 / (1 + d^2)^2, with d^2 the sum of both squared distances over the squared knee (Geman and McClure 1985).
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
    """Return robust normal equations of ``change`` on the pairs' regressors, summed by block.

    Parameters
    ----------
    pairs
        (m,) level pairs.
    change, block_of_pair, times_s
        (m,) of the pairs: change of the level from the earlier to the later sample, number of the block, time.
    blocks
        Number of blocks, b.
    weights
        (m,) of the pairs, 1 if not given. They are multiplied by Huber's about a fit of the pairs alone, its scale from
        the median absolute residual.

    Returns
    -------
    NormalBlocks
        (b, 4, 4) and (b, 4), of the columns of ``LevelPairs.regressors``.
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
    """Write a row for each two successive level samples of a pixel; return how many.

    A sample is a frame time t1 <= t < t2 between two events of one polarity at most the longest gap apart. Its pixel is
    not darker than the least light in either of two images, and the error of its light is finite. One event lies before
    and one after the two, at a third to three times their gap: a cubic through less evenly spaced events oscillates.
    Hidden pixels have no samples. Events closer than the least gap break the chain of a pixel: between them events may
    be lost.

    Parameters
    ----------
    starts, timestamped
        (h * w + 1,) and (e,): events by pixel, as in ``pixels.py``.
    frame_times
        (n,) of the images, advancing, ns.
    images
        (n, h, w) light, and the hidden pixels.
    rules
        Which events bracket a sample. The ratio of the thresholds acts in first order only.
    coordinates
        (m, 3) receives pixel, earlier and later frame.
    regressors
        (m, 7) receives the brighter and darker events between the samples, fractions included (darker ones count
        negative), the change of both rates, 1/s, the longer of the two gaps, s, and what straight lines would add to
        the first two.

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
            # Both lists ascend, so that one pass over the hidden pixels serves all rows.
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
                # In thresholds of this pair: an event of the other sign moves the level back by C-/C+, or C+/C-.
                step = 1.0 if timestamped[i] & 1 == brighter else -(ratio if brighter else 1.0 / ratio)
                # Seconds since the first frame keep the digits that cubics need.
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

    Newton's divided differences. The level before t1 is one event lower whatever the event at t0 was.
    """
    first, second, third = 1.0 / (t1 - t0), 1.0 / (t2 - t1), step / (t3 - t2)
    earlier, later = (second - first) / (t2 - t0), (third - second) / (t3 - t1)
    bend = (later - earlier) / (t3 - t0)
    # L(t) = L[t1, t2] a + L[t0, t1, t2] a b + L[t0, t1, t2, t3] a b c; the rate is its derivative by t.
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
        (h, w) bound of its error, DN; infinite where it is not known.
    least_dn
        Light below which rounding leaves the level open, DN.
    usable
        (h, w) where the result is written.
    """
    for row in range(usable.shape[0]):
        for column in range(usable.shape[1]):
            darker = min(edge_aware_dn[row, column], uniform_dn[row, column])
            usable[row, column] = (darker >= least_dn) & (error_dn[row, column] < np.inf)
