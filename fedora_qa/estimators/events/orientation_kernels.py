"""Compiled loops over blocks of pixels: sums and products of frames, sums of events, and their moments.

Blocks are squares of a side; as many as fit lie in the middle of an image (h, w), so that mirroring maps their grid
onto itself (to half a pixel).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]


@njit(cache=True)
def add_blocks(light: Float32, error: Float32, side: int, sums: Float64) -> None:
    """Write the sums (r, c) of an image (h, w) over blocks; NaN where it is not all above twice its error."""
    rows, columns = sums.shape
    top, left = (light.shape[0] - rows * side) // 2, (light.shape[1] - columns * side) // 2
    line = np.empty(columns * side)
    for row in range(rows):
        line[:] = 0.0
        for y in range(top + row * side, top + (row + 1) * side):
            values, errors = light[y, left : left + len(line)], error[y, left : left + len(line)]
            for x in range(len(line)):
                line[x] += np.float64(values[x]) if values[x] > 2 * errors[x] else np.nan
        sums[row] = 0.0
        _add_line(line, 0, side, sums[row])


@njit(cache=True)
def multiply_blocks(light: Float32, error: Float32, dark: float, least: float, side: int, products: Float64) -> None:
    """Write the products (r, c) over blocks of an image (h, w) and ``dark``, ``least`` at least.

    NaN where the image is not all above twice its error.
    """
    rows, columns = products.shape
    top, left = (light.shape[0] - rows * side) // 2, (light.shape[1] - columns * side) // 2
    line = np.empty(columns * side)
    for row in range(rows):
        line[:] = 1.0
        for y in range(top + row * side, top + (row + 1) * side):
            values, errors = light[y, left : left + len(line)], error[y, left : left + len(line)]
            for x in range(len(line)):
                value = max(values[x] + dark, least)
                line[x] *= value if values[x] > 2 * errors[x] else np.nan
        for column in range(columns):
            product = 1.0
            for x in range(column * side, (column + 1) * side):
                product *= line[np.uint64(x)]
            products[row, column] = product


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
    brighter, darker = step_on / side**2, step_off / side**2
    # Steps of successive rows: of a row of blocks as they lie, and of a column of blocks once axes are exchanged.
    band, other_band = np.zeros(width), np.zeros(width)
    for y in range(height):
        off, on = counts[0, y], counts[1, y]
        for x in range(width):
            step = brighter * on[x] - darker * off[x]
            band[x] += step
            other_band[x] += step
        if (y + 1 - top) % side == 0:
            if 0 <= y - top < rows * side:
                _add_line(band, left, side, upright[(y - top) // side])
            band[:] = 0.0
        if (y + 1 - left) % side == 0 or y + 1 == height:
            if 0 <= y - left < columns * side:
                _add_column(other_band, top, side, swapped[:, (y - left) // side])
            other_band[:] = 0.0


@njit(cache=True)
def _add_column(steps: Float64, first: int, side: int, blocks: Float64) -> None:
    """Add the steps of a line of pixels to successive blocks as far as it reaches: the last may be cut."""
    whole = min((len(steps) - first) // side, len(blocks))
    _add_line(steps, first, side, blocks[:whole])
    for x in range(first + whole * side, min(len(steps), first + len(blocks) * side)):
        blocks[whole] += steps[x]


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
def add_moments(change: Float64, upright: Float64, swapped: Float64, tiles: int, sums: Float64) -> None:
    """Add moments of frame change d and event change e to ``sums`` (tiles^2, 8, 6): 1, d, e, d d, e e, d e.

    Blocks whose change is NaN are left out. Events are taken under the eight symmetries of ``event_orientation``: axes
    exchanged, then columns mirrored, then rows. Tiles are those of the blocks, rows first.
    """
    rows, columns = change.shape
    # A row of changes and its mirror image: that of the events' columns is the same thing.
    known, changes, of_changes = np.empty((2, columns)), np.empty((2, columns)), np.empty(3)
    for row in range(rows):
        for column in range(columns):
            there = not np.isnan(change[row, column])
            known[0, column] = known[1, columns - 1 - column] = 1.0 if there else 0.0
            changes[0, column] = changes[1, columns - 1 - column] = change[row, column] if there else 0.0
        for tile in range(tiles):
            # Columns of which ``column * tiles // columns`` is the tile.
            first, stop = -(-tile * columns // tiles), -(-(tile + 1) * columns // tiles)
            of_tile = sums[tiles * (row * tiles // rows) + tile]
            _sum_changes(known[0, first:stop], changes[0, first:stop], of_changes)
            for symmetry in range(8):
                line = (swapped if symmetry & 4 else upright)[rows - 1 - row if symmetry & 1 else row]
                mirrored = (symmetry >> 1) & 1
                begin, end = (columns - stop, columns - first) if mirrored else (first, stop)
                own = of_tile[symmetry]
                own[0], own[1], own[3] = own[0] + of_changes[0], own[1] + of_changes[1], own[3] + of_changes[2]
                _add_products(known[mirrored, begin:end], changes[mirrored, begin:end], line[begin:end], own)


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sum_changes(known: Float64, changes: Float64, sums: Float64) -> None:
    """Write the number of changes, their sum and that of their squares: alike under all symmetries."""
    n, d, dd = 0.0, 0.0, 0.0
    for i in range(len(known)):
        n += known[i]
        d += changes[i]
        dd += changes[i] * changes[i]
    sums[0], sums[1], sums[2] = n, d, dd


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_products(known: Float64, changes: Float64, events: Float64, sums: Float64) -> None:
    """Add the sums of events, of their squares, and of their products with the changes."""
    e, ee, de = 0.0, 0.0, 0.0
    for i in range(len(known)):
        event = known[i] * events[i]
        e += event
        ee += event * event
        de += changes[i] * event
    sums[2] += e
    sums[4] += ee
    sums[5] += de
