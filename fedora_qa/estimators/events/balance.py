"""How many events came for the change of the light that the frames state: a gain, its scatter, and events against it.

An ideal pixel gives an event for each threshold by which its signal changes. A change of the signal by k thresholds
between two frames that follows an earlier one of the same sign therefore gives k events on average, as the phase of the
reference is uniform; after a change of the other sign it gives one less, because the signal first returns to the
reference and then passes the other threshold. Over all pixels the mean of the signed events e is e = g (k - p), with
the gain g = 1 and the share p of changes that reverse. What a fault does to the events appears in this line:

- Thresholds that are higher by 1/g give the gain g, and the variance of e about the line is that of the two phases
  whatever k is. The same holds where thresholds change in time or across the sensor.
- Events that are lost at random with the probability 1 - g give the gain g too, but their number is binomial: its
  variance g (1 - g) n grows with the number n of due events, by 1 - g for each event that is left.
- A pixel that gives one event at most in some time has e = 1 for any large k: e no longer grows with k.
- Thresholds that differ by pixel leave g, and the deviations of a pixel from the line agree over time.
- Spurious events leave the line, but come against the change of the light as often as with it.

Where the signal does not turn between two frames, an ideal sensor gives no event against its change, so that these are
spurious events, at edges as well. They are counted where the signal changes alike in three successive intervals.

The linear model takes the last value as its reference, not the passed level: of a fast change it gives fewer events,
which is why gains are compared with those of other times and places as well.
"""

from dataclasses import dataclass, fields
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

TILES: Final = 8
"""Tiles a side of the image, over which errors are estimated."""

_TWO: Final = 2.0
"""Least change of the second class of changes, thresholds; that of the first is one, for which an event is due."""

_ONE_SIGN: Final = 0.25
"""Least change of the signal whose sign rounding leaves, thresholds."""

MOMENTS: Final = 6
"""Sums of 1, k, e, k k, k e and e e."""


@dataclass(frozen=True, slots=True)
class BalanceSums:
    """Sums over the pixels of k intervals between frames, in v windows.

    Attributes
    ----------
    moments
        (k, 2, 2, t, 6) sums of 1, k, e, k k, k e and e e, of falling and rising light, of changes by one threshold and
        by two or more, by tile; k is the change in thresholds, e the events less those against it.
    against
        (k,) events against the change.
    seconds
        (k,) times of the pixels in which ``against`` were counted, s.
    columns_against
        (v, w) events against the change, by column.
    agreement
        (v, t, 2) sums of R R' and K K' by tile: K is the change and R the deviation from the line of a pixel in the
        first half of a window, K' and R' in the second.
    """

    moments: NDArray[np.float32]
    against: Int64
    seconds: Float64
    columns_against: Int32
    agreement: Float64

    def then(self, later: "BalanceSums") -> "BalanceSums":
        """Return the sums of these windows and of later ones."""
        names = (each.name for each in fields(self))
        return BalanceSums(*(np.concatenate([getattr(self, name), getattr(later, name)]) for name in names))


def sum_balance(
    levels: NDArray[np.float32], lit: Bool, counts: Int32, thresholds: tuple[float, float], intervals_ns: Int64
) -> BalanceSums:
    """Return the sums of a window.

    Parameters
    ----------
    levels
        (n, h, w) signal at each frame, n >= 2.
    lit
        (n, h, w) where it is known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    thresholds
        C- and C+, in the unit of the signal, both positive.
    intervals_ns
        (n - 1,) times between the frames, ns.

    Returns
    -------
    BalanceSums
        Of the n - 1 intervals.
    """
    intervals = len(counts)
    sums = WindowSums(
        np.zeros((intervals, 2, 2, TILES**2, MOMENTS)),
        np.zeros((intervals, 2), np.int64),
        np.zeros((1, levels.shape[2]), np.int32),
        np.zeros((TILES**2, 3, 3)),
    )
    add_changes(levels, lit, counts, thresholds, sums)
    agreement = np.zeros((1, TILES**2, 2))
    count, k, e, kk, ke, _ = sums.moments.sum(axis=(0, 1, 2, 3))
    if count * kk > k * k:
        # e = offset + slope k over all pixels of the window, and R = E - offset N - slope K of N changes.
        slope = (count * ke - k * e) / (count * kk - k * k)
        deviation = np.array([-(e - slope * k) / count, -slope, 1.0])
        agreement[0] = np.stack([deviation @ sums.halves @ deviation, sums.halves[:, 1, 1]], axis=1)
    against, pixels = sums.against.T
    seconds = pixels * (intervals_ns / NS_PER_S)
    return BalanceSums(sums.moments.astype(np.float32), against, seconds, sums.columns, agreement)


class WindowSums(NamedTuple):
    """The arrays that ``add_changes`` updates, of n - 1 intervals.

    Attributes
    ----------
    moments
        (n - 1, 2, 2, t, 6), as of ``BalanceSums``.
    against
        (n - 1, 2) events against the change, and pixels in which they were counted.
    columns
        (1, w) events against the change.
    halves
        (t, 3, 3) products of number, sum of changes and sum of events of a pixel, in the first half of the intervals
        and in the second.
    """

    moments: Float64
    against: Int64
    columns: Int32
    halves: Float64


@njit(cache=True)
def add_changes(
    levels: NDArray[np.float32],
    lit: Bool,
    counts: Int32,
    thresholds: tuple[float, float],
    sums: WindowSums,
) -> None:
    """Add the changes of all pixels and their events to the sums, in place.

    Parameters
    ----------
    levels, lit, counts, thresholds
        As of ``sum_balance``.
    sums
        Updated.
    """
    moments, against, columns, halves = sums
    off, on = thresholds
    intervals, height, width = counts.shape[0], counts.shape[2], counts.shape[3]
    changes, of_pixel = np.empty((intervals, width)), np.empty((2, 3, width))
    # By rows: the changes of a row stay in the cache while all intervals are processed.
    for row in range(height):
        for i in range(intervals):
            for column in range(width):
                change = float(levels[i + 1, row, column]) - float(levels[i, row, column])
                is_lit = lit[i, row, column] & lit[i + 1, row, column]
                changes[i, column] = (change / on if change > 0 else change / off) if is_lit else 0.0
        of_pixel[:] = 0.0
        for i in range(intervals):
            half = 1 if i >= intervals // 2 else 0
            for column in range(width):
                here = changes[i, column]
                k, sign = abs(here), 1 if here > 0 else 0
                if k <= _ONE_SIGN:
                    continue
                darker, brighter = counts[i, 0, row, column], counts[i, 1, row, column]
                if 0 < i < intervals - 1:
                    direction = 1.0 if sign == 1 else -1.0
                    if min(changes[i - 1, column] * direction, changes[i + 1, column] * direction) > _ONE_SIGN:
                        wrong = darker if sign == 1 else brighter
                        against[i, 0] += wrong
                        against[i, 1] += 1
                        columns[0, column] += wrong
                if k >= 1.0:
                    # Events with the change less those against it, in thresholds of its sign.
                    e = brighter - darker * off / on if sign == 1 else darker - brighter * on / off
                    tile = (TILES * row // height) * TILES + TILES * column // width
                    cell = moments[i, sign, 1 if k >= _TWO else 0, tile]
                    cell[0] += 1.0
                    cell[1] += k
                    cell[2] += e
                    cell[3] += k * k
                    cell[4] += k * e
                    cell[5] += e * e
                    of_pixel[half, 0, column] += 1.0
                    of_pixel[half, 1, column] += k
                    of_pixel[half, 2, column] += e
        for column in range(width):
            if of_pixel[0, 0, column] > 0 and of_pixel[1, 0, column] > 0:
                tile = (TILES * row // height) * TILES + TILES * column // width
                for earlier in range(3):
                    for later in range(3):
                        halves[tile, earlier, later] += of_pixel[0, earlier, column] * of_pixel[1, later, column]
