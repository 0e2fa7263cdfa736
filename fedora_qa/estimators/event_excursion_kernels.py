"""Compiled loops that follow signal minus events of every pixel, and join what they found."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]


@njit(cache=True)
def bound_excursions(
    light: Float64,
    error: Float64,
    counts: Int32,
    dark: float,
    steps: tuple[int, int],
    drift: Int64,
    frames: Int64,
    uneven: tuple[float, float],
    units: float,
    total: Int64,
    highest: Int64,
    lowest: Int64,
) -> None:
    """Follow signal minus events of every pixel over the frames.

    The signal is the logarithm of ``light`` (n, h, w) and ``dark``, known to ``error`` (n, h, w), and counts ``units``
    times. ``counts`` (n - 1, 2, h, w) holds darker and brighter events between the frames, each a step of ``steps``,
    ``drift`` (n - 1,) what the signal gains besides, ``frames`` (n,) their numbers. ``total`` (h, w) receives what the
    events sum to; ``highest`` (2, h, w) the largest lower bound of the difference and its frame; ``lowest`` the
    smallest upper bound. Bounds that are not finite, or off by more than the first of ``uneven`` and the second times
    the light, tell nothing.

    While nothing is added to the events' sum, bounds are compared as they are: their logarithm is taken once.
    """
    height, width = light.shape[1:]
    low, high = np.empty(width), np.empty(width)
    low_frame, high_frame = np.empty(width, np.int64), np.empty(width, np.int64)
    for row in range(height):
        low[:], high[:] = 0.0, np.inf
        for frame in range(len(light)):
            for column in range(width):
                if frame > 0:
                    moved = (
                        counts[frame - 1, 1, row, column] * steps[1]
                        - counts[frame - 1, 0, row, column] * steps[0]
                        - drift[frame - 1]
                    )
                    if moved != 0:
                        _close(row, column, low, high, low_frame, high_frame, units, total, highest, lowest)
                        total[row, column] += moved
                        low[column], high[column] = 0.0, np.inf
                bright, off = light[frame, row, column] + dark, error[frame, row, column]
                if off < np.inf and bright > off and off < uneven[0] + uneven[1] * bright:
                    if bright - off > low[column]:
                        low[column], low_frame[column] = bright - off, frames[frame]
                    if bright + off < high[column]:
                        high[column], high_frame[column] = bright + off, frames[frame]
        for column in range(width):
            _close(row, column, low, high, low_frame, high_frame, units, total, highest, lowest)


@njit(cache=True)
def _close(
    row: int,
    column: int,
    low: Float64,
    high: Float64,
    low_frame: Int64,
    high_frame: Int64,
    units: float,
    total: Int64,
    highest: Int64,
    lowest: Int64,
) -> None:
    """Take the bounds of a run without events into those of the pixel."""
    if low[column] > 0.0:
        least = int(np.floor(np.log(low[column]) * units)) - total[row, column]
        most = int(np.ceil(np.log(high[column]) * units)) - total[row, column]
        if least > highest[0, row, column]:
            highest[0, row, column], highest[1, row, column] = least, low_frame[column]
        if most < lowest[0, row, column]:
            lowest[0, row, column], lowest[1, row, column] = most, high_frame[column]


@njit(cache=True)
def join_bounds(total: Int64, earlier: Int64, later: Int64, sign: int, joined: Int64) -> None:
    """Write the larger of earlier bounds and of later ones less ``total``, with its frame, (2, h, w).

    With ``sign`` -1 the smaller one. Of equal ones the earlier.
    """
    for row in range(total.shape[0]):
        for column in range(total.shape[1]):
            moved = later[0, row, column] - total[row, column]
            if sign * moved > sign * earlier[0, row, column]:
                joined[0, row, column], joined[1, row, column] = moved, later[1, row, column]
            else:
                joined[0, row, column], joined[1, row, column] = earlier[0, row, column], earlier[1, row, column]
