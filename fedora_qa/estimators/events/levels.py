"""Bracketed level samples: where events say exactly how far a pixel has moved.

Between two events of one polarity, ``t1 <= t < t2``, the level has moved from the first reference by a share of the
threshold, which the cubic through these and one event on either side tells. (A straight line will not do: events are
denser before a turning point than after it, so that its error does not average out.) Between two such samples

    L(b) - L(a) = C+ dP - C- dM + delta d(C+ rate+ - C- rate-)

with dP and dM the brighter and darker events between them (fractions included), rate the events per second at the
samples, and delta the time by which events are stamped late: a level read from late events is that of delta before.
Naive regression on whole counts is biased by their rounding; here it is gone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.level_kernels import huber, residuals, sample_levels, solve, sum_blocks, weigh
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA

Float64 = NDArray[np.float64]

HUBER_K = 1.345
"""Residuals beyond this many standard deviations weigh less: 95% efficient on normal errors (Huber 1964)."""

SURE_WITHIN = 0.05
"""Two readings of a level that lie farther apart than this share of the threshold lose weight.

A pair spans some five events, so that an error of this size is 1% of its change: what a threshold shall be known to.
Where the knee lies trades bias for scatter only. Both are measured after it, on the pairs as they are weighed."""

MOST_EVENTS = 400_000
"""Beyond so many events, every second, third, ... pixel is followed: where pixels fire that often, pairs abound."""

MOST_PAIRS = 20_000
"""Beyond so many pairs, every second, third, ... is taken: then bounds of the frames limit the fit, not chance."""

_ITERATIONS = 8
_PARAMETERS = 4
_FEW_ROWS = 4096
"""Beyond so many rows NumPy parts them at their median faster than a compiled loop does."""


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

        What a pixel sees during its gap is only bounded by the thresholds; the shorter it is, the surer the level.
        """
        if len(self) <= wanted:
            return self
        needed = float(np.partition(self.gaps_s, wanted - 1)[wanted - 1])
        return self.take(self.gaps_s <= 2.0 ** np.ceil(np.log2(needed)))

    def ends_of(self, images: NDArray[np.floating]) -> Float64:
        """Return what ``images`` (n, h, w) hold at the earlier and at the later sample, (2, m)."""
        flat = images.reshape(len(images), -1)
        return np.array([flat[self.earlier, self.pixels], flat[self.later, self.pixels]], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Shown:
    """What frames show, and of which pixels it tells a level.

    Attributes
    ----------
    light, other_light
        (n, h, w) by two reconstructions, in single precision: neither may be below ``least``.
    error
        (n, h, w), infinite where nothing is known.
    hidden
        (m,) pixels that tell nothing, row * width + column, sorted.
    """

    light: NDArray[np.float32]
    other_light: NDArray[np.float32]
    error: NDArray[np.float32]
    least: float
    hidden: NDArray[np.int64]


def level_pairs(
    events: PixelEvents,
    frame_times_ns: NDArray[np.int64],
    shown: Shown,
    *,
    longest_gap_ns: int,
    least_gap_ns: int = 1,
    off_over_on: float = 1.0,
) -> LevelPairs:
    """Find the level samples at frame times, at pixels that tell them.

    Events of a pixel closer than ``least_gap_ns`` break its chain. ``off_over_on`` is the declared ratio of the
    thresholds; it only bends the cubic.
    """
    places, regressors = np.empty((len(events), 3), np.int32), np.empty((len(events), _PARAMETERS + 3))
    count = sample_levels(
        events.starts,
        events.timestamped,
        frame_times_ns,
        shown.light,
        shown.other_light,
        shown.error,
        shown.least,
        shown.hidden,
        max(1, -(-len(events) // MOST_EVENTS)),
        longest_gap_ns,
        max(least_gap_ns, 1),
        off_over_on,
        places,
        regressors,
    )
    taken = slice(0, count, max(1, -(-count // MOST_PAIRS)))
    pixels, earlier, later = places[taken].T.copy()
    own, gaps_s, straightened = regressors[taken, :4], regressors[taken, 4], regressors[taken, 5:]
    return LevelPairs(pixels, earlier, later, own.copy(), gaps_s.copy(), straightened.copy())


@dataclass(frozen=True, slots=True)
class NormalBlocks:
    """Weighted normal equations of blocks of samples; sums over blocks are the equations of all.

    Attributes
    ----------
    matrices, vectors
        (b, k, k) and (b, k): X'WX and X'Wy of k parameters, four of level pairs and of readings.
    squares, weights, counts
        (b,): y'Wy, the sum of weights, and the number of samples.
    times_s
        (b,) mean time of the samples.
    """

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64
    counts: Float64
    times_s: Float64

    def __len__(self) -> int:
        return len(self.counts)


def sureness(pairs: LevelPairs, levels: Float64, otherwise: Float64, threshold: float) -> Float64:
    """Return weights (m,), 0 to 1, of pairs by how far two readings of what they hold lie apart.

    ``levels`` and ``otherwise`` (2, m) are the levels at both ends by two reconstructions of the frames, in the unit of
    ``threshold``; cubics and straight lines are the two readings of the events. With d the distance in thresholds over
    ``SURE_WITHIN`` the weight is 1 / (1 + d^2)^2 (Geman and McClure 1985). Errors of footprints at edges are no noise
    but take contrast away; under the inverse variance 1 / (1 + d^2) those of d = 4 would still pull half as much as
    those of d = 1. Squared, it is an eighteenth. The residual has no part in it, so that no threshold is favoured.
    """
    between = levels - otherwise
    of_frames = np.hypot(between[0], between[1]) / threshold
    of_events = np.abs(pairs.straightened).sum(axis=1)
    weights: Float64 = (1.0 + (of_frames**2 + of_events**2) / SURE_WITHIN**2) ** -2.0
    return weights


def accumulate(
    pairs: LevelPairs,
    change: Float64,
    block_of_pair: NDArray[np.intp],
    blocks: int,
    times_s: Float64,
    sure: Float64 | None = None,
) -> NormalBlocks:
    """Return robust normal equations of ``change`` (m,) on the pairs' regressors, summed by block.

    ``times_s`` (m,) are the times of the pairs, ``sure`` (m,) their weights (1 if not given). These are multiplied by
    Huber's about a fit of the pairs alone, its scale from the median absolute residual.
    """
    if sure is None:
        sure = np.ones(len(pairs))
    root = np.sqrt(sure)
    weights = sure * huber_weights(pairs.regressors * root[:, np.newaxis], change * root)
    return normal_blocks(pairs.regressors, change, weights, block_of_pair, blocks, times_s)


def normal_blocks(
    X: Float64, y: Float64, weights: Float64, block_of_row: NDArray[np.intp], blocks: int, times_s: Float64
) -> NormalBlocks:
    """Return the weighted normal equations of y (m,) on X (m, k), summed by block."""
    matrices, vectors = np.zeros((blocks, X.shape[1], X.shape[1])), np.zeros((blocks, X.shape[1]))
    sums = np.zeros((blocks, 4))
    sum_blocks(X, y, weights, block_of_row.astype(np.int64), times_s, matrices, vectors, sums)
    squares, total, counts, times = sums.T.copy()
    return NormalBlocks(matrices, vectors, squares, total, counts, times / np.maximum(counts, 1.0))


def huber_weights(X: Float64, y: Float64) -> Float64:
    """Return the weights (m,) of Huber's M-estimate of y = X theta, by iterated least squares."""
    weights, residual = np.ones(len(y)), np.empty(len(y))
    if not len(y) or (len(y) <= _FEW_ROWS and huber(X, y, HUBER_K, _ITERATIONS, weights)):
        return weights
    weights[:], middle = 1.0, len(y) // 2
    matrix, vector = np.empty((X.shape[1], X.shape[1])), np.empty(X.shape[1])
    weigh(X, y, weights, matrix, vector)
    for iteration in range(_ITERATIONS):
        residuals(X, y, _solved(matrix, vector), residual)
        # NumPy's median parts at both middle values, which takes eight times as long.
        parted = np.partition(residual, middle)
        below = parted[middle] if len(y) % 2 else parted[:middle].max()
        scale = MAD_TO_SIGMA * 0.5 * float(below + parted[middle])
        if scale == 0.0:
            break
        np.minimum(1.0, HUBER_K * scale / np.maximum(residual, 1e-300), out=weights)
        if iteration + 1 < _ITERATIONS:
            weigh(X, y, weights, matrix, vector)
    return weights


def _solved(matrix: Float64, vector: Float64) -> Float64:
    """Return the solution (k,) of normal equations; the shortest of many."""
    theta = np.empty(len(vector))
    if solve(matrix, vector, theta):
        return theta
    return np.asarray(np.linalg.lstsq(matrix, vector, rcond=None)[0], np.float64)


def concatenate(blocks: list[NormalBlocks]) -> NormalBlocks:
    """Return all blocks, in order, those without pairs left out."""
    together = [np.concatenate([getattr(b, name) for b in blocks]) for name in NormalBlocks.__slots__]
    present = together[NormalBlocks.__slots__.index("counts")] > 0
    return NormalBlocks(*(part[present] for part in together))
