"""Compiled step of paths along a field of flow: interpolate it, bound the error of that, and keep clear of breaks.

Fields come as lines (H, 2 W): u and v of one pixel after another. Only the pixels about the paths are evaluated, so
that a step costs what its paths cost, however large the image is. Where paths are many, `interpolation_errors`
evaluates all pixels once, and a step reads its result.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.flow.mask import BREAK_PX, widened

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

_CELL_PX = 4
"""Step between the pixels whose targets are entered, and side of the cells that they are entered in."""

_CELLS_DOUBLE = 4 * 220_000
"""Pixels of a frame from which on cells are twice as wide: in the view they are no wider than those of 540x405, which
separate its surfaces, and entering the targets takes a quarter of the time."""

_OF_SECOND_DIFFERENCE = np.float32(0.25)
"""Twice the error of bilinear interpolation, which is an eighth of the second differences (Lagrange's remainder)."""

_OF_THIRD_DIFFERENCE = np.float32(0.5)
"""Where two surfaces meet, flow steps by s from one pixel to the next, and interpolation between them errs by up to s.

The second difference is s before the step and -s behind it, the third 2 s; where flow is smooth it vanishes.
"""

_CROWDED_PX = 0.5
"""Flows that lead to one place and differ by more belong to different surfaces, where flow does not slope."""

_REACH = 5
"""Pixels about a path's that decide whether it keeps 4 px away from breaks: those themselves bend over three pixels."""

_BREAK = np.float32(BREAK_PX)


class PathStates(NamedTuple):
    """Paths (n,) along fields: positions in px, error bounds in px, whether they are clear, whether they stay.

    A path is clear while flow is finite along it and no break or other surface is near; it stays while it lies within
    the image.
    """

    x: Float64
    y: Float64
    bound_px: Float64
    clear: Mask
    stays: Mask


@njit(cache=True)
def step(
    lines: Float32,
    spans: Float32,
    errors_px: Float32,
    rounding_px: float,
    first: bool,
    guarded: bool,
    paths: PathStates,
) -> None:
    """Move paths along a field, in place: positions, bounds, and whether they are still clear and stay.

    Parameters
    ----------
    lines
        (H, 2 W) the field.
    spans
        Of `spans_at_targets`: paths that end where another surface does are not clear. Empty: not tested.
    errors_px
        Of `interpolation_errors`. Empty: the pixels about each path are evaluated.
    rounding_px
        What single precision adds to the bound.
    first
        Paths are at pixels: nothing is interpolated.
    guarded
        Whether paths must keep away from breaks.
    paths
        Changed in place.
    """
    x, y, bound_px, clear, stays = paths
    height, width = lines.shape[0], lines.shape[1] // 2
    precomputed, values, cell_px = len(errors_px) > 0, lines.reshape(-1), _cell_px(height, width)
    for i in range(len(x)):
        # Bilinear interpolation reads the next column and row, so that the last ones have no flow.
        stays[i] = stays[i] and 0 <= x[i] < width - 1 and 0 <= y[i] < height - 1
        if not stays[i]:
            clear[i] = False
            continue
        column, row = int(np.rint(x[i])), int(np.rint(y[i]))
        if guarded and clear[i]:
            clear[i] = errors_px[row, column] < np.inf if precomputed else _keeps_clear(lines, row, column)
        u, v, slope = _interpolated_flow(values, 2 * width, x[i], y[i])
        if np.isnan(u) or np.isnan(v):
            clear[i] = False
            continue
        if not first:
            # An error e of the position becomes up to (1 + slope) e, and the interpolation's own error is added.
            bound_px[i] *= 1.0 + slope
            if clear[i]:
                bound_px[i] += errors_px[row, column] if precomputed else _interpolation_error(lines, row, column)
        bound_px[i] += rounding_px
        x[i] += u
        y[i] += v
        stays[i] = 0 <= x[i] < width - 1 and 0 <= y[i] < height - 1  # so it does not where flow is infinite
        clear[i] = clear[i] and stays[i]
        if clear[i] and len(spans):
            clear[i] = not _is_crowded(spans, cell_px, x[i], y[i], u, v, slope)


@njit(cache=True)
def _keeps_clear(lines: Float32, row: int, column: int) -> bool:
    """Whether no break of the flow, no missing value and no border lies within 4 px of a pixel."""
    height, width = lines.shape[0], lines.shape[1] // 2
    if not (_REACH <= row < height - _REACH and _REACH <= column < width - _REACH):
        return False
    # Unsigned indices, from 0 on: where one may be negative, each costs a comparison.
    values, wide, most = lines.reshape(-1), np.uint64(2 * width), np.uint64(22)
    index = np.uint64((row - _REACH + 1) * 2 * width + 2 * (column - _REACH))
    for _ in range(2 * _REACH - 1):
        above, centre, below = (
            values[index - wide : index - wide + most],
            values[index : index + most],
            values[index + wide :],
        )
        breaks = np.int32(0)
        for i in range(18):
            # the discrete Laplacian of one component
            bend = above[i + 2] + below[i + 2] + centre[i] + centre[i + 4] - np.float32(4) * centre[i + 2]
            breaks |= np.int32(not abs(bend) <= _BREAK)  # so it is, too, beside a missing value
        if breaks:
            return False
        index += wide
    return True


@njit(cache=True, fastmath={"nnan", "nsz"})
def _interpolation_error(lines: Float32, row: int, column: int) -> float:
    """Return how far interpolating one component may err within a pixel of one that keeps clear, px."""
    values, wide = lines.reshape(-1), np.uint64(lines.shape[1])
    index, largest = np.uint64((row - 1) * lines.shape[1] + 2 * (column - 3)), np.float32(0)
    for _ in range(3):
        highest, above, centre = values[index - wide - wide :], values[index - wide :], values[index:]
        below, lowest = values[index + wide :], values[index + wide + wide :]
        for i in range(6):
            two = np.float32(2)
            # second differences across and down, then those of the neighbours, whose differences are the third ones
            across = centre[i + 2] - two * centre[i + 4] + centre[i + 6]
            down = above[i + 4] - two * centre[i + 4] + below[i + 4]
            left = centre[i] - two * centre[i + 2] + centre[i + 4]
            right = centre[i + 4] - two * centre[i + 6] + centre[i + 8]
            upper = highest[i + 4] - two * above[i + 4] + centre[i + 4]
            lower = centre[i + 4] - two * below[i + 4] + lowest[i + 4]
            steps = abs(across - left) + abs(right - across) + abs(down - upper) + abs(lower - down)
            error = _OF_SECOND_DIFFERENCE * (abs(across) + abs(down)) + _OF_THIRD_DIFFERENCE * steps
            largest = error if error > largest else largest
        index += wide
    return float(largest)


def interpolation_errors(lines: Float32) -> Float32:
    """Bound the error of interpolating a field within a pixel of each of its pixels.

    Parameters
    ----------
    lines
        (H, 2 W) u and v of one pixel after another, px.

    Returns
    -------
    ndarray of float32
        (H, W) px; infinite within 4 px of breaks of the flow, missing values and the border.
    """
    breaks, errors = _breaks_and_errors(lines)
    largest = np.asarray(cv2.dilate(errors, np.ones((3, 3), np.uint8)), dtype=np.float32)
    largest[widened(breaks) > 0] = np.inf
    return largest


@njit(cache=True)
def _breaks_and_errors(lines: Float32) -> tuple[NDArray[np.uint8], Float32]:
    """Return where a field breaks (H, W), and the larger error of interpolation of both components."""
    height, width = lines.shape[0], lines.shape[1] // 2
    breaks, errors = np.ones((height, width), np.uint8), np.zeros((height, width), np.float32)
    bent, error = np.ones(2 * width, np.uint8), np.zeros(2 * width, np.float32)
    for row in range(1, height - 1):
        above, centre, below = lines[row - 1], lines[row], lines[row + 1]
        for i in range(2, 2 * width - 2):
            bend = above[i] + below[i] + centre[i - 2] + centre[i + 2] - np.float32(4) * centre[i]
            bent[i] = not abs(bend) <= _BREAK  # so it is, too, beside a missing value
        for column in range(1, width - 1):
            breaks[row, column] = bent[2 * column] | bent[2 * column + 1]
        if not 2 <= row < height - 2:
            continue
        highest, lowest = lines[row - 2], lines[row + 2]
        for i in range(4, 2 * width - 4):
            across = centre[i - 2] - np.float32(2) * centre[i] + centre[i + 2]
            down = above[i] - np.float32(2) * centre[i] + below[i]
            left = centre[i - 4] - np.float32(2) * centre[i - 2] + centre[i]
            right = centre[i] - np.float32(2) * centre[i + 2] + centre[i + 4]
            upper = highest[i] - np.float32(2) * above[i] + centre[i]
            lower = centre[i] - np.float32(2) * below[i] + lowest[i]
            steps = abs(across - left) + abs(right - across) + abs(down - upper) + abs(lower - down)
            bound = _OF_SECOND_DIFFERENCE * (abs(across) + abs(down)) + _OF_THIRD_DIFFERENCE * steps
            error[i] = bound if bound < np.float32(np.inf) else np.float32(0)  # missing values have no error
        for column in range(2, width - 2):
            errors[row, column] = max(error[2 * column], error[2 * column + 1])
    return breaks, errors


@njit(cache=True)
def _interpolated_flow(values: Float32, wide: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the bilinear flow at (x, y) and the sum of its absolute slopes; NaN where a value is missing.

    Of a field whose lines of ``wide`` values follow one another. At a pixel its own value is returned, whatever its
    neighbours are.
    """
    column, row = int(x), int(y)
    right, below = x - column, y - row
    index = np.uint64(row * wide + 2 * column)  # unsigned: an index that may be negative costs a comparison
    under = index + np.uint64(wide)
    u, along_u, across_u = _between(
        values[index], values[index + np.uint64(2)], values[under], values[under + np.uint64(2)], right, below
    )
    v, along_v, across_v = _between(
        values[index + np.uint64(1)], values[index + np.uint64(3)], values[under + np.uint64(1)],
        values[under + np.uint64(3)], right, below,
    )  # fmt: skip
    return u, v, along_u + across_u + along_v + across_v


@njit(cache=True)
def _between(
    upper_left: np.float32,
    upper_right: np.float32,
    lower_left: np.float32,
    lower_right: np.float32,
    right: float,
    below: float,
) -> tuple[float, float, float]:
    """Return the value between four pixels and how much it changes along columns and rows, 0 where that is missing."""
    a, b = np.float64(upper_left), np.float64(upper_right)
    c, d = np.float64(lower_left), np.float64(lower_right)
    above = a + right * (b - a) if right > 0 else a
    under = c + right * (d - c) if right > 0 else c
    value = above + below * (under - above) if below > 0 else above
    along, across = abs(b - a), abs(under - above)
    return value, along if along < np.inf else 0.0, across if across < np.inf else 0.0


@njit(cache=True)
def _cell_px(height: int, width: int) -> int:
    """Return the side of the cells of a frame."""
    return _CELL_PX if height * width < _CELLS_DOUBLE else 2 * _CELL_PX


@njit(cache=True)
def spans_at_targets(lines: Float32) -> Float32:
    """Return the range of the flows that lead to each cell of the second frame and to the eight cells about it.

    Every fourth pixel of every fourth row is entered, in large frames every eighth.

    Parameters
    ----------
    lines
        (H, 2 W) u and v of one pixel after another, px.

    Returns
    -------
    ndarray of float32
        (h, w, 4) least u, -u, v and -v, px; infinite in cells to which no flow leads.
    """
    height, width = lines.shape[0], lines.shape[1] // 2
    cell_px = _cell_px(height, width)
    spans = np.full((height // cell_px + 1, width // cell_px + 1, 4), np.inf, np.float32)
    right, bottom, cells = np.float32(width), np.float32(height), np.float32(1 / cell_px)  # exact, a power of two
    for row in range(0, height, cell_px):
        line = lines[row]
        for column in range(0, width, cell_px):
            u, v = line[2 * column], line[2 * column + 1]
            x, y = np.float32(column) + u, np.float32(row) + v
            if 0 <= x < right and 0 <= y < bottom:  # so it is not where flow is NaN
                span = spans[np.uint64(y * cells), np.uint64(x * cells)]
                span[0] = u if u < span[0] else span[0]
                # Negated: the largest flow is then a least too, and one minimum over neighbours gives both ends.
                span[1] = -u if -u < span[1] else span[1]
                span[2] = v if v < span[2] else span[2]
                span[3] = -v if -v < span[3] else span[3]
    return _least_about(spans)


@njit(cache=True)
def _least_about(spans: Float32) -> Float32:
    """Return the least of each cell and the eight about it, (h, w, 4): along columns first, then along rows."""
    height, wide = len(spans), 4 * spans.shape[1]
    lines, least = spans.reshape(height, wide), np.empty((height, wide), np.float32)
    padded = np.full(wide + 8, np.inf, np.float32)
    for row in range(height):
        above, centre, below = lines[max(row - 1, 0)], lines[row], lines[min(row + 1, height - 1)]
        for i in range(wide):
            lower = centre[i] if centre[i] < below[i] else below[i]
            padded[i + 4] = above[i] if above[i] < lower else lower
        into, left, right = least[row], padded[:wide], padded[8:]
        for i in range(wide):
            lower = left[i] if left[i] < right[i] else right[i]
            into[i] = padded[i + 4] if padded[i + 4] < lower else lower
    return least.reshape(spans.shape)


@njit(cache=True)
def _is_crowded(spans: Float32, cell_px: int, x: float, y: float, u: float, v: float, slope: float) -> bool:
    """Whether points of another surface lead to the cells about (x, y), to which a point of flow (u, v) leads.

    Points of the same surface whose targets lie within two cells come from within two cells / (1 - slope), over which
    their flow changes by at most the slope times that.
    """
    # Bound of the docstring. 1 - slope is limited to 1/2, as it vanishes where a surface folds onto itself.
    apart = 2 * cell_px * slope / max(1.0 - slope, 0.5) + _CROWDED_PX
    span = spans[np.uint64(y) // np.uint64(cell_px), np.uint64(x) // np.uint64(cell_px)]
    return bool(span[0] < u - apart or -span[1] > u + apart or span[2] < v - apart or -span[3] > v + apart)


@njit(cache=True)
def medians_of_parts(values: Float64, starts: NDArray[np.int64]) -> Float64:
    """Return the median of each part of values (n,), of which part i is from ``starts[i]`` to the next; NaN of none."""
    medians = np.full(len(starts) - 1, np.nan)
    for i in range(len(medians)):
        if starts[i + 1] > starts[i]:
            medians[i] = median_of(values[starts[i] : starts[i + 1]])
    return medians
