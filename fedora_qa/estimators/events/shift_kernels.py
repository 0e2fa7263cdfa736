"""Compiled loops over the changes of frames and events: the changes, and their correlation over a few pixels.

For so few shifts, sums of products take less time than Fourier transforms. Single precision is enough: a row is summed
in a few partial sums, with a relative error of 1e-6, and rows are added in double precision. Most pixels do not fire
between two frames. Their value less the mean is equal everywhere, so that its products with a row follow from the sums
of the row. In rows with few firing pixels, only these pixels are processed.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Flags = NDArray[np.uint8]
Bools = NDArray[np.bool_]
Images = NDArray[np.floating[Any]]
Box = tuple[int, int, int, int]
"""Top, bottom, left and right of a part of the image, px, half open."""

# Farthest shift in each direction, px.
RADIUS = 8
_SIDE = 2 * RADIUS + 1
_WIDE = 32
"""Number of products that are added together: whole vectors of the processor, of which ``_SIDE`` are used."""

_FEW = 6
"""Where one in six pixels of a row fires, both ways take equally long: by firing pixels, or the whole row at once."""

USABLE, KNOWN, FIRED, OPEN = 1, 2, 4, 8
"""Flags of pixels. USABLE: the signal is known in both frames. KNOWN: also, the change of the level by events is.
FIRED: events change the level. OPEN: they do, but the change is not known."""


@njit(cache=True)
def correlate(
    change: Float64,
    events: Float64,
    flags: Flags,
    event_flags: Flags,
    flag: int,
    box: Box,
    area: Box,
    rest: float,
    patch: Float64,
    energies: Float64,
) -> tuple[float, float]:
    """Write the cross-correlation of change and events of a part of the image, and return their sums of squares.

    For the correlation and the energies, both images are taken less their means over the flagged pixels of the part.
    Both are 0 where pixels are not flagged, and events also outside the part. All shifts of a part therefore have
    equally many pairs, except where they reach beyond the image. Each image has flags of its own, because changes can
    be those at the corners of pixels: a mask that lies half a pixel from the events it masks would move their peak.

    Parameters
    ----------
    change, events
        (h, w) changes of the level by frames and by events.
    flags, event_flags, flag
        (h, w) flags of the pixels of change and of events, and the flag of those that count.
    box
        Top, bottom, left and right of the part, px, half open.
    area
        Rectangle that holds all flagged pixels of change. The energy of events counts a pixel if its partner lies
        within it.
    rest
        Value of ``events`` where a pixel does not fire. It saves time; the result does not depend on it.
    patch
        (2 R + 1, 2 R + 1) receives the correlation by shifts down (rows) and to the right (columns), no shift in the
        middle.
    energies
        (2, 2 R + 1, 2 R + 1) receives the energies of change and of events, sums of squares over the pairs at each
        shift. With no row or column, (2, 0, 0), they are left out.

    Returns
    -------
    tuple[float, float]
        Sums of squares of change and of events over the flagged pixels; the means are not subtracted.
    """
    top, bottom, left, right = box
    width = right - left
    count, change_sum, change_squares = 0, 0.0, 0.0
    event_count, event_sum, event_squares = 0, 0.0, 0.0
    for row in range(top, bottom):
        flagged, total, squares = _sums_of_row(change[row, left:right], flags[row, left:right], flag)
        count, change_sum, change_squares = count + flagged, change_sum + total, change_squares + squares
        flagged, total, squares = _sums_of_row(events[row, left:right], event_flags[row, left:right], flag)
        event_count, event_sum, event_squares = event_count + flagged, event_sum + total, event_squares + squares
    # patch[s] = sum_x (c(x) - mean c) (e(x + s) - mean e); pixels without the flag are 0 in both.
    patch[:] = 0.0
    energies[:] = 0.0
    if count == 0 or event_count == 0:
        return change_squares, event_squares
    mean, with_energies = event_sum / event_count, energies.size > 0
    # Rounded to single precision as ``fired`` is: otherwise the values of silent pixels would not be equal to it.
    beside = np.float64(np.float32(rest - mean))
    around = np.zeros((bottom - top + 2 * RADIUS, width + _WIDE - 1), np.float32)
    sums, shifted = np.zeros((bottom - top + 2 * RADIUS, _SIDE)), np.empty(_SIDE)
    first, last = max(left - RADIUS, 0), min(right + RADIUS, change.shape[1])
    for row in range(max(top - RADIUS, 0), min(bottom + RADIUS, change.shape[0])):
        line = around[row - top + RADIUS]
        _centre(
            change[row, first:last],
            change_sum / count,
            flags[row, first:last],
            flag,
            line[first - left + RADIUS : last - left + RADIUS],
        )
        line = line[: width + 2 * RADIUS]
        _shifted_sums(line, sums[row - top + RADIUS])
        if with_energies:
            _shifted_sums(line * line, shifted)
            # A row of the frames is paired with the rows of the part that lie up to R above or below it.
            for down in range(max(top - row + RADIUS, 0), min(bottom - row + RADIUS, _SIDE)):
                for i in range(_SIDE):
                    energies[0, down, i] += shifted[_SIDE - 1 - i]
    fired, columns = np.empty(width, np.float32), np.empty(width + 1, np.int64)
    products = np.empty((_SIDE, _WIDE), np.float32)
    for row in range(top, bottom):
        _centre(events[row, left:right], mean, event_flags[row, left:right], flag, fired)
        if with_energies:
            _partnered_sums(fired * fired, area[2] - RADIUS - left, area[3] - RADIUS - left, shifted)
            for down in range(max(row - area[1] + 1 + RADIUS, 0), min(row - area[0] + 1 + RADIUS, _SIDE)):
                for i in range(_SIDE):
                    energies[1, down, i] += shifted[i]
        firing = _find_firing(fired, beside, columns)
        lines = around[row - top : row - top + _SIDE]
        # Rows in which many pixels fire are multiplied as a whole. In others, silent pixels contribute by sums of rows:
        # sum_x e(x) c(x - s) = sum_{firing x} (e(x) - beside) c(x - s) + beside sum_x c(x - s).
        if firing > width // _FEW:
            for down in range(_SIDE):
                _add_products(fired, lines[_SIDE - 1 - down], patch[down])
        else:
            products[:] = 0.0
            for i in range(firing):
                _add_around(fired[columns[i]] - beside, columns[i], lines, products)
            for down in range(_SIDE):
                for i in range(_SIDE):
                    back = row - top + _SIDE - 1 - down
                    patch[down, _SIDE - 1 - i] += products[_SIDE - 1 - down, i] + beside * sums[back, i]
    return change_squares, event_squares


@njit(cache=True)
def correlate_with_itself(change: Float64, flags: Flags, flag: int, patch: Float64) -> None:
    """Write the autocorrelation of an image less its mean over the flagged pixels, 0 elsewhere.

    Parameters
    ----------
    change
        (h, w) image.
    flags, flag
        (h, w) flags of pixels, and the flag of those that count.
    patch
        (2 R + 1, 2 R + 1) receives the correlation, no shift in the middle.
    """
    height, width = change.shape
    count, total = 0, 0.0
    for row in range(height):
        flagged, of_row, _ = _sums_of_row(change[row], flags[row], flag)
        count, total = count + flagged, total + of_row
    patch[:] = 0.0
    if count == 0:
        return
    around = np.zeros((height + RADIUS, width + 2 * RADIUS), np.float32)
    for row in range(height):
        _centre(change[row], total / count, flags[row], flag, around[row + RADIUS, RADIUS : RADIUS + width])
    for row in range(height):
        # Only products with the row itself and with rows above are computed.
        for down in range(RADIUS, _SIDE):
            line = around[row + 2 * RADIUS - down]
            _add_products(around[row + RADIUS, RADIUS : RADIUS + width], line, patch[down])
    # An autocorrelation is even, R(-s) = R(s).
    for down in range(RADIUS):
        for i in range(_SIDE):
            patch[down, i] = patch[_SIDE - 1 - down, _SIDE - 1 - i]


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sums_of_row(values: Float64, flags: Flags, flag: int) -> tuple[int, float, float]:
    """Return the number of flagged pixels of a row, their sum, and their sum of squares."""
    count, total, squares = 0.0, 0.0, 0.0
    for i in range(len(flags)):
        used = (flags[i] & flag) != 0
        value = values[i] if used else 0.0
        count += 1.0 if used else 0.0
        total += value
        squares += value * value
    return int(count), total, squares


@njit(cache=True)
def _centre(values: Float64, mean: float, flags: Flags, flag: int, line: Float32) -> None:
    """Write the values of a row less a mean; 0 where a pixel does not have the flag."""
    for i in range(len(flags)):
        line[i] = values[i] - mean if (flags[i] & flag) != 0 else 0.0


@njit(cache=True)
def _shifted_sums(line: Float32, sums: Float64) -> None:
    """Write the sums (2 R + 1,) of a row (w + 2 R,) over w successive pixels, by the first of them."""
    width = len(line) - 2 * RADIUS
    sums[0] = total = _total(line[:width])
    for i in range(1, _SIDE):
        total += np.float64(line[i - 1 + width]) - line[i - 1]
        sums[i] = total


@njit(cache=True)
def _partnered_sums(squares: Float32, begin: int, stop: int, sums: Float64) -> None:
    """Write the sums (2 R + 1,) of a row (w,) by shifts s, over columns from ``begin + s`` to before ``stop + s``."""
    total = _total(squares)
    for right in range(_SIDE):
        sums[right] = total
        for i in range(min(begin + right, len(squares))):
            sums[right] -= squares[i]
        for i in range(max(stop + right, 0), len(squares)):
            sums[right] -= squares[i]


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _total(values: Float32) -> float:
    """Return the sum in double precision."""
    total = 0.0
    for i in range(len(values)):
        total += np.float64(values[i])
    return total


@njit(cache=True)
def _find_firing(values: Float32, usual: float, columns: NDArray[np.int64]) -> int:
    """Write the indices of values (w,) that differ from ``usual`` to ``columns`` (w + 1,), and return their number."""
    count = 0
    for i in range(len(values)):
        columns[count] = i
        count += values[i] != usual
    return count


@njit(cache=True, fastmath={"contract"})
def _add_around(value: float, column: int, lines: Float32, products: Float32) -> None:
    """Add the products of a value with the pixels around its column in ``lines`` (2 R + 1, w + 2 R and more)."""
    weight, first = np.float32(value), np.uint64(column)
    for down in range(_SIDE):
        line, sums = lines[down], products[down]
        for i in range(len(sums)):  # a constant number of iterations would be unrolled and not vectorised
            sums[i] += weight * line[first + np.uint64(i)]


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_products(fired: Float32, line: Float32, sums: Float64) -> None:
    """Add the sums of products of a row (w,) with ``line`` (w + 2 R,) at each shift, four shifts at a time."""
    for first in range(0, _SIDE - 1, 4):
        a, b, c, d = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
        for i in range(len(fired)):
            column, value = i + first, fired[i]
            a += value * line[column]
            b += value * line[column + 1]
            c += value * line[column + 2]
            d += value * line[column + 3]
        right = _SIDE - 1 - first
        sums[right] += a
        sums[right - 1] += b
        sums[right - 2] += c
        sums[right - 3] += d
    last = np.float32(0)
    for i in range(len(fired)):
        last += fired[i] * line[i + _SIDE - 1]
    sums[0] += last


@njit(cache=True)
def add_slopes(level: NDArray[np.floating], change: Float64, flags: Flags, flag: int, box: Box, sums: Float64) -> None:
    """Add the sums of slopes over pairs of neighbouring pixels of a part of the image.

    A pair of which one pixel has the flag counts by a half: each pixel has a pair on either side.

    Parameters
    ----------
    level, change
        (h, w) level of the earlier frame, and its change.
    flags, flag
        (h, w) flags of pixels, 0 where they are not usable, and the flag of those that count.
    box
        Top, bottom, left and right of the part, px, half open.
    sums
        (3, 2) is added to, as ``shift.slope_sums`` describes it.
    """
    top, bottom, left, right = box
    for row in range(top, bottom):
        line = level[row, left:right], change[row, left:right], flags[row, left:right]
        _add_slopes_of_row(*line, line[0][1:], line[1][1:], line[2][1:], flag, sums[:, 0])
        if row > top:
            above = level[row - 1, left:right], change[row - 1, left:right], flags[row - 1, left:right]
            _add_slopes_of_row(*above, *line, flag, sums[:, 1])


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_slopes_of_row(
    level: NDArray[np.floating],
    change: Float64,
    flags: Flags,
    next_level: NDArray[np.floating],
    next_change: Float64,
    next_flags: Flags,
    flag: int,
    sums: Float64,
) -> None:
    """Add the sums (3,) of slopes from the pixels of a row to the next ones, as in ``shift.slope_sums``."""
    # sums of |g|, g^2 and h^2: g the slope of the level, h that of its change
    slopes, squares, change_squares = 0.0, 0.0, 0.0
    for i in range(len(next_level)):
        flagged = (0.5 if (flags[i] & flag) != 0 else 0.0) + (0.5 if (next_flags[i] & flag) != 0 else 0.0)
        weight = flagged if flags[i] != 0 and next_flags[i] != 0 else 0.0
        slope = float(next_level[i]) - level[i] if weight > 0 else 0.0
        steeper = next_change[i] - change[i] if weight > 0 else 0.0
        slopes += weight * abs(slope)
        squares += weight * slope * slope
        change_squares += weight * steeper * steeper
    sums[0] += slopes
    sums[1] += squares
    sums[2] += change_squares


@njit(cache=True)
def change_and_events(
    before: Images, after: Images, error_before: Images, error_after: Images, counts: NDArray[np.int32]
) -> tuple[Float64, Float64, Bools, Float64]:
    """Return the absolute change of a level and the number of events of each pixel, and sums of both.

    Parameters
    ----------
    before, after, error_before, error_after
        (h, w) levels at both ends of the interval, and bounds of their errors in the same unit. The bounds are not
        finite where the level is not known.
    counts
        (2, h, w) darker and brighter events of the interval. Pixels with both are not usable.

    Returns
    -------
    change
        (h, w) absolute change, in the unit of the levels; 0 where not usable.
    events
        (h, w) events of either polarity; 0 where not usable.
    usable
        (h, w) pixels that can be compared.
    sums
        (4,) number of usable pixels, and over them the sum of the events, and the sums of squared deviations of change
        and of events from their means.
    """
    height, width = before.shape
    change, events, usable = np.zeros((height, width)), np.zeros((height, width)), np.zeros((height, width), np.bool_)
    count, total_change, total_events = 0, 0.0, 0.0
    for row in range(height):
        for column in range(width):
            darker, brighter = counts[0, row, column], counts[1, row, column]
            # Events of both signs: the level has turned, and its net change is smaller than the number of events
            # implies.
            if darker > 0 and brighter > 0:
                continue
            # An error is not finite where the frame is clipped or the pixel lies outside of it.
            if not (np.isfinite(error_before[row, column]) and np.isfinite(error_after[row, column])):
                continue
            step = abs(np.float64(after[row, column]) - np.float64(before[row, column]))
            change[row, column], events[row, column], usable[row, column] = step, darker + brighter, True
            count += 1
            total_change += step
            total_events += darker + brighter
    sums = np.array([float(count), total_events, 0.0, 0.0])
    if count:
        mean_change, mean_events = total_change / count, total_events / count
        # In a second pass: to subtract n mean^2 from a sum of squares would cancel digits.
        for row in range(height):
            for column in range(width):
                if usable[row, column]:
                    sums[2] += (change[row, column] - mean_change) ** 2
                    sums[3] += (events[row, column] - mean_events) ** 2
    return change, events, usable, sums
