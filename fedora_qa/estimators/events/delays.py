"""Delays of events by time and by place: the segment of a sequence, or the part of the image, whose events are late.

Each window and each tile of the image is fitted separately, from the same sums. A local fault is the segment of
windows, or the rectangle of tiles, whose mean delay differs most from that of the rest. All segments and all rectangles
are tried, which is the matched filter for a step.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.tails import shared_errors, student_factor

Float64 = NDArray[np.float64]

FEWEST_SAMPLES = 100
"""Least number of samples of a window or tile whose delay is fitted."""

LARGE_RESIDUAL = 3.0
"""Ratio to the median residual over threshold beyond which the events of a window or tile do not follow the frames."""

FEWEST_CELLS = 8
"""Least number of cells whose scatter is used. With fewer cells its relative standard error exceeds a quarter."""

_FITTED_BY_STEP = 4
"""Number of fitted values of a step: two means, and two ends of the part."""

_SINGULAR = 1e-6
"""Least eigenvalue of scaled normal equations at which thresholds and delay are identifiable."""

_MEDIAN_OF_SQUARES = 0.4549
"""Median of chi squared with one degree of freedom."""


@dataclass(frozen=True, slots=True)
class CellSums:
    """Weighted normal equations of cells, w windows by c tiles, for the parameters C+, C- and delay.

    Attributes
    ----------
    matrices, vectors
        (w, c, 3, 3) X'WX and (w, c, 3) X'Wy.
    squares
        (w, c) y'Wy, in squared units of the level.
    weights
        (w, c) sums of the weights.
    counts
        (w, c) numbers of samples.
    """

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64
    counts: Float64

    def over(self, axis: int) -> "CellSums":
        """Return the sums over windows (axis 0) or tiles (axis 1); this axis then has the length 1."""
        return CellSums(*(getattr(self, name).sum(axis=axis, keepdims=True) for name in CellSums.__slots__))


@dataclass(frozen=True, slots=True)
class CellDelays:
    """Delays of k cells or parts; NaN where thresholds and delay are not identifiable.

    Attributes
    ----------
    seconds
        (k,) delays of the event timestamps, s; positive where they are late.
    errors_s
        (k,) standard errors of the delays, s.
    relative_sigmas
        (k,) standard deviations of the residuals, over the mean threshold.
    """

    seconds: Float64
    errors_s: Float64
    relative_sigmas: Float64

    @property
    def follows_frames(self) -> NDArray[np.bool_]:
        """Mask (k,) of the cells whose residual is at most ``LARGE_RESIDUAL`` times the median residual."""
        usual = np.nanmedian(self.relative_sigmas) if np.isfinite(self.relative_sigmas).any() else 0.0
        follows: NDArray[np.bool_] = np.isfinite(self.seconds) & (self.relative_sigmas <= LARGE_RESIDUAL * usual)
        return follows


@dataclass(frozen=True, slots=True)
class DelayStep:
    """The part whose mean delay differs most from that of the rest.

    Attributes
    ----------
    chosen
        (k,) True for the windows or tiles of the part.
    offset_s, standard_error_s
        Mean delay of the part less that of the rest, s, and the standard error of this difference, s.
    tests
        Number of parts that were compared.
    """

    chosen: NDArray[np.bool_]
    offset_s: float
    standard_error_s: float
    tests: int


def delays(sums: CellSums) -> CellDelays:
    """Fit thresholds and delay of each cell separately.

    Parameters
    ----------
    sums
        Normal equations of w windows by c tiles.

    Returns
    -------
    CellDelays
        (w * c,) in the order of windows, then tiles; with formal standard errors.
    """
    count = sums.counts.size
    cells = CellSums(
        *(getattr(sums, name).reshape(count, *getattr(sums, name).shape[2:]) for name in CellSums.__slots__)
    )
    inverses, identifiable = _inverses(cells.matrices, cells.counts)
    # theta = (X'WX)^-1 X'Wy; residual squares y'Wy - theta'X'Wy.
    theta = np.einsum("kij,kj->ki", inverses, cells.vectors)
    residual = np.maximum(cells.squares - np.einsum("ki,ki->k", theta, cells.vectors), 0.0)
    variances = residual / np.maximum(cells.weights, 1e-300)
    steps = np.maximum(0.5 * np.abs(theta[:, :2]).sum(axis=1), 1e-300)

    def where_identifiable(values: Float64) -> Float64:
        return np.where(identifiable, values, np.nan)

    # Cov(theta) = sigma^2 (X'WX)^-1, with sigma^2 the weighted mean of the squared residuals.
    errors = np.sqrt(np.maximum(inverses[:, 2, 2] * variances, 0.0))
    return CellDelays(
        where_identifiable(theta[:, 2]), where_identifiable(errors), where_identifiable(np.sqrt(variances) / steps)
    )


def delays_of_parts(sums: CellSums, summed: int) -> CellDelays:
    """Fit the delay of each window or of each tile, with the errors that a correct file gives.

    Samples of one pixel and of its neighbours share errors of the frames, so that cells scatter by more than their
    formal errors. The error of a part is the larger of two: its formal error times the excess of the file, and the
    scatter of its delay when one of its cells is left out in turn (delete-one jackknife). For windows, the excess is
    also that of the jackknife errors of all windows, and both errors are widened by what tiles of one row or column
    share. For tiles this would hide a late part of the image.

    Parameters
    ----------
    sums
        Normal equations of w windows by c tiles.
    summed
        Axis to sum over: 1 gives one delay for each window, 0 one delay for each tile.

    Returns
    -------
    CellDelays
        (w,) or (c,), with these standard errors.
    """
    parts, by_cell, cells = delays(sums.over(summed)), _jackknife(sums, summed), delays(sums)
    windows, tiles = sums.counts.shape
    # Scatter of the delays of cells over their formal errors. If a segment of time is late, a cell scatters only by its
    # own error about the delay of its window; if a part of the image is late, about the delay of its tile. The smaller
    # of both scatters is that of a correct file.
    seconds, cell_errors_s = cells.seconds.reshape(windows, tiles), cells.errors_s.reshape(windows, tiles)
    scatters = []
    for axis in (0, 1):
        of_parts = np.expand_dims(delays(sums.over(axis)).seconds, axis)
        deviations = (seconds - of_parts)[cell_errors_s > 0] / cell_errors_s[cell_errors_s > 0]
        deviation_squares = deviations[np.isfinite(deviations)] ** 2
        if len(deviation_squares) >= FEWEST_CELLS:
            # scatter^2 = median(z^2) / 0.4549, the median for normal z: a single late cell must not widen all errors.
            scatters.append(float(np.sqrt(np.median(deviation_squares) / _MEDIAN_OF_SQUARES)))
    excess = max(1.0, min(scatters, default=1.0))
    if summed == 1:
        # Excess of jackknife errors over formal ones. A few long edges can hold most of the weight of a window. If
        # three of them err alike by chance, which occurs among the windows of many files, the jackknife error is much
        # too small. All windows together estimate the excess with the sum of their degrees of freedom (Student). A
        # window has (sum w)^2 / sum w^2 - 1 of these: the number of tiles that would share its weight evenly, less 1
        # (L. Kish, Survey Sampling, Wiley 1965).
        weights = np.where(cell_errors_s > 0, cell_errors_s, np.inf) ** -2.0
        weights = np.where(np.isfinite(weights), weights, 0.0)
        freedom = np.maximum(weights.sum(axis=1) ** 2 / np.maximum((weights**2).sum(axis=1), 1e-300) - 1, 0.0)
        usable = np.isfinite(by_cell) & (parts.errors_s > 0) & (freedom > 0)
        if usable.any():
            squares = np.average((by_cell[usable] / parts.errors_s[usable]) ** 2, weights=freedom[usable])
            excess = max(excess, float(np.sqrt(squares)) * student_factor(float(freedom[usable].sum())))
    errors_s = np.maximum(parts.errors_s * excess, by_cell)
    shared = _shared_by_lines(sums, parts.errors_s, errors_s) if summed == 1 else 1.0
    return CellDelays(parts.seconds, errors_s * shared, parts.relative_sigmas)


def _shared_by_lines(sums: CellSums, formal: Float64, by_tile: Float64) -> float:
    """Return the ratio of the errors of windows to those of independent tiles (``by_tile``), 1 at least.

    A long straight edge crosses the pixels of a whole row of tiles at one phase, so that the frames err equally there.
    Such errors are estimated from all windows together, by leaving out rows, or columns, of tiles in turn.
    """
    windows, tiles = sums.counts.shape
    side = round(tiles**0.5)
    widest = 1.0
    for axis in (1, 2):
        lines = CellSums(*(getattr(sums, name).reshape(windows, side, side, *getattr(sums, name).shape[2:]).sum(axis)
                           for name in CellSums.__slots__))  # fmt: skip
        by_line = _jackknife(lines, 1)
        usable = np.isfinite(by_line) & np.isfinite(by_tile) & (by_tile > 0) & (formal > 0)
        if usable.any():
            by_lines, by_tiles = (np.sqrt(np.sum((each[usable] / formal[usable]) ** 2)) for each in (by_line, by_tile))
            count = np.count_nonzero(usable)
            # ``shared_errors`` takes numbers of groups and subtracts 1: degrees of freedom of all windows, plus 1.
            shared = shared_errors(by_tiles, (tiles - 1) * count + 1, by_lines, (side - 1) * count + 1)
            widest = max(widest, float(shared / by_tiles))
    return widest


def _jackknife(sums: CellSums, summed: int) -> Float64:
    """Return the standard errors (k,) of delays of parts, s, by leaving out one cell each; infinite with one cell."""
    total = sums.over(summed)
    without_matrices, without_vectors = total.matrices - sums.matrices, total.vectors - sums.vectors
    inverses, identifiable = _inverses(without_matrices.reshape(-1, 3, 3), np.full(sums.counts.size, np.inf))
    seconds = np.einsum("kj,kj->k", inverses[:, 2], without_vectors.reshape(-1, 3)).reshape(sums.counts.shape)
    present = sums.counts > 0
    used = present & identifiable.reshape(present.shape)
    # error^2 = (n - 1) / n sum_i (d_i - mean d)^2, d_i the delay without cell i (Efron and Stein 1981).
    count = np.maximum(used.sum(axis=summed), 1)
    mean = np.where(used, seconds, 0.0).sum(axis=summed) / count
    squares = np.where(used, (seconds - np.expand_dims(mean, summed)) ** 2, 0.0).sum(axis=summed)
    enough = (count > 1) & (used == present).all(axis=summed)
    spread: Float64 = np.where(enough, np.sqrt((count - 1) / count * squares), np.inf)
    return spread


def _inverses(matrices: Float64, counts: Float64) -> tuple[Float64, NDArray[np.bool_]]:
    """Return inverses (k, 3, 3), and whether (k,) thresholds and delay are identifiable; zeros where they are not."""
    sizes = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 1e-300))
    # Scaled to a unit diagonal, because the columns of thresholds (counts) and delay (slopes) differ in unit.
    scales = sizes[:, :, np.newaxis] * sizes[:, np.newaxis, :]
    scaled = matrices / scales
    identifiable = (counts >= FEWEST_SAMPLES) & (np.linalg.eigvalsh(scaled)[:, 0] > _SINGULAR)
    inverses = np.zeros_like(matrices)
    inverses[identifiable] = np.linalg.inv(scaled[identifiable]) / scales[identifiable]
    return inverses, identifiable


def largest_segment_step(values: Float64, errors: Float64) -> DelayStep | None:
    """Return the segment of successive values whose mean differs most from that of the rest, in standard errors.

    Parameters
    ----------
    values, errors
        (k,) delays in the order of time and their standard errors, s. NaN values belong to neither part.

    Returns
    -------
    DelayStep | None
        None where no segment has values both inside and outside.
    """
    count, indices = len(values), np.arange(len(values))
    ends = (segment for segment in combinations(range(count + 1), 2) if segment[1] - segment[0] < count)
    return _largest_step(values, errors, ((indices >= start) & (indices < stop) for start, stop in ends))


def largest_rectangle_step(
    values: Float64, errors: Float64, shape: tuple[int, int], freedom: float = np.inf
) -> DelayStep | None:
    """Return the rectangle of a grid of values whose mean differs most from that of the rest, in standard errors.

    Parameters
    ----------
    values, errors
        (k,) delays by rows of the grid, and their standard errors, s. NaN values belong to neither part.
    shape
        Rows and columns of the grid; their product is k.
    freedom
        Degrees of freedom of each error. The standard error of the step is widened by ``student_factor``.

    Returns
    -------
    DelayStep | None
        None where no rectangle has values both inside and outside.
    """
    row, column = (indices.ravel() for indices in np.indices(shape))
    rectangles = product(combinations(range(shape[0] + 1), 2), combinations(range(shape[1] + 1), 2))
    parts = (
        (row >= top) & (row < bottom) & (column >= left) & (column < right)
        for (top, bottom), (left, right) in rectangles
    )
    return _largest_step(values, errors, (part for part in parts if not part.all()), freedom)


def _largest_step(
    values: Float64, errors: Float64, parts: Iterable[NDArray[np.bool_]], freedom: float = np.inf
) -> DelayStep | None:
    """Return the part whose weighted mean differs most from that of the rest; as ``largest_rectangle_step``."""
    usable = np.isfinite(values) & np.isfinite(errors)
    weights = np.where(usable, 1 / np.where(usable, errors, 1.0) ** 2, 0.0)
    weighted = weights * np.where(usable, values, 0.0)
    best: DelayStep | None = None
    tests = 0
    for chosen in parts:
        inside, outside = float(weights[chosen].sum()), float(weights[~chosen].sum())
        if inside == 0 or outside == 0:
            continue
        tests += 1
        # Weighted means with w = 1 / error^2: d = sum_in w x / sum_in w - sum_out w x / sum_out w, of variance
        # Var d = 1 / sum_in w + 1 / sum_out w.
        offset_s = float(weighted[chosen].sum() / inside - weighted[~chosen].sum() / outside)
        error = float(np.sqrt(1 / inside + 1 / outside))
        if best is None or abs(offset_s) / error > abs(best.offset_s) / best.standard_error_s:
            best = DelayStep(chosen, offset_s, error, tests)
    if best is None:
        return None
    # Where there are enough values: their scatter about both means over their errors, 1 at least.
    scatter, values, weights_of_values, inside_part = 1.0, values[usable], weights[usable], best.chosen[usable]
    residual_freedom = len(values) - _FITTED_BY_STEP
    if residual_freedom >= FEWEST_CELLS:
        rest = float(np.average(values[~inside_part], weights=weights_of_values[~inside_part]))
        residuals = values - rest - best.offset_s * inside_part
        scatter = max(1.0, float(np.sqrt(np.sum(weights_of_values * residuals**2) / residual_freedom)))
    # Degrees of freedom of a sum of variances v_i: nu (sum v)^2 / sum v^2 (F. E. Satterthwaite, Biometrics 2, 1946).
    # Value i contributes v_i = w_i / (sum w)^2 to the variance of its weighted mean.
    student = 1.0
    if np.isfinite(freedom):
        shares = np.concatenate([weights[side] / weights[side].sum() ** 2 for side in (best.chosen, ~best.chosen)])
        student = student_factor(freedom * float(shares.sum() ** 2 / np.sum(shares**2)))
    return DelayStep(best.chosen, best.offset_s, best.standard_error_s * (scatter * student), tests)
