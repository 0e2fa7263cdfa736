"""Compiled step of paths along a flow field: interpolation, a bound of its error, and a test for nearby breaks.

A field is given as lines (H, 2 W): u and v of one pixel after another. Only the pixels near the paths are evaluated, so
that the cost of a step does not depend on the size of the image. For many paths, `interpolation_errors` evaluates all
pixels once, and a step reads its result.
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
"""Distance, px, between the pixels whose targets are recorded, and side of the cells in which they are recorded."""

_CELLS_DOUBLE = 4 * 220_000
"""Number of pixels of a frame from which on cells are twice as wide. In angle they are then no wider than those of
540x405, which separate the surfaces, and recording the targets takes a quarter of the time."""

_OF_SECOND_DIFFERENCE = np.float32(0.25)
"""Twice the error of bilinear interpolation, an eighth of the second differences (Lagrange's remainder)."""

_OF_THIRD_DIFFERENCE = np.float32(0.5)
"""Factor on third differences. At the border of two surfaces flow changes by s from one pixel to the next.

Interpolation across that step errs by up to s. The second difference is s before the step and -s behind it, so that the
third difference is 2 s; where flow is smooth it vanishes.
"""

_CROWDED_PX = 0.5
"""Flows that lead to one position and differ by more belong to different surfaces, if flow has no gradient there."""

_REACH = 5
"""Reach, px, of the pixels that decide whether a path is 4 px away from breaks: a break extends over three pixels."""

_BREAK = np.float32(BREAK_PX)


class PathStates(NamedTuple):
    """States of n paths along fields.

    Attributes
    ----------
    x, y
        (n,) column and row, px.
    bound_px
        (n,) bound of the error of the position, px.
    clear
        (n,) whether flow is finite along the path, and no break and no other surface is near it.
    stays
        (n,) whether the path lies within the image.
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
    """Move paths along a field, in place.

    Parameters
    ----------
    lines
        (H, 2 W) the field: u and v of one pixel after another, px.
    spans
        (h, w, 4) of `spans_at_targets`: paths to a position to which another surface leads too are not clear. Empty:
        not tested.
    errors_px
        (H, W) of `interpolation_errors`, px. Empty: the pixels about each path are evaluated.
    rounding_px
        Rounding of single precision, which is added to the bound, px.
    first
        Paths are at pixels, so that nothing is interpolated.
    guarded
        Whether paths must keep away from breaks.
    paths
        Changed in place: positions, bounds, and whether the paths are still clear and stay.
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
        stays[i] = 0 <= x[i] < width - 1 and 0 <= y[i] < height - 1  # False where flow is infinite
        clear[i] = clear[i] and stays[i]
        if clear[i] and len(spans):
            clear[i] = not _is_crowded(spans, cell_px, x[i], y[i], u, v, slope)


@njit(cache=True)
def _keeps_clear(lines: Float32, row: int, column: int) -> bool:
    """Return whether no break of the flow, no missing value and no border lies within 4 px of a pixel."""
    height, width = lines.shape[0], lines.shape[1] // 2
    if not (_REACH <= row < height - _REACH and _REACH <= column < width - _REACH):
        return False
    # Unsigned indices from 0 on: an index that may be negative costs a comparison.
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
            breaks |= np.int32(not abs(bend) <= _BREAK)  # also 1 next to a missing value
        if breaks:
            return False
        index += wide
    return True


@njit(cache=True, fastmath={"nnan", "nsz"})
def _interpolation_error(lines: Float32, row: int, column: int) -> float:
    """Return a bound, px, of the error of interpolating one component within 1 px of a pixel far from breaks."""
    values, wide = lines.reshape(-1), np.uint64(lines.shape[1])
    index, largest = np.uint64((row - 1) * lines.shape[1] + 2 * (column - 3)), np.float32(0)
    for _ in range(3):
        highest, above, centre = values[index - wide - wide :], values[index - wide :], values[index:]
        below, lowest = values[index + wide :], values[index + wide + wide :]
        for i in range(6):
            two = np.float32(2)
            # second differences across and down, then those of the neighbours; their differences are third differences
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
    """Return a bound of the error of interpolating a field within 1 px of each of its pixels.

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
    """Return where a field breaks (H, W), 1 there, and the larger interpolation error (H, W), px, of u and v."""
    height, width = lines.shape[0], lines.shape[1] // 2
    breaks, errors = np.ones((height, width), np.uint8), np.zeros((height, width), np.float32)
    bent, error = np.ones(2 * width, np.uint8), np.zeros(2 * width, np.float32)
    for row in range(1, height - 1):
        above, centre, below = lines[row - 1], lines[row], lines[row + 1]
        for i in range(2, 2 * width - 2):
            bend = above[i] + below[i] + centre[i - 2] + centre[i + 2] - np.float32(4) * centre[i]
            bent[i] = not abs(bend) <= _BREAK  # also 1 next to a missing value
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
    """Return the bilinear flow at (x, y), px, and the sum of its absolute slopes; NaN where a value is missing.

    ``values`` are the lines of the field, of ``wide`` values each, one after the other. At a pixel its own value is
    returned, for any values of its neighbours.
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
    """Return the value between four pixels and its changes along columns and rows.

    A change is 0 where a value is missing.
    """
    a, b = np.float64(upper_left), np.float64(upper_right)
    c, d = np.float64(lower_left), np.float64(lower_right)
    above = a + right * (b - a) if right > 0 else a
    under = c + right * (d - c) if right > 0 else c
    value = above + below * (under - above) if below > 0 else above
    along, across = abs(b - a), abs(under - above)
    return value, along if along < np.inf else 0.0, across if across < np.inf else 0.0


@njit(cache=True)
def _cell_px(height: int, width: int) -> int:
    """Return the side, px, of the cells of a frame."""
    return _CELL_PX if height * width < _CELLS_DOUBLE else 2 * _CELL_PX


@njit(cache=True)
def spans_at_targets(lines: Float32) -> Float32:
    """Return the range of the flows that lead to each cell of the second frame and to the eight cells around it.

    Every fourth pixel of every fourth row is recorded, in large frames every eighth.

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
            if 0 <= x < right and 0 <= y < bottom:  # False where flow is NaN
                span = spans[np.uint64(y * cells), np.uint64(x * cells)]
                span[0] = u if u < span[0] else span[0]
                # Negated: the largest flow is then a minimum too, and one minimum over neighbours gives both ends.
                span[1] = -u if -u < span[1] else span[1]
                span[2] = v if v < span[2] else span[2]
                span[3] = -v if -v < span[3] else span[3]
    return _least_about(spans)


@njit(cache=True)
def _least_about(spans: Float32) -> Float32:
    """Return the minimum (h, w, 4) of each cell and the eight around it: along columns first, then along rows."""
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
    """Return whether points of another surface lead to the cells about (x, y), to which a point of flow (u, v) leads.

    Points of one surface whose targets lie within two cells start within two cells / (1 - slope). Over that distance
    their flow changes by at most the slope times the distance.
    """
    # 2 cells slope / (1 - slope). 1 - slope is at least 1/2 here, as it vanishes where a surface folds onto itself.
    apart = 2 * cell_px * slope / max(1.0 - slope, 0.5) + _CROWDED_PX
    span = spans[np.uint64(y) // np.uint64(cell_px), np.uint64(x) // np.uint64(cell_px)]
    return bool(span[0] < u - apart or -span[1] > u + apart or span[2] < v - apart or -span[3] > v + apart)


@njit(cache=True)
def medians_of_parts(values: Float64, starts: NDArray[np.int64]) -> Float64:
    """Return the median of each part of an array.

    Parameters
    ----------
    values
        (n,) of any unit.
    starts
        (k + 1,) ascending: part i is ``values[starts[i] : starts[i + 1]]``.

    Returns
    -------
    ndarray of float64
        (k,); NaN for an empty part.
    """
    medians = np.full(len(starts) - 1, np.nan)
    for i in range(len(medians)):
        if starts[i + 1] > starts[i]:
            medians[i] = median_of(values[starts[i] : starts[i + 1]])
    return medians
