"""Shift of events against frames: the peak of their cross-correlation, and its errors.

The events of a pixel determine its level only to within a threshold C on each side. Their sum differs from the change
of the level between two frames by e, of variance 2/3 C^2. If the change of the level has the slope g, the peak of the
correlation moves by the coefficient of the regression of e on g.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.shift_kernels import (
    RADIUS,
    USABLE,
    add_slopes,
    correlate,
    correlate_with_itself,
    follow_signs,
    follow_turns,
    step_between,
)
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA, jackknife_errors

Bool = NDArray[np.bool_]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

RADIUS_PX: Final = RADIUS
"""Farthest shift that is tried in each direction, px."""

CLEAR: Final = 0.5
"""Correlation above which the peak of a tile comes from the scene of the tile. Tiles contain few edges, and parallel
edges correlate by chance."""

FEWEST_PARTS: Final = 4
"""Least number of parts with a peak: with fewer, no part can differ from the others."""

_FREEDOM: Final = 8
"""Least number of parts, less two, whose scatter is a better scale than their errors."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of events against frames.

    Attributes
    ----------
    right_px, down_px
        Components to the right and down, px.
    """

    right_px: float
    down_px: float


def cross_correlation(change: Float64, events: Float64, usable: Bool, rest: float = 0.0) -> Float64:
    """Return the cross-correlation of changes by frames and by events: sum over x of change(x) events(x + s).

    Both images are taken less their means over the usable pixels, and are 0 elsewhere. Products are in single
    precision.

    Parameters
    ----------
    change, events
        (h, w) changes of the level by frames and by events.
    usable
        (h, w) True for pixels that count.
    rest
        Value of ``events`` where a pixel does not fire. It saves time where most pixels do not fire; the result does
        not depend on it.

    Returns
    -------
    Float64
        (2 R + 1, 2 R + 1) for the shifts s = (down, right), from -R to R px, R = ``RADIUS_PX``; the middle is no shift.
    """
    patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
    change, events = (np.ascontiguousarray(image, np.float64) for image in (change, events))
    flags = np.ascontiguousarray(usable).view(np.uint8)
    correlate(change, events, flags, USABLE, (0, usable.shape[0], 0, usable.shape[1]), rest, patch)
    return patch


def auto_correlation(change: Float64, usable: Bool) -> Float64:
    """Return the ``cross_correlation`` of an image with itself, in half the time.

    Parameters
    ----------
    change
        (h, w) image.
    usable
        (h, w) True for pixels that count.

    Returns
    -------
    Float64
        (2 R + 1, 2 R + 1), as that of ``cross_correlation``.
    """
    patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
    flags = np.ascontiguousarray(usable).view(np.uint8)
    correlate_with_itself(np.ascontiguousarray(change, np.float64), flags, USABLE, patch)
    return patch


@dataclass(frozen=True, slots=True)
class ShiftSums:
    """Sums of k parts of an interval, or of one part of k intervals.

    Attributes
    ----------
    patches
        (k, s, s) cross-correlations of frame changes with event changes; s = 2 R + 1, no shift in the middle.
    squares
        (k, 2) sums of squares of frame changes and of event changes.
    slopes
        (k, 3, 2) sums of slopes, as ``slope_sums`` returns them.
    """

    patches: Float64
    squares: Float64
    slopes: Float64

    @staticmethod
    def stacked(sums: "Sequence[ShiftSums]") -> "ShiftSums":
        """Return the sums of k parts from k sums of one part each."""
        return ShiftSums(*(np.array([getattr(each, name) for each in sums]) for name in ShiftSums.__slots__))

    @staticmethod
    def added(sums: "Sequence[ShiftSums]") -> "ShiftSums":
        """Return the sums over several intervals of the same parts."""
        return ShiftSums(*(np.sum([getattr(each, name) for each in sums], axis=0) for name in ShiftSums.__slots__))


@dataclass(frozen=True, slots=True)
class IntervalChanges:
    """Changes by frames and by events between two frames, and flags of the pixels.

    Attributes
    ----------
    level
        (h, w) level of the earlier frame.
    change, events
        (h, w) changes by frames and by events, in the unit of the level.
    flags
        (h, w) combinations of ``USABLE``, ``KEPT`` and ``SETTLED`` of ``shift_kernels``.
    """

    level: NDArray[np.floating]
    change: Float64
    events: Float64
    flags: NDArray[np.uint8]

    def sums(self, flag: int, boxes: Sequence[tuple[int, int, int, int]]) -> ShiftSums:
        """Return the sums over the flagged pixels of parts of the image.

        Parameters
        ----------
        flag
            Flag of the pixels that count.
        boxes
            Top, bottom, left and right of each of the k parts, px, half open.

        Returns
        -------
        ShiftSums
            Of the k parts.
        """
        patches = np.empty((len(boxes), 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        squares, slopes = np.empty((len(boxes), 2)), np.zeros((len(boxes), 3, 2))
        for i, box in enumerate(boxes):
            squares[i] = correlate(self.change, self.events, self.flags, flag, box, 0.0, patches[i])
            add_slopes(self.level, self.change, self.flags, flag, box, slopes[i])
        return ShiftSums(patches, squares, slopes)

    def tile_sums(self, flag: int, tiles: int) -> ShiftSums:
        """Return the sums over the flagged pixels of each tile of the image.

        Parameters
        ----------
        flag
            Flag of the pixels that count.
        tiles
            Number of tiles along each axis.

        Returns
        -------
        ShiftSums
            Of tiles^2 parts, by rows.
        """
        rows, columns = ([-(-edge * size // tiles) for edge in range(tiles + 1)] for size in self.flags.shape)
        return self.sums(flag, [(*down, *right) for down in pairwise(rows) for right in pairwise(columns)])

    def patch(self, flag: int) -> Float64:
        """Return the cross-correlation (2 R + 1, 2 R + 1) over the flagged pixels of the whole image."""
        patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        box = 0, self.flags.shape[0], 0, self.flags.shape[1]
        correlate(self.change, self.events, self.flags, flag, box, 0.0, patch)
        return patch


def intervals(
    signal_of: Callable[[int], tuple[Float32, Bool]],
    counts: NDArray[np.int32],
    threshold_on: float,
    threshold_off: float,
    chosen: Sequence[int],
    before: NDArray[np.int32] | None = None,
) -> Iterator[IntervalChanges]:
    """Yield the chosen ones of successive intervals, in order.

    If the signal of a pixel changes against the sign of its last events, it passes through both thresholds before the
    pixel fires again. The flags exclude such pixels.

    Parameters
    ----------
    signal_of
        Returns the signal (h, w) of a frame, and the mask (h, w) where it is known, by the number of the frame.
    counts
        (n - 1, 2, h, w) darker and brighter events of the intervals between n frames.
    threshold_on, threshold_off
        Change of the signal by one brighter and by one darker event, both positive.
    chosen
        Numbers of the intervals that are yielded, ascending.
    before
        (2, h, w) darker and brighter events before the first interval; None where they are not known. The first events
        of a pixel without events before count as a change of sign.

    Yields
    ------
    IntervalChanges
        Its arrays are overwritten by the next interval: copy them to keep them.
    """
    shape, steps = counts.shape[2:], (-threshold_off, threshold_on)
    change, events = np.empty(shape), np.empty(shape)
    signs, flags = np.zeros(shape, np.int8), np.empty(shape, np.uint8)
    if before is not None:
        follow_signs(before, signs)
    for i in range(max(chosen, default=-1) + 1):
        if i not in chosen:
            # The signs of the last events depend on all intervals before, also on those that are not chosen.
            follow_signs(counts[i], signs)
            continue
        (earlier, lit_before), (later, lit_after) = signal_of(i), signal_of(i + 1)
        step_between(earlier, later, lit_before & lit_after, counts[i], steps, change, events, flags)
        follow_turns(counts[i], change, signs, flags)
        yield IntervalChanges(earlier, change, events, flags)


def peak(correlation: Float64) -> Shift | None:
    """Return the shift of the peak to a fraction of a pixel (parabola along each axis).

    Parameters
    ----------
    correlation
        (2 R + 1, 2 R + 1) by shifts down (rows) and to the right (columns), no shift in the middle.

    Returns
    -------
    Shift | None
        None where the largest value is not positive, or lies at the border.
    """
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(correlation)), correlation.shape))
    # A largest value at the border can belong to a peak outside of the range.
    last = 2 * RADIUS_PX
    if correlation[row, column] <= 0 or not (0 < row < last and 0 < column < last):
        return None
    down = _vertex(correlation[row - 1 : row + 2, column])
    right = _vertex(correlation[row, column - 1 : column + 2])
    return Shift(column - RADIUS_PX + right, row - RADIUS_PX + down)


def peak_spread(patches: Float64, total: Float64) -> Float64 | None:
    """Return the standard error of the peak by the delete-one jackknife.

    Parameters
    ----------
    patches
        (k, s, s) correlations of single intervals.
    total
        (s, s) their sum.

    Returns
    -------
    Float64 | None
        (2,) to the right and down, px; None where the sum without one of the intervals has no peak.
    """
    peaks = [peak(total - patch) for patch in patches]
    shifts = [(shift.right_px, shift.down_px) for shift in peaks if shift is not None]
    if len(shifts) < len(peaks):
        return None
    return jackknife_errors(shifts)


def slope_sums(level: NDArray[np.floating], change: Float64, usable: Bool) -> Float64:
    """Return sums of slopes over pairs of neighbouring usable pixels.

    Parameters
    ----------
    level, change
        (h, w) level of the earlier frame, and its change.
    usable
        (h, w) True for pixels that count.

    Returns
    -------
    Float64
        (3, 2): sums of |g|, of g^2 and of h^2, to the right and down, with g the slope of the level and h that of its
        change, in units of the level / px.
    """
    sums = np.zeros((3, 2))
    add_slopes(level, change, usable.view(np.uint8), USABLE, (0, usable.shape[0], 0, usable.shape[1]), sums)
    return sums


def open_level_errors(sums: Float64, threshold: float) -> tuple[Float64, Float64]:
    """Return the standard error and the lag of a shift, from the levels that events leave undetermined.

    The standard error is C sqrt(2/3 / sum h^2), with h the slope of the change. Where little moves, e is almost equal
    in successive intervals, so that the error is not divided by their number. The lag is due to the thresholds: a level
    that has risen lies above its reference by C/2 on average. Events therefore follow the motion by at most
    C/2 sum |g| / sum g^2, with g the slope of the level.

    Parameters
    ----------
    sums
        (3, 2) ``slope_sums`` of an interval.
    threshold
        C, in the unit of the level.

    Returns
    -------
    tuple[Float64, Float64]
        (2,) standard errors and (2,) bounds of the lag, to the right and down, px.
    """
    level, level_squares, change_squares = sums
    # At each of two frames the level is uniform over 2 C, of variance (2 C)^2 / 12; hence Var(e) = 2/3 C^2.
    # Regression of e on h has the standard error C sqrt(2/3 / sum h^2).
    errors = threshold * np.sqrt(2 / 3 / np.maximum(change_squares, 1e-300))
    # lag = C/2 sum |g| / sum g^2: half a threshold over the slope.
    lags = threshold / 2 * level / np.maximum(level_squares, 1e-300)
    return errors, lags


@dataclass(frozen=True, slots=True)
class PartShift:
    """The part whose shift along an axis differs most from the median of all parts.

    Attributes
    ----------
    part, axis
        Number of the part, and the axis: 0 to the right, 1 down.
    alike
        (k,) True for parts that are shifted by more than half as much in the same direction.
    shift_px, standard_error_px
        Shift of the part less the median of all parts, px, and its standard error. Where the part itself is shifted
        less than the median, most parts count as shifted: the sign is then reversed, and ``alike`` holds the other
        parts.
    compared
        Number of parts that were compared.
    errors_px
        (compared, 2) standard errors of these parts, px.
    """

    part: int
    axis: int
    alike: Bool
    shift_px: float
    standard_error_px: float
    compared: int
    errors_px: Float64


def most_shifted(
    sums: ShiftSums, intervals: int, threshold: float, least: float, with_turned: Float64 | None = None
) -> PartShift | None:
    """Return the part that is shifted most against the others, in standard errors.

    Parameters
    ----------
    sums
        Sums of k parts over intervals.
    intervals
        Number of intervals in the sums. Slopes are divided by it, because the error by events is almost equal in
        successive intervals.
    threshold
        C, in the unit of the level.
    least
        Correlation, 0 to 1, below which a part has no peak of its own.
    with_turned
        (k, s, s) correlations that include pixels whose events changed sign. The shift of a peak by these pixels is
        added to the error of its part. None: no such error.

    Returns
    -------
    PartShift | None
        None where fewer than four parts have a peak of their own.
    """
    count = len(sums.patches)
    shifts, errors = np.full((count, 2), np.nan), np.full((count, 2), np.inf)
    strengths = sums.patches.max(axis=(1, 2)) / np.maximum(np.sqrt(sums.squares.prod(axis=1)), 1e-300)
    for i in np.flatnonzero(strengths >= least):
        shift = peak(sums.patches[i])
        if shift is not None:
            shifts[i] = shift.right_px, shift.down_px
            errors[i] = open_level_errors(sums.slopes[i] / intervals, threshold)[0]
            dragged = peak(with_turned[i]) if with_turned is not None else None
            if dragged is not None:
                drag_px = dragged.right_px - shift.right_px, dragged.down_px - shift.down_px
                errors[i] = np.hypot(errors[i], drag_px)
    # Parts without a peak of their own are not compared.
    is_finite = np.isfinite(shifts).all(axis=1)
    if np.count_nonzero(is_finite) < FEWEST_PARTS:
        return None
    usual = np.median(shifts[is_finite], axis=0)
    deviations = shifts - usual
    scores = deviations[is_finite] / errors[is_finite]
    if len(scores) >= _FREEDOM + 2:
        # If the scatter of the parts exceeds their errors, the errors are widened to the scatter.
        errors = errors * max(1.0, MAD_TO_SIGMA * float(np.median(np.abs(scores))))
    scores = np.where(is_finite[:, np.newaxis], np.abs(deviations) / errors, -1.0)
    part, axis = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))
    shift_px = float(deviations[part, axis])
    alike = is_finite & (deviations[:, axis] / shift_px > 1 / 2) if shift_px else is_finite
    if abs(usual[axis] + shift_px) < abs(usual[axis]):
        # This part is shifted less than the median: the other parts count as shifted.
        alike, shift_px = is_finite & ~alike, -shift_px
    return PartShift(
        part, axis, alike, shift_px, float(errors[part, axis]), int(np.count_nonzero(is_finite)), errors[is_finite]
    )


def _vertex(three: Float64) -> float:
    """Return the position of the maximum of the parabola through values at -1, 0, 1; the middle one is the largest."""
    # x = (y_- - y_+) / (2 (y_- - 2 y_0 + y_+)), where the derivative of the parabola is 0.
    bend = float(three[0] - 2 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0 else 0.0
