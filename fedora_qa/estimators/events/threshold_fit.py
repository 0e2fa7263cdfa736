"""Thresholds, delay and clock rate of an event sensor from normal equations of its samples.

Samples are summed by block (a part of the image in a window); their scatter between blocks gives the standard errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import jackknife_errors
from fedora_qa.estimators.fitting.tails import shared_errors

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

FEWEST_PAIRS = 100
"""Least number of samples of a fit. With fewer, the relative standard error of the scale of residuals exceeds 10%."""
FEWEST_BLOCKS = 4
"""Least number of blocks, or of groups of blocks, whose scatter is used as an error."""
FEWEST_TIMES = 4
"""Least number of different times of blocks with which a rate is fitted."""
_SINGULAR = 1e8
"""Condition number of scaled normal equations beyond which a parameter is not identifiable."""


@dataclass(frozen=True, slots=True)
class NormalBlocks:
    """Weighted normal equations of b blocks of samples. Their sums over blocks are the equations of all samples.

    Attributes
    ----------
    matrices, vectors
        (b, k, k) X'WX and (b, k) X'Wy of k parameters; level pairs and interpolated levels have four.
    squares, weights, counts
        (b,) y'Wy, sum of the weights, and number of samples.
    times_s
        (b,) mean time of the samples, s from the origin.
    """

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64
    counts: Float64
    times_s: Float64

    def __len__(self) -> int:
        return len(self.counts)


@dataclass(frozen=True, slots=True)
class ResponseErrors:
    """Errors of the estimates of a ``ResponseFit``.

    Attributes
    ----------
    threshold_on, threshold_off
        Errors of C+ and C-, in the unit of the levels.
    delay_s
        Error of the delay, s.
    delay_rate
        Error of the rate of the delay, s/s.
    """

    threshold_on: float
    threshold_off: float
    delay_s: float
    delay_rate: float


@dataclass(frozen=True, slots=True)
class ResponseFit:
    """Response of the event sensor to the light of the frames.

    Attributes
    ----------
    threshold_on, threshold_off
        C+ and C-: change of the level by one brighter and by one darker event, in the unit of the levels.
    delay_s
        Delay of the event timestamps at ``middle_s``, s; positive where they are late.
    delay_rate
        Rate of the delay, s/s; 0 where the blocks have fewer than four different times.
    kappa_s
        Coefficient of the absolute slope of the levels (``frame_interpolation``), s; 0 where it is not fitted.
    middle_s
        Weighted mean time of the samples, s from the origin.
    standard_errors
        The larger of the formal errors and those by leaving out blocks (delete-one jackknife); infinite where a
        parameter is not fitted.
    attenuation
        Bounds on the bias that errors of the regressors cause.
    coherent_delay_s
        Bound on the error of the delay, s, by errors of the levels that are as large as the residuals and fully
        correlated.
    sigma
        Standard deviation of the residual of a sample, in the unit of the levels.
    """

    threshold_on: float
    threshold_off: float
    delay_s: float
    delay_rate: float
    kappa_s: float
    middle_s: float
    standard_errors: ResponseErrors
    attenuation: ResponseErrors
    coherent_delay_s: float
    sigma: float

    @property
    def threshold(self) -> float:
        """The mean of the absolute values of both thresholds, in the unit of the levels."""
        return max(0.5 * (abs(self.threshold_on) + abs(self.threshold_off)), 1e-300)

    @property
    def relative_sigma(self) -> float:
        """Residual over threshold, a ratio; it is small where the events follow the levels."""
        return self.sigma / self.threshold

    def block_sigmas(self, blocks: NormalBlocks) -> Float64:
        """Return the standard deviation (b,) of the residuals of each block of level pairs, in their unit."""
        delays_s = self.delay_s + self.delay_rate * (blocks.times_s - self.middle_s)
        steps = np.array([self.threshold_on, self.threshold_off])
        # Level pairs: C+, C-, and the delay times C+ and C- as coefficients of both rates (``levels.py``).
        theta = np.concatenate([np.tile(steps, (len(blocks), 1)), delays_s[:, np.newaxis] * steps], axis=1)
        # |y - X theta|^2 = y'Wy - 2 theta'X'Wy + theta'X'WX theta.
        squares = blocks.squares - 2 * np.einsum("bi,bi->b", blocks.vectors, theta)
        squares += np.einsum("bi,bij,bj->b", theta, blocks.matrices, theta)
        sigmas: Float64 = np.sqrt(np.maximum(squares / blocks.weights, 1e-300))
        return sigmas


def normal_blocks(
    X: Float64, y: Float64, weights: Float64, block_of_row: NDArray[np.intp], blocks: int, times_s: Float64
) -> NormalBlocks:
    """Return the weighted normal equations of y on X, summed by block.

    Parameters
    ----------
    X
        (m, k) regressors.
    y, weights
        (m,) values and their weights.
    block_of_row, times_s
        (m,) number of the block of each row, 0 to b - 1, and time of each row, s.
    blocks
        Number b of blocks.

    Returns
    -------
    NormalBlocks
        b blocks of k parameters; blocks without rows hold zeros.
    """
    parameters = X.shape[1]
    sums = BlockSums(np.zeros((blocks, parameters, parameters)), np.zeros((blocks, parameters)), np.zeros((blocks, 4)))
    sum_blocks(X, y, weights, block_of_row.astype(np.int64), times_s, sums)
    squares, total, counts, times = sums.scalars.T.copy()
    return NormalBlocks(sums.matrices, sums.vectors, squares, total, counts, times / np.maximum(counts, 1.0))


def concatenate(sums: list[NormalBlocks]) -> NormalBlocks:
    """Return the blocks of several sums, in order, without blocks that have no samples."""
    fields = [np.concatenate([getattr(blocks, name) for blocks in sums]) for name in NormalBlocks.__slots__]
    present = fields[NormalBlocks.__slots__.index("counts")] > 0
    return NormalBlocks(*(values[present] for values in fields))


def fit_response(blocks: NormalBlocks) -> ResponseFit | None:
    """Fit level pairs: thresholds, delay and rate.

    Parameters
    ----------
    blocks
        Blocks of the four regressors of level pairs (``levels.accumulate``).

    Returns
    -------
    ResponseFit | None
        None where there are too few pairs or blocks, or the parameters are not identifiable, as with one polarity.
    """
    if _too_few(blocks):
        return None
    matrix, vector = blocks.matrices.sum(axis=0), blocks.vectors.sum(axis=0)
    if np.linalg.cond(_scaled(matrix)) > _SINGULAR:
        return None
    steps = np.linalg.solve(matrix, vector)[:2]
    # The columns of both rates become one, C+ d rate+ - C- d rate-, with the thresholds of a first fit.
    reduction = np.zeros((4, 3))
    reduction[0, 0] = reduction[1, 1] = 1.0
    reduction[2:, 2] = steps
    return _fit(blocks, reduction, uncertain_counts=True)


def fit_interpolation(blocks: NormalBlocks, groups: Sequence[NDArray[np.intp]] = ()) -> ResponseFit | None:
    """Fit frames interpolated at events (``frame_interpolation.py``): thresholds, delay, rate and kappa.

    Parameters
    ----------
    blocks
        b blocks of four parameters: C+, C-, delay and kappa.
    groups
        (b,) each: the number of the group of each block. Blocks of one group can share an error and are left out
        together.

    Returns
    -------
    ResponseFit | None
        None where there are too few samples or blocks, or the parameters are not identifiable.
    """
    return None if _too_few(blocks) else _fit(blocks, np.eye(4), uncertain_counts=False, groups=groups)


def _too_few(blocks: NormalBlocks) -> bool:
    return bool(blocks.counts.sum() < FEWEST_PAIRS or len(blocks) < FEWEST_BLOCKS)


def _fit(
    blocks: NormalBlocks,
    reduction: Float64,
    *,
    uncertain_counts: bool,
    groups: Sequence[NDArray[np.intp]] = (),
) -> ResponseFit | None:
    """Fit C+, C-, the delay and its rate, and kappa if it has a column.

    Parameters
    ----------
    blocks
        b blocks of four regressors.
    reduction
        (4, 3) or (4, 4): coefficients of the regressors in the columns of C+, C-, delay and kappa.
    uncertain_counts
        Whether counts of events have errors, as interpolated counts do.
    groups
        (b,) each, as those of ``fit_interpolation``. Where there are any, blocks are cells, few of which can hold all
        edges: errors are widened by the number of cells that hold the weight.

    Returns
    -------
    ResponseFit | None
        None where the parameters are not identifiable.
    """
    # Times count from their weighted mean: the delay and its rate are then nearly uncorrelated.
    middle_s = float(np.average(blocks.times_s, weights=blocks.weights))
    times_s = blocks.times_s - middle_s
    # With enough different times, the last column fits the rate: the column of the delay times the time of the block.
    fitted = reduction.shape[1]
    columns = fitted + 1 if len(np.unique(times_s.round(3))) >= FEWEST_TIMES else fitted
    reductions = np.zeros((len(blocks), len(reduction), columns))
    reductions[:, :, :fitted] = reduction
    if columns > fitted:
        reductions[:, :, fitted] = times_s[:, np.newaxis] * reduction[:, 2]
    normals: Float64 = np.einsum("bij,bik,bkl->bjl", reductions, blocks.matrices, reductions)
    sides: Float64 = np.einsum("bij,bi->bj", reductions, blocks.vectors)
    normal, side = normals.sum(axis=0), sides.sum(axis=0)
    if np.linalg.cond(_scaled(normal)) > _SINGULAR:
        return None
    theta = np.asarray(np.linalg.solve(normal, side), dtype=np.float64)
    weight = float(blocks.weights.sum())
    variance = max(float(blocks.squares.sum() - theta @ side), 0.0) / weight
    # Cov(theta) = sigma^2 N^-1, with sigma^2 the weighted mean of the squared residuals.
    formal = np.sqrt(np.diag(np.linalg.inv(normal)) * variance)
    by_block = np.maximum(formal, _jackknife(normal - normals, side - sides))
    errors = by_block
    if groups:
        # Errors by cells are widened, because few cells can hold the weight of a parameter.
        samples, parts = float(blocks.counts.sum()), _effective_parts(normal, normals)
        widened = [shared_errors(of, samples, by, n) for of, by, n in zip(formal, by_block, parts, strict=True)]
        errors = np.asarray(widened, dtype=np.float64)
    for group in groups:
        count = len(np.unique(group))
        if count >= FEWEST_BLOCKS:
            by_group = _jackknife(normal - _summed(normals, group), side - _summed(sides, group))
            errors = np.maximum(errors, shared_errors(by_block, len(blocks), by_group, count))
    attenuation = np.zeros_like(theta)
    if uncertain_counts:
        # If all residuals came from errors of the counts, with variance s^2 / C^2 for each pair, these would add
        # diag(squares / C^2) to the normal matrix, and change the estimate by N^-1 diag(squares / C^2) C (Fuller 1987,
        # eq. 1.1.12).
        attenuation[:2] = weight * variance / np.where(theta[:2] == 0, np.inf, theta[:2])
        attenuation = np.abs(np.linalg.solve(normal, attenuation))
    return ResponseFit(
        threshold_on=float(theta[0]),
        threshold_off=float(theta[1]),
        delay_s=float(theta[2]),
        delay_rate=float(theta[fitted]) if len(theta) > fitted else 0.0,
        kappa_s=float(theta[3]) if fitted > 3 else 0.0,
        middle_s=middle_s,
        standard_errors=_named(errors, fitted),
        attenuation=_named(attenuation, fitted),
        # |r'e| / |r|^2 <= |e| / |r| (Cauchy and Schwarz), with r the part of the slope that is orthogonal to the other
        # regressors: 1 / |r|^2 = (N^-1)_33.
        coherent_delay_s=float(formal[2] * np.sqrt(weight)),
        sigma=float(np.sqrt(variance)),
    )


def _effective_parts(normal: Float64, normals: Float64) -> Float64:
    """Return the effective number (m,) of blocks for each parameter, from normal matrices (b, m, m) and their sum.

    The weight of a block is the change of a parameter when the estimate of the block changes by 1. These weights add up
    to 1.
    """
    # n = (sum w)^2 / sum w^2 (L. Kish, Survey Sampling, Wiley 1965), with w = diag(N^-1 N_b).
    shares = np.einsum("ij,bji->bi", np.linalg.inv(normal), normals)
    return np.asarray(np.abs(shares).sum(axis=0) ** 2 / np.sum(shares**2, axis=0))


def _summed(parts: Float64, group: NDArray[np.intp]) -> Float64:
    """Return the sums of the blocks of each group."""
    sums = np.zeros((int(group.max()) + 1, *parts.shape[1:]))
    np.add.at(sums, group, parts)
    return sums[np.unique(group)]


def _jackknife(normals: Float64, sides: Float64) -> Float64:
    """Return the standard errors (k,) from estimates that leave out one block each."""
    inverses = np.linalg.pinv(normals, hermitian=True)  # a single block can hold all weight of a parameter
    return jackknife_errors((inverses @ sides[..., np.newaxis])[..., 0])


def _named(values: Float64, fitted: int) -> ResponseErrors:
    """Return the errors of C+, C-, delay and rate. The rate is the value at ``fitted``, infinite if it is absent."""
    rate = float(values[fitted]) if len(values) > fitted else float("inf")
    return ResponseErrors(float(values[0]), float(values[1]), float(values[2]), rate)


def _scaled(matrix: Float64) -> Float64:
    """Return a matrix scaled to a unit diagonal, so that its condition number does not depend on units."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled: Float64 = matrix / np.outer(size, size)
    return scaled


class BlockSums(NamedTuple):
    """Sums of b blocks.

    Attributes
    ----------
    matrices, vectors
        (b, k, k) X'WX and (b, k) X'Wy.
    scalars
        (b, 4) sums of w y^2, of w, of 1 and of the times, s.
    """

    matrices: Float64
    vectors: Float64
    scalars: Float64


@njit(cache=True)
def sum_blocks(
    X: Float64, y: Float64, weights: Float64, block_of_row: Int64, times_s: Float64, sums: BlockSums
) -> None:
    """Add the normal equations of rows to the sums of their blocks.

    Parameters
    ----------
    X
        (m, k) regressors.
    y, weights
        (m,) values and their weights.
    block_of_row, times_s
        (m,) number of the block of each row, 0 to b - 1, and time of each row, s.
    sums
        Sums of the b blocks; they are added to.
    """
    matrices, vectors, scalars = sums
    for i in range(len(y)):
        block, weight = block_of_row[i], weights[i]
        for j in range(X.shape[1]):
            weighted = weight * X[i, j]
            vectors[block, j] += weighted * y[i]
            for k in range(j + 1):
                matrices[block, j, k] += weighted * X[i, k]
        scalars[block, 0] += weight * y[i] * y[i]
        scalars[block, 1] += weight
        scalars[block, 2] += 1.0
        scalars[block, 3] += times_s[i]
    # Only the lower triangle was summed.
    for j in range(X.shape[1]):
        for k in range(j):
            for block in range(len(matrices)):
                matrices[block, k, j] = matrices[block, j, k]
