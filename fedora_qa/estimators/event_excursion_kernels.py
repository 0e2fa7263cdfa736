"""Compiled loops that follow signal minus events of every pixel, and join what they found."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]


FARTHEST = 1 << 61


@njit(cache=True)
def bound_excursions(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    counts: Int32,
    dark: float,
    steps: tuple[int, int],
    drift: Int64,
    frames: Int64,
    uneven: Float64,
    units: float,
    total: Int64,
    highest: Int64,
    lowest: Int64,
) -> None:
    """Follow signal minus events of every pixel over the frames, by each of some rules what to believe.

    The signal is the logarithm of ``light`` (n, h, w) and ``dark``, known to ``error`` (n, h, w), and counts ``units``
    times. ``counts`` (n - 1, 2, h, w) holds darker and brighter events between the frames, each a step of ``steps``,
    ``drift`` (n - 1,) what the signal gains besides, ``frames`` (n,) their numbers. ``total`` (h, w) receives what the
    events sum to; ``highest`` (k, 2, h, w) by each rule the largest lower bound of the difference and its frame;
    ``lowest`` the smallest upper bound; -``FARTHEST``, ``FARTHEST`` and frame 0 where there is none. Bounds that are
    not finite, or off by more than the first of a rule's ``uneven`` (k, 2) and the second times the light, tell
    nothing.

    While nothing is added to the events' sum, bounds are compared as they are: their logarithm is taken once, and once
    for successive rules that have found the same.
    """
    rules, width = len(uneven), light.shape[2]
    low, high = np.empty((rules, width)), np.empty((rules, width))
    low_frame, high_frame = np.empty((rules, width)), np.empty((rules, width))
    moved, chosen = np.empty(width, np.int64), np.empty(width + 1, np.int64)
    for row in range(light.shape[1]):
        total[row], highest[:, 0, row], lowest[:, 0, row] = 0, -FARTHEST, FARTHEST
        highest[:, 1, row], lowest[:, 1, row] = 0, 0
        low[:], high[:] = 0.0, np.inf
        for frame in range(len(light)):
            if frame > 0:
                off, on = counts[frame - 1, 0, row], counts[frame - 1, 1, row]
                for column in range(width):
                    moved[column] = on[column] * steps[1] - off[column] * steps[0] - drift[frame - 1]
                ends = low, high, low_frame, high_frame
                _close(moved, False, ends, units, total[row], highest[:, :, row], lowest[:, :, row], chosen)
            for rule in range(rules):
                ends_of_rule = low[rule], high[rule], low_frame[rule], high_frame[rule]
                believed = uneven[rule, 0], uneven[rule, 1]
                _narrow(light[frame, row], error[frame, row], dark, believed, float(frames[frame]), ends_of_rule)
        moved[:], ends = 0, (low, high, low_frame, high_frame)
        _close(moved, True, ends, units, total[row], highest[:, :, row], lowest[:, :, row], chosen)


@njit(cache=True)
def _narrow(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    dark: float,
    uneven: tuple[float, float],
    frame: float,
    ends: tuple[Float64, Float64, Float64, Float64],
) -> None:
    """Take a frame's bounds of a row (w,) into the largest lower and the smallest upper one; without a branch."""
    low, high, low_frame, high_frame = ends
    for column in range(len(light)):
        bright, off = light[column] + dark, float(error[column])
        told = (bright > off) & (off < uneven[0] + uneven[1] * bright)
        lower = bright - off if told else 0.0
        upper = bright + off if told else np.inf
        low_frame[column] = frame if lower > low[column] else low_frame[column]
        low[column] = lower if lower > low[column] else low[column]
        high_frame[column] = frame if upper < high[column] else high_frame[column]
        high[column] = upper if upper < high[column] else high[column]


@njit(cache=True)
def _close(
    moved: Int64,
    everywhere: bool,
    ends: tuple[Float64, Float64, Float64, Float64],
    units: float,
    total: Int64,
    highest: Int64,
    lowest: Int64,
    chosen: Int64,
) -> None:
    """Take the bounds (k, w) of runs of a row into those of their pixels where the events' sum (w,) has ``moved``.

    ``chosen`` (w + 1,) is spare: what no branch can foretell is listed, and bounds are written again as they were.
    """
    low, high, low_frame, high_frame = ends
    count = 0
    for column in range(len(moved)):
        chosen[count] = column
        count += everywhere | (moved[column] != 0)
    for i in range(count):
        at, least, most = np.uint64(chosen[i]), np.int64(0), np.int64(0)
        before = total[at]
        for rule in range(len(low)):
            lower, upper = low[rule, at], high[rule, at]
            if lower > 0.0:
                if rule == 0 or lower != low[rule - 1, at]:
                    least = int(np.floor(np.log(lower) * units)) - before
                if rule == 0 or upper != high[rule - 1, at]:
                    most = int(np.ceil(np.log(upper) * units)) - before
                first, last = int(low_frame[rule, at]), int(high_frame[rule, at])
                higher, deeper = least > highest[rule, 0, at], most < lowest[rule, 0, at]
                highest[rule, 0, at] = least if higher else highest[rule, 0, at]
                highest[rule, 1, at] = first if higher else highest[rule, 1, at]
                lowest[rule, 0, at] = most if deeper else lowest[rule, 0, at]
                lowest[rule, 1, at] = last if deeper else lowest[rule, 1, at]
        low[:, at], high[:, at] = 0.0, np.inf
        total[at] = before + moved[at]


@njit(cache=True)
def join_bounds(total: Int64, earlier: Int64, later: Int64, sign: int, joined: Int64) -> None:
    """Write the larger of earlier bounds and of later ones less ``total``, with its frame, (2, h, w).

    With ``sign`` -1 the smaller one. Of equal ones the earlier.
    """
    for row in range(total.shape[0]):
        for column in range(total.shape[1]):
            moved, before = later[0, row, column] - total[row, column], earlier[0, row, column]
            beyond = moved > before if sign > 0 else moved < before
            joined[0, row, column] = moved if beyond else before
            joined[1, row, column] = later[1, row, column] if beyond else earlier[1, row, column]
