"""Compiled step of paths along a field of flow: read it between pixels, bound the error of that, see what lies about.

Fields come as lines (H, 2 W): u and v of one pixel after another. Only what lies about the paths is looked at, so that
a step costs what its paths cost, however large the image is. Where paths are many, `errors_of_reading` looks at
everything once, and a step reads what it found.
"""

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
"""Step between the pixels whose targets are noted, and side of the cells that they are noted in."""

_CELLS_DOUBLE = 4 * 220_000
"""Pixels of a frame from which on cells are twice as wide: in the view they are no wider than those of 540x405, which
tell its surfaces apart, and to note the targets takes a quarter of the time."""

_OF_SECOND_DIFFERENCE = np.float32(0.25)
"""Twice the error of bilinear reading, which is an eighth of the second differences (Lagrange's remainder)."""

_OF_THIRD_DIFFERENCE = np.float32(0.5)
"""Where two surfaces meet, flow steps by s from one pixel to the next, and what is read between them errs by up to s.

The second difference is s before the step and -s behind it, the third 2 s; where flow is smooth it vanishes.
"""

_CROWDED_PX = 0.5
"""Flows that lead to one place and differ by more belong to different surfaces, where flow does not slope."""

_REACH = 5
"""Pixels about a path's that tell whether it keeps 4 px away from breaks: those themselves bend over three pixels."""

_BREAK = np.float32(BREAK_PX)


@njit(cache=True)
def step(
    lines: Float32,
    spans: Float32,
    errors_px: Float32,
    rounding_px: float,
    first: bool,
    guarded: bool,
    x: Float64,
    y: Float64,
    bound_px: Float64,
    clear: Mask,
    stays: Mask,
) -> None:
    """Move paths (n,) along a field, in place: positions, bounds, and whether they are still clear and stay.

    Parameters
    ----------
    spans
        Of `spans_at_targets`: paths that end where another surface does are not clear. Empty: nothing is asked.
    errors_px
        Of `errors_of_reading`. Empty: what lies about each path is looked at.
    rounding_px
        What single precision adds to the bound.
    first
        Paths are at pixels: nothing is read between any.
    guarded
        Whether paths must keep away from breaks.
    """
    height, width = lines.shape[0], lines.shape[1] // 2
    known, values, cell_px = len(errors_px) > 0, lines.reshape(-1), _cell_px(height, width)
    for i in range(len(x)):
        stays[i] = stays[i] and 0 <= x[i] < width - 1 and 0 <= y[i] < height - 1
        if not stays[i]:
            clear[i] = False
            continue
        column, row = int(np.rint(x[i])), int(np.rint(y[i]))
        if guarded and clear[i]:
            clear[i] = errors_px[row, column] < np.inf if known else _keeps_clear(lines, row, column)
        u, v, slope = _read(values, 2 * width, x[i], y[i])
        if np.isnan(u) or np.isnan(v):
            clear[i] = False
            continue
        if not first:
            bound_px[i] *= 1.0 + slope
            if clear[i]:
                bound_px[i] += errors_px[row, column] if known else _reading_error(lines, row, column)
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
    # Unsigned places and indices from 0 on: where one may be negative, each costs a comparison.
    values, wide, most = lines.reshape(-1), np.uint64(2 * width), np.uint64(22)
    at = np.uint64((row - _REACH + 1) * 2 * width + 2 * (column - _REACH))
    for _ in range(2 * _REACH - 1):
        above, here, below = values[at - wide : at - wide + most], values[at : at + most], values[at + wide :]
        breaks = np.int32(0)
        for i in range(18):
            bend = above[i + 2] + below[i + 2] + here[i] + here[i + 4] - np.float32(4) * here[i + 2]
            breaks |= np.int32(not abs(bend) <= _BREAK)  # so it is, too, beside a missing value
        if breaks:
            return False
        at += wide
    return True


@njit(cache=True, fastmath={"nnan", "nsz"})
def _reading_error(lines: Float32, row: int, column: int) -> float:
    """Return how far reading one component between pixels may err within a pixel of one that keeps clear."""
    values, wide = lines.reshape(-1), np.uint64(lines.shape[1])
    at, largest = np.uint64((row - 1) * lines.shape[1] + 2 * (column - 3)), np.float32(0)
    for _ in range(3):
        highest, above, here = values[at - wide - wide :], values[at - wide :], values[at:]
        below, lowest = values[at + wide :], values[at + wide + wide :]
        for i in range(6):
            two = np.float32(2)
            across = here[i + 2] - two * here[i + 4] + here[i + 6]
            down = above[i + 4] - two * here[i + 4] + below[i + 4]
            left = here[i] - two * here[i + 2] + here[i + 4]
            right = here[i + 4] - two * here[i + 6] + here[i + 8]
            upper = highest[i + 4] - two * above[i + 4] + here[i + 4]
            lower = here[i + 4] - two * below[i + 4] + lowest[i + 4]
            steps = abs(across - left) + abs(right - across) + abs(down - upper) + abs(lower - down)
            error = _OF_SECOND_DIFFERENCE * (abs(across) + abs(down)) + _OF_THIRD_DIFFERENCE * steps
            largest = error if error > largest else largest
        at += wide
    return float(largest)


def errors_of_reading(lines: Float32) -> Float32:
    """Return how far reading a field between pixels may err (H, W), px, within a pixel of each.

    Infinite where that does not keep 4 px away from breaks of the flow, missing values and the border.
    """
    breaks, errors = _breaks_and_errors(lines)
    largest = np.asarray(cv2.dilate(errors, np.ones((3, 3), np.uint8)), dtype=np.float32)
    largest[widened(breaks) > 0] = np.inf
    return largest


@njit(cache=True)
def _breaks_and_errors(lines: Float32) -> tuple[NDArray[np.uint8], Float32]:
    """Return where a field breaks (H, W), and the error of reading at each pixel, by the larger of its components."""
    height, width = lines.shape[0], lines.shape[1] // 2
    breaks, errors = np.ones((height, width), np.uint8), np.zeros((height, width), np.float32)
    bent, error = np.ones(2 * width, np.uint8), np.zeros(2 * width, np.float32)
    for row in range(1, height - 1):
        above, here, below = lines[row - 1], lines[row], lines[row + 1]
        for i in range(2, 2 * width - 2):
            bend = above[i] + below[i] + here[i - 2] + here[i + 2] - np.float32(4) * here[i]
            bent[i] = not abs(bend) <= _BREAK  # so it is, too, beside a missing value
        for column in range(1, width - 1):
            breaks[row, column] = bent[2 * column] | bent[2 * column + 1]
        if not 2 <= row < height - 2:
            continue
        highest, lowest = lines[row - 2], lines[row + 2]
        for i in range(4, 2 * width - 4):
            across = here[i - 2] - np.float32(2) * here[i] + here[i + 2]
            down = above[i] - np.float32(2) * here[i] + below[i]
            left = here[i - 4] - np.float32(2) * here[i - 2] + here[i]
            right = here[i] - np.float32(2) * here[i + 2] + here[i + 4]
            upper = highest[i] - np.float32(2) * above[i] + here[i]
            lower = here[i] - np.float32(2) * below[i] + lowest[i]
            steps = abs(across - left) + abs(right - across) + abs(down - upper) + abs(lower - down)
            found = _OF_SECOND_DIFFERENCE * (abs(across) + abs(down)) + _OF_THIRD_DIFFERENCE * steps
            error[i] = found if found < np.float32(np.inf) else np.float32(0)  # of what is missing there is none
        for column in range(2, width - 2):
            errors[row, column] = max(error[2 * column], error[2 * column + 1])
    return breaks, errors


@njit(cache=True)
def _read(values: Float32, wide: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the bilinear flow at a place and the sum of its absolute slopes; NaN where what it rests on is missing.

    Of a field whose lines of so many values follow one another. A pixel is read as it stands, whatever lies beside it.
    """
    column, row = int(x), int(y)
    right, below = x - column, y - row
    at = np.uint64(row * wide + 2 * column)  # unsigned: an index that may be negative costs a comparison
    under = at + np.uint64(wide)
    u, along_u, across_u = _between(
        values[at], values[at + np.uint64(2)], values[under], values[under + np.uint64(2)], right, below
    )
    v, along_v, across_v = _between(
        values[at + np.uint64(1)], values[at + np.uint64(3)], values[under + np.uint64(1)],
        values[under + np.uint64(3)], right, below,
    )  # fmt: skip
    return u, v, along_u + across_u + along_v + across_v


@njit(cache=True)
def _between(
    left: np.float32, other: np.float32, lower: np.float32, opposite: np.float32, right: float, below: float
) -> tuple[float, float, float]:
    """Return the value between four pixels and how much it changes along columns and rows, 0 where that is missing."""
    a, b, c, d = np.float64(left), np.float64(other), np.float64(lower), np.float64(opposite)
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
    """Return the least and the largest flow (h, w, 4) that lead to each cell and those about it: u, -u, v, -v at least.

    Of every fourth pixel of every fourth row, or in large frames every eighth; all are infinite in cells to which none
    leads.
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
                span[1] = -u if -u < span[1] else span[1]
                span[2] = v if v < span[2] else span[2]
                span[3] = -v if -v < span[3] else span[3]
    return _least_about(spans)


@njit(cache=True)
def _least_about(spans: Float32) -> Float32:
    """Return the least of each cell and the eight about it, (h, w, 4)."""
    height, wide = len(spans), 4 * spans.shape[1]
    lines, least = spans.reshape(height, wide), np.empty((height, wide), np.float32)
    padded = np.full(wide + 8, np.inf, np.float32)
    for row in range(height):
        above, here, below = lines[max(row - 1, 0)], lines[row], lines[min(row + 1, height - 1)]
        for i in range(wide):
            lower = here[i] if here[i] < below[i] else below[i]
            padded[i + 4] = above[i] if above[i] < lower else lower
        into, left, right = least[row], padded[:wide], padded[8:]
        for i in range(wide):
            lower = left[i] if left[i] < right[i] else right[i]
            into[i] = padded[i + 4] if padded[i + 4] < lower else lower
    return least.reshape(spans.shape)


@njit(cache=True)
def _is_crowded(spans: Float32, cell_px: int, x: float, y: float, u: float, v: float, slope: float) -> bool:
    """Whether points of another surface lead to the cells about a place to which one of flow (u, v) leads.

    Points of the same surface whose targets lie within two cells come from within two cells / (1 - slope), over which
    their flow changes by at most the slope times that.
    """
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
