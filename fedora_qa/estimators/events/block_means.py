"""Means of the signal of frames and of sums of events over blocks of pixels, which reduce the effect of small shifts.

Blocks are squares. As many as fit lie in the middle of an image (h, w), so that mirroring maps their grid onto itself,
to half a pixel.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

BLOCK_PX: Final = 4
"""Side of the blocks whose means are compared, px."""

LEAST_LIGHT: Final = 1e-3
"""Least value whose logarithm is taken, DN; smaller values are replaced by it."""


def level_blocks(light: Float32, error: Float32, dark: float | None) -> Float64:
    """Return the means of the signal of a frame over blocks.

    The signal is ln(light + dark), or the light itself in the linear model. It is known where the light exceeds twice
    its error. The sum of logarithms is computed as the logarithm of the product, which needs one logarithm for each
    block.

    Parameters
    ----------
    light, error
        (h, w) light and the bound of its error, DN.
    dark
        Constant in the logarithm, DN; None for a sensor of the linear model.

    Returns
    -------
    Float64
        (r, c) rows and columns of blocks, in nat, or in DN without ``dark``. NaN where the signal of a pixel of the
        block is not known.
    """
    side, grid = block_grid(light.shape)
    blocks = np.empty(grid)
    if dark is None:
        add_blocks(light, error, side, blocks)
    else:
        multiply_blocks(light, error, dark, LEAST_LIGHT, side, blocks)
        np.log(blocks, out=blocks)
    blocks /= side**2
    return blocks


@dataclass(frozen=True, slots=True)
class EventBlocks:
    """Block means of the sums of events in the n - 1 intervals between frames, in the unit of the thresholds.

    Attributes
    ----------
    upright
        (n - 1, r, c) events at their coordinates.
    swapped
        (n - 1, r, c) events with x and y exchanged.
    """

    upright: Float64
    swapped: Float64


def event_blocks(counts: NDArray[np.int32], threshold_on: float, threshold_off: float) -> EventBlocks:
    """Return the block means of the sums of events between frames.

    Parameters
    ----------
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    threshold_on, threshold_off
        Change of the level by one brighter and by one darker event, both positive.

    Returns
    -------
    EventBlocks
        Of the n - 1 intervals, in the unit of the thresholds.
    """
    side, grid = block_grid(counts.shape[2:])
    upright, swapped = np.zeros((2, len(counts), *grid))
    for i in range(len(counts)):
        mean_event_blocks(counts[i], threshold_on, threshold_off, side, upright[i], swapped[i])
    return EventBlocks(upright, swapped)


class EventColumns(NamedTuple):
    """m events in the order of time.

    Attributes
    ----------
    x, y
        (m,) columns and rows as stored, px; they can lie outside of the sensor.
    times_ns
        (m,) timestamps, ns from the origin.
    p
        (m,) polarity: 1 brighter, 0 darker.
    """

    x: Int64
    y: Int64
    times_ns: Int64
    p: Int64


def add_events_beyond(
    blocks: EventBlocks,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    times_ns: NDArray[np.int64],
    p: NDArray[np.integer],
    frame_times_ns: NDArray[np.int64],
    shape: tuple[int, int],
    threshold_on: float,
    threshold_off: float,
) -> None:
    """Add events outside of the sensor to the blocks in which they lie when x and y are exchanged, in place.

    Parameters
    ----------
    blocks
        Its array ``swapped`` is added to.
    x, y, times_ns, p
        (m,) events in the order of time: columns and rows as stored, px; timestamps, ns; 1 brighter and 0 darker.
    frame_times_ns
        (n,) timestamps of the frames, ns.
    shape
        Rows and columns of the sensor.
    threshold_on, threshold_off
        Change of the level by one brighter and by one darker event, both positive.
    """
    steps, side = (-threshold_off, threshold_on), block_grid(shape)[0]
    events = EventColumns(*(column.astype(np.int64) for column in (x, y, times_ns, p)))
    mean_blocks_beyond(events, frame_times_ns, shape, steps, side, blocks.swapped)


def block_grid(shape: tuple[int, ...]) -> tuple[int, tuple[int, int]]:
    """Return the side of blocks, px, and the numbers of rows and columns of blocks that fit into an image (h, w)."""
    side = min(BLOCK_PX, *shape)
    return side, (shape[0] // side, shape[1] // side)


@njit(cache=True)
def add_blocks(light: Float32, error: Float32, side: int, sums: Float64) -> None:
    """Compute the sums of an image over blocks.

    Parameters
    ----------
    light, error
        (h, w) image and the bound of its error, in one unit.
    side
        Side of the blocks, px.
    sums
        (r, c) receives the sums; NaN where a pixel of the block does not exceed twice its error.
    """
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
    """Compute the products of max(light + dark, least) over blocks.

    Parameters
    ----------
    light, error
        (h, w) light and the bound of its error, DN.
    dark
        Constant that is added to the light, DN.
    least
        Least factor, DN.
    side
        Side of the blocks, px.
    products
        (r, c) receives the products; NaN where a pixel of the block does not exceed twice its error.
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
                # A product of 16 values of up to 1e3 is far below the largest double.
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
    """Add the mean steps of the events of an interval to blocks, with axes as they are and exchanged.

    With axes exchanged, a pixel of row y and column x lies in row x and column y.

    Parameters
    ----------
    counts
        (2, h, w) darker and brighter events.
    step_on, step_off
        Change of the level by one brighter and by one darker event, both positive.
    side
        Side of the blocks, px.
    upright, swapped
        (r, c) are added to: block means in the unit of the steps.
    """
    _, height, width = counts.shape
    rows, columns = upright.shape
    top, left = (height - rows * side) // 2, (width - columns * side) // 2
    brighter, darker = step_on / side**2, step_off / side**2
    # Sums over successive rows of pixels: for a row of blocks, and for a column of blocks with axes exchanged.
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
        # With axes exchanged, rows y are columns. The last row of the sensor can cut the last band, which is then added
        # as it is.
        if (y + 1 - left) % side == 0 or y + 1 == height:
            if 0 <= y - left < columns * side:
                blocks = swapped[:, (y - left) // side]
                whole = min((len(other_band) - top) // side, len(blocks))
                _add_line(other_band, top, side, blocks[:whole])
                for x in range(top + whole * side, min(len(other_band), top + len(blocks) * side)):
                    blocks[whole] += other_band[x]
            other_band[:] = 0.0


@njit(cache=True)
def _add_line(steps: Float64, first: int, side: int, blocks: Float64) -> None:
    """Add the steps of a line of pixels, from pixel ``first`` on, to successive blocks of ``side`` pixels."""
    x = np.uint64(first)
    for block in range(len(blocks)):
        for _ in range(side):
            blocks[block] += steps[x]
            x += np.uint64(1)


@njit(cache=True)
def mean_blocks_beyond(
    events: EventColumns,
    frame_times: Int64,
    shape: tuple[int, int],
    steps: tuple[float, float],
    side: int,
    swapped: Float64,
) -> None:
    """Add events outside of the sensor to the blocks in which they lie with axes exchanged.

    Parameters
    ----------
    events
        m events in the order of time.
    frame_times
        (n,) timestamps of the frames, ns. An event at the time of a frame belongs to the interval before it.
    shape
        Rows and columns of the sensor.
    steps
        Change of the level by a darker (negative) and by a brighter event.
    side
        Side of the blocks, px.
    swapped
        (n - 1, r, c) is added to: block means in the unit of the steps.
    """
    x, y, t, p = events
    (height, width), (rows, columns) = shape, swapped.shape[1:]
    top, left = (height - rows * side) // 2, (width - columns * side) // 2
    interval = -1
    for i in range(len(t)):
        while interval + 1 < len(frame_times) and frame_times[interval + 1] < t[i]:
            interval += 1
        if interval >= len(swapped):
            break
        on_sensor = 0 <= x[i] < width and 0 <= y[i] < height
        if interval >= 0 and not on_sensor and x[i] >= 0 and y[i] >= 0 and 0 <= p[i] <= 1:
            # With axes exchanged x is the row and y the column.
            down, right = x[i] - top, y[i] - left
            if 0 <= down < rows * side and 0 <= right < columns * side:
                swapped[interval, down // side, right // side] += steps[p[i]] / side**2
