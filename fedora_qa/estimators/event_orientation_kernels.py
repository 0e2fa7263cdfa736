"""Compiled loops over blocks of pixels: means of frames, sums of events, and their moments.

Blocks are squares of a side; as many as fit lie in the middle of an image (h, w), so that mirroring maps their grid
onto itself (to half a pixel).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]


@njit(cache=True)
def mean_blocks(image: NDArray[np.float32], known: Bool, side: int, means: Float64, whole: Bool) -> None:
    """Write the means (r, c) of an image over blocks, and whether all their pixels are ``known`` (h, w)."""
    rows, columns = means.shape
    top, left = (image.shape[0] - rows * side) // 2, (image.shape[1] - columns * side) // 2
    for row in range(rows):
        for column in range(columns):
            total, there = 0.0, True
            for y in range(top + row * side, top + (row + 1) * side):
                for x in range(left + column * side, left + (column + 1) * side):
                    total += image[y, x]
                    there &= known[y, x]
            means[row, column], whole[row, column] = total / side**2, there


@njit(cache=True)
def mean_event_blocks(
    counts: Int32, step_on: float, step_off: float, side: int, upright: Float64, swapped: Float64
) -> None:
    """Add the mean steps of darker and brighter events (2, h, w) to blocks (r, c): as they lie, and exchanged.

    A pixel of row y and column x lies in row x and column y once axes are exchanged.
    """
    _, height, width = counts.shape
    rows, columns = upright.shape
    top, left = (height - rows * side) // 2, (width - columns * side) // 2
    exchanged = min((width - top) // side, rows)
    steps = np.empty(width)
    for y in range(height):
        off, on = counts[0, y], counts[1, y]
        for x in range(width):
            steps[x] = (step_on * on[x] - step_off * off[x]) / side**2
        if 0 <= y - top < rows * side:
            _add_line(steps, left, side, upright[(y - top) // side])
        if 0 <= y - left < columns * side:
            column = swapped[:, (y - left) // side]
            _add_line(steps, top, side, column[:exchanged])
            for x in range(top + exchanged * side, min(width, top + rows * side)):
                column[exchanged] += steps[x]


@njit(cache=True)
def _add_line(steps: Float64, first: int, side: int, blocks: Float64) -> None:
    """Add the steps of a line of pixels to successive blocks."""
    x = np.uint64(first)
    for block in range(len(blocks)):
        for _ in range(side):
            blocks[block] += steps[x]
            x += np.uint64(1)


@njit(cache=True)
def mean_blocks_beyond(
    x: Int64,
    y: Int64,
    t: Int64,
    p: Int64,
    frame_times: Int64,
    shape: tuple[int, int],
    steps: tuple[float, float],
    side: int,
    swapped: Float64,
) -> None:
    """Add events beyond the sensor to blocks (n - 1, r, c) on which they lie with axes exchanged.

    ``steps`` are those of a darker and a brighter event.
    """
    interval = -1
    for i in range(len(t)):
        while interval + 1 < len(frame_times) and frame_times[interval + 1] < t[i]:
            interval += 1
        if interval >= len(swapped):
            break
        on_sensor = 0 <= x[i] < shape[1] and 0 <= y[i] < shape[0]
        if interval >= 0 and not on_sensor and x[i] >= 0 and y[i] >= 0 and 0 <= p[i] <= 1:
            _add(x[i], y[i], shape[0], shape[1], side, steps[p[i]] / side**2, swapped[interval])


@njit(cache=True)
def _add(row: int, column: int, height: int, width: int, side: int, value: float, blocks: Float64) -> None:
    rows, columns = blocks.shape
    down, right = row - (height - rows * side) // 2, column - (width - columns * side) // 2
    if 0 <= down < rows * side and 0 <= right < columns * side:
        blocks[down // side, right // side] += value


@njit(cache=True)
def add_moments(change: Float64, whole: Bool, upright: Float64, swapped: Float64, tiles: int, sums: Float64) -> None:
    """Add moments of frame change d and event change e to ``sums`` (tiles^2, 8, 6): 1, d, e, d d, e e, d e.

    Events are taken under the eight symmetries of ``event_orientation``: axes exchanged, then columns mirrored, then
    rows. Tiles are those of the blocks, rows first.
    """
    rows, columns = change.shape
    for row in range(rows):
        for column in range(columns):
            if not whole[row, column]:
                continue
            tile = tiles * (row * tiles // rows) + column * tiles // columns
            d = change[row, column]
            for symmetry in range(8):
                events = swapped if symmetry & 4 else upright
                e = events[rows - 1 - row if symmetry & 1 else row, columns - 1 - column if symmetry & 2 else column]
                sums[tile, symmetry, 0] += 1.0
                sums[tile, symmetry, 1] += d
                sums[tile, symmetry, 2] += e
                sums[tile, symmetry, 3] += d * d
                sums[tile, symmetry, 4] += e * e
                sums[tile, symmetry, 5] += d * e
