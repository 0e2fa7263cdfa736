"""Compiled step of paths along a field of flow: read it between pixels, bound the error of that, see what lies about.

Fields come as lines (H, 2 W): u and v of one pixel after another. Only what lies about the paths is looked at, so that
a step costs what its paths cost, however large the image is. Where paths are many, `errors_of_reading` looks at
everything once, and a step reads what it found.
"""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.flow_mask import BREAK_PX, widened
from fedora_qa.estimators.order_kernels import median_of

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

CELL_PX = 4
"""Step between the pixels whose targets are noted, and side of the cells that they are noted in."""

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
    known = len(errors_px) > 0
    for i in range(len(x)):
        stays[i] = stays[i] and 0 <= x[i] < width - 1 and 0 <= y[i] < height - 1
        if not stays[i]:
            clear[i] = False
            continue
        column, row = int(np.rint(x[i])), int(np.rint(y[i]))
        if guarded and clear[i]:
            clear[i] = errors_px[row, column] < np.inf if known else _keeps_clear(lines, row, column)
        u, v, slope = _read(lines, x[i], y[i])
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
            clear[i] = not _is_crowded(spans, x[i], y[i], u, v, slope)


@njit(cache=True)
def _keeps_clear(lines: Float32, row: int, column: int) -> bool:
    """Whether no break of the flow, no missing value and no border lies within 4 px of a pixel."""
    height, width = lines.shape[0], lines.shape[1] // 2
    if not (_REACH <= row < height - _REACH and _REACH <= column < width - _REACH):
        return False
    first, stop = 2 * (column - _REACH), 2 * (column + _REACH + 1)
    for j in range(row - _REACH + 1, row + _REACH):
        above, here, below = lines[j - 1][first:stop], lines[j][first:stop], lines[j + 1][first:stop]
        breaks = np.int32(0)
        for i in range(2, 20):
            bend = above[i] + below[i] + here[i - 2] + here[i + 2] - np.float32(4) * here[i]
            breaks |= np.int32(not abs(bend) <= _BREAK)  # so it is, too, beside a missing value
        if breaks:
            return False
    return True


@njit(cache=True, fastmath={"nnan", "nsz"})
def _reading_error(lines: Float32, row: int, column: int) -> float:
    """Return how far reading one component between pixels may err within a pixel of one that keeps clear."""
    first, stop = 2 * (column - 3), 2 * (column + 4)
    largest = np.float32(0)
    for j in range(row - 1, row + 2):
        highest, above, here = lines[j - 2][first:stop], lines[j - 1][first:stop], lines[j][first:stop]
        below, lowest = lines[j + 1][first:stop], lines[j + 2][first:stop]
        for i in range(4, 10):
            across, down = (
                here[i - 2] - np.float32(2) * here[i] + here[i + 2],
                above[i] - np.float32(2) * here[i] + below[i],
            )
            left, right = (
                here[i - 4] - np.float32(2) * here[i - 2] + here[i],
                here[i] - np.float32(2) * here[i + 2] + here[i + 4],
            )
            upper, lower = (
                highest[i] - np.float32(2) * above[i] + here[i],
                here[i] - np.float32(2) * below[i] + lowest[i],
            )
            steps = abs(across - left) + abs(right - across) + abs(down - upper) + abs(lower - down)
            error = _OF_SECOND_DIFFERENCE * (abs(across) + abs(down)) + _OF_THIRD_DIFFERENCE * steps
            largest = error if error > largest else largest
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
def _read(lines: Float32, x: float, y: float) -> tuple[float, float, float]:
    """Return the bilinear flow at a place and the sum of its absolute slopes; NaN where what it rests on is missing.

    A pixel is read as it stands, whatever lies beside it.
    """
    column, row = int(x), int(y)
    right, below = x - column, y - row
    at, slope = 2 * column, 0.0
    u = v = 0.0
    for k in range(2):
        a, b = np.float64(lines[row, at + k]), np.float64(lines[row, at + k + 2])
        c, d = np.float64(lines[row + 1, at + k]), np.float64(lines[row + 1, at + k + 2])
        above = a + right * (b - a) if right > 0 else a
        under = c + right * (d - c) if right > 0 else c
        value = above + below * (under - above) if below > 0 else above
        if k == 0:
            u = value
        else:
            v = value
        along, across = abs(b - a), abs(under - above)
        slope += (along if np.isfinite(along) else 0.0) + (across if np.isfinite(across) else 0.0)
    return u, v, slope


@njit(cache=True)
def spans_at_targets(lines: Float32) -> Float32:
    """Return the least and the largest flow (h, w, 4) that lead to each cell: u from, -u to, v from, -v to.

    Of every fourth pixel of every fourth row; all are infinite in cells to which none leads.
    """
    height, width = lines.shape[0], lines.shape[1] // 2
    spans = np.full((height // CELL_PX + 1, width // CELL_PX + 1, 4), np.inf, np.float32)
    right, bottom = np.float32(width), np.float32(height)
    for row in range(0, height, CELL_PX):
        line = lines[row]
        for column in range(0, width, CELL_PX):
            u, v = line[2 * column], line[2 * column + 1]
            x, y = np.float32(column) + u, np.float32(row) + v
            if 0 <= x < right and 0 <= y < bottom:  # so it is not where flow is NaN
                span = spans[np.uint64(y) // np.uint64(CELL_PX), np.uint64(x) // np.uint64(CELL_PX)]
                span[0] = u if u < span[0] else span[0]
                span[1] = -u if -u < span[1] else span[1]
                span[2] = v if v < span[2] else span[2]
                span[3] = -v if -v < span[3] else span[3]
    return spans


@njit(cache=True)
def _is_crowded(spans: Float32, x: float, y: float, u: float, v: float, slope: float) -> bool:
    """Whether points of another surface lead to the cells about a place to which one of flow (u, v) leads.

    Points of the same surface whose targets lie within two cells come from within two cells / (1 - slope), over which
    their flow changes by at most the slope times that.
    """
    apart = 2 * CELL_PX * slope / max(1.0 - slope, 0.5) + _CROWDED_PX
    at_row, at_column = int(y) // CELL_PX, int(x) // CELL_PX
    for row in range(max(at_row - 1, 0), min(at_row + 2, spans.shape[0])):
        for column in range(max(at_column - 1, 0), min(at_column + 2, spans.shape[1])):
            span = spans[row, column]
            if span[0] < u - apart or -span[1] > u + apart or span[2] < v - apart or -span[3] > v + apart:
                return True
    return False


@njit(cache=True)
def medians_of_parts(values: Float64, starts: NDArray[np.int64]) -> Float64:
    """Return the median of each part of values (n,), of which part i is from ``starts[i]`` to the next; NaN of none."""
    medians = np.full(len(starts) - 1, np.nan)
    for i in range(len(medians)):
        if starts[i + 1] > starts[i]:
            medians[i] = median_of(values[starts[i] : starts[i + 1]])
    return medians
