"""Delays of events by time and by place: which segment of a sequence, or which part of the image, is late.

Each window is fitted by itself, and each tile of the image by itself, from the same sums. A fault that is local stands
out as the segment of windows, or the rectangle of tiles, whose mean delay differs most from the rest: the matched
filter for a step, over every segment and every rectangle.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.group_scatter import shared_errors, student_factor

Float64 = NDArray[np.float64]

FEWEST_SAMPLES = 100
"""Below, a window or tile has no delay of its own."""

LARGE_RESIDUAL = 3.0
"""Times the usual residual over threshold beyond which events of a window or tile do not follow the frames at all."""

FEWEST_CELLS = 8
"""Below, the relative standard error of the scatter of cells exceeds a quarter."""

_FITTED_BY_STEP = 4
"""Two means, and two ends of the part."""

_SINGULAR = 1e-6
"""Least eigenvalue of scaled normal equations at which thresholds and delay are identifiable."""

_MEDIAN_OF_SQUARES = 0.4549
"""Median of chi squared with one degree of freedom."""


@dataclass(frozen=True, slots=True)
class CellSums:
    """Normal equations of cells, (w, c, 3, 3), (w, c, 3), (w, c), (w, c), (w, c): windows by tiles.

    X'WX and X'Wy of C+, C- and delay; y'Wy; the sum of weights; the number of samples.
    """

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64
    counts: Float64

    def over(self, axis: int) -> "CellSums":
        """Return the sums over windows (0) or tiles (1), that axis of length 1."""
        return CellSums(*(getattr(self, name).sum(axis=axis, keepdims=True) for name in CellSums.__slots__))


@dataclass(frozen=True, slots=True)
class CellDelays:
    """Delays (k,) in s, their formal standard errors, and residuals over thresholds; NaN where unidentifiable."""

    seconds: Float64
    errors_s: Float64
    relative_sigmas: Float64

    @property
    def follows_frames(self) -> NDArray[np.bool_]:
        """Where events follow the frames as well as they usually do."""
        usual = np.nanmedian(self.relative_sigmas) if np.isfinite(self.relative_sigmas).any() else 0.0
        follows: NDArray[np.bool_] = np.isfinite(self.seconds) & (self.relative_sigmas <= LARGE_RESIDUAL * usual)
        return follows


@dataclass(frozen=True, slots=True)
class DelayStep:
    """The part whose mean delay differs most from the rest.

    Attributes
    ----------
    chosen
        (k,) windows or tiles of the part.
    offset_s, standard_error_s
        Its delay less that of the rest, s, and the standard error of this difference.
    tests
        Parts that were compared.
    """

    chosen: NDArray[np.bool_]
    offset_s: float
    standard_error_s: float
    tests: int


def delays(sums: CellSums) -> CellDelays:
    """Fit thresholds and delay of each cell by itself.

    Parameters
    ----------
    sums
        Of windows by tiles, (w, c).

    Returns
    -------
    CellDelays
        (w * c,), the windows first.
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
    """Fit each window (``summed`` = 1) or each tile (0), with nominal errors.

    Errors of the frames are shared by samples of one pixel and of its neighbours, so that cells scatter by more than
    their formal errors. An error is the larger of two: the formal one times the usual excess of the file, and how far
    leaving one cell of the part out in turn moves its delay (delete-one jackknife). For windows both are widened by
    what tiles of a row or column share, and the excess is that of all windows together; for tiles that would hide a
    part of the image that is late.

    Parameters
    ----------
    sums
        Of windows by tiles, (w, c).
    summed
        The axis to sum over: 1 gives one delay for each window, 0 one for each tile.

    Returns
    -------
    CellDelays
        (w,) or (c,), with standard errors in s.
    """
    parts, by_cell, cells = delays(sums.over(summed)), _jackknife(sums, summed), delays(sums)
    windows, tiles = sums.counts.shape
    # By how much delays of cells scatter beyond their formal errors. Where a segment of time is late, a cell scatters
    # by its own error alone about the delay of its window; where a part of the image is late, about the delay of its
    # tile. The smaller of both scatters is that of a correct file.
    seconds, cell_errors_s = cells.seconds.reshape(windows, tiles), cells.errors_s.reshape(windows, tiles)
    scatters = []
    for axis in (0, 1):
        of_parts = np.expand_dims(delays(sums.over(axis)).seconds, axis)
        deviations = (seconds - of_parts)[cell_errors_s > 0] / cell_errors_s[cell_errors_s > 0]
        deviation_squares = deviations[np.isfinite(deviations)] ** 2
        if len(deviation_squares) >= FEWEST_CELLS:
            # Robust: a single late cell must not widen the errors of all. z^2 of normal z has the median 0.4549.
            scatters.append(float(np.sqrt(np.median(deviation_squares) / _MEDIAN_OF_SQUARES)))
    excess = max(1.0, min(scatters, default=1.0))
    if summed == 1:
        # By how much errors by leaving out tiles exceed formal ones. A few long edges may hold most of a window's
        # weight; if three of them err alike by chance, which happens over the windows of many files, the jackknife
        # error is much too small. All windows together estimate the excess with the sum of their degrees of freedom
        # (Student). A window has as many as tiles that would share its weight evenly, less 1: (sum w)^2 / sum w^2 - 1
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
    """Return by how much errors of windows exceed those ``by_tile``, of independent tiles; 1 at least.

    A long straight edge crosses the pixels of a whole row of tiles at one phase: its frames err there alike. Leaving
    out rows, or columns, of a window's tiles in turn separates such errors from others, over all windows together.
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
    """Return the spread (k,) of each part's delay when its cells are left out one by one; infinite with one cell."""
    total = sums.over(summed)
    without_matrices, without_vectors = total.matrices - sums.matrices, total.vectors - sums.vectors
    inverses, identifiable = _inverses(without_matrices.reshape(-1, 3, 3), np.full(sums.counts.size, np.inf))
    seconds = np.einsum("kj,kj->k", inverses[:, 2], without_vectors.reshape(-1, 3)).reshape(sums.counts.shape)
    present = sums.counts > 0
    used = present & identifiable.reshape(present.shape)
    # (n - 1) / n times the squares about the mean of the estimates that leave one cell out (Efron and Stein 1981).
    count = np.maximum(used.sum(axis=summed), 1)
    mean = np.where(used, seconds, 0.0).sum(axis=summed) / count
    squares = np.where(used, (seconds - np.expand_dims(mean, summed)) ** 2, 0.0).sum(axis=summed)
    enough = (count > 1) & (used == present).all(axis=summed)
    spread: Float64 = np.where(enough, np.sqrt((count - 1) / count * squares), np.inf)
    return spread


def _inverses(matrices: Float64, counts: Float64) -> tuple[Float64, NDArray[np.bool_]]:
    """Return the inverses (k, 3, 3), zero where thresholds and delay are not identifiable, and whether they are."""
    sizes = np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 1e-300))
    # Unit diagonal: thresholds (counts) and delay (slopes, 1/s) differ in unit, and so would their eigenvalues.
    scales = sizes[:, :, np.newaxis] * sizes[:, np.newaxis, :]
    scaled = matrices / scales
    identifiable = (counts >= FEWEST_SAMPLES) & (np.linalg.eigvalsh(scaled)[:, 0] > _SINGULAR)
    inverses = np.zeros_like(matrices)
    inverses[identifiable] = np.linalg.inv(scaled[identifiable]) / scales[identifiable]
    return inverses, identifiable


def largest_segment_step(values: Float64, errors: Float64) -> DelayStep | None:
    """Return the segment of successive values that differs most from the rest.

    Parameters
    ----------
    values, errors
        (k,) in s; NaN values belong to neither part.

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
    """Return the rectangle of a grid of values that differs most from the rest.

    Parameters
    ----------
    values, errors
        (k,) in s, rows of the grid first; NaN values belong to neither part.
    shape
        Rows and columns of the grid.
    freedom
        Degrees of freedom of each error; the standard error of the step is widened accordingly.

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
        # Means weighted by inverse variances, whose own variances are one over the sums of weights.
        offset_s = float(weighted[chosen].sum() / inside - weighted[~chosen].sum() / outside)
        error = float(np.sqrt(1 / inside + 1 / outside))
        if best is None or abs(offset_s) / error > abs(best.offset_s) / best.standard_error_s:
            best = DelayStep(chosen, offset_s, error, tests)
    if best is None:
        return None
    # By how much values scatter about both means beyond their errors, 1 at least, where there are many.
    scatter, values, weights_of_values, inside_part = 1.0, values[usable], weights[usable], best.chosen[usable]
    residual_freedom = len(values) - _FITTED_BY_STEP
    if residual_freedom >= FEWEST_CELLS:
        rest = float(np.average(values[~inside_part], weights=weights_of_values[~inside_part]))
        residuals = values - rest - best.offset_s * inside_part
        scatter = max(1.0, float(np.sqrt(np.sum(weights_of_values * residuals**2) / residual_freedom)))
    # The variance of a weighted mean adds those of its parts, 1/w of each weighing (w / sum w)^2, and so do their own
    # uncertainties (F. E. Satterthwaite, Biometrics 2, 1946).
    student = 1.0
    if np.isfinite(freedom):
        shares = np.concatenate([weights[side] / weights[side].sum() ** 2 for side in (best.chosen, ~best.chosen)])
        student = student_factor(freedom * float(shares.sum() ** 2 / np.sum(shares**2)))
    return DelayStep(best.chosen, best.offset_s, best.standard_error_s * (scatter * student), tests)
