"""By how many pixels events are shifted against frames: the peak of their cross-correlation, and its errors.

The events of a pixel leave its level open by a threshold C on each side: their sum differs from the change of the level
by e, of variance 2/3 C^2 between two frames. Where the picture has slope g, the peak of a correlation moves by the
regression of e on g.
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
"""Farthest shift that is tried in each direction."""

CLEAR: Final = 0.5
"""Correlation above which the peak of a tile is that of its own scene. Tiles hold few edges, and parallel edges
correlate by chance."""

FEWEST_PARTS: Final = 4
"""Parts with a shift of their own below which none stands out."""

_FREEDOM: Final = 8
"""Parts, less two, from which on their scatter is a better scale than their errors."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of events against frames, px: to the right and down."""

    right_px: float
    down_px: float


def cross_correlation(change: Float64, events: Float64, usable: Bool, rest: float = 0.0) -> Float64:
    """Return the sum over pixels x of change(x) events(x + s) for all shifts s, rows down and columns right.

    ``change`` and ``events`` (h, w) are taken less their means over the usable pixels, 0 elsewhere. The result is
    (2 R + 1, 2 R + 1), R the radius; the middle is no shift. Products are in single precision.

    Parameters
    ----------
    change, events
        (h, w) changes of the level, by frames and by events.
    usable
        (h, w) pixels that count.
    rest
        Value of ``events`` where nothing fires. It saves time where most pixels do not fire, and changes no result.

    Returns
    -------
    Float64
        (2 R + 1, 2 R + 1), s = (down, right) px, from -R to R.
    """
    patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
    change, events = (np.ascontiguousarray(image, np.float64) for image in (change, events))
    flags = np.ascontiguousarray(usable).view(np.uint8)
    correlate(change, events, flags, USABLE, (0, usable.shape[0], 0, usable.shape[1]), rest, patch)
    return patch


def auto_correlation(change: Float64, usable: Bool) -> Float64:
    """Return the ``cross_correlation`` (2 R + 1, 2 R + 1) of an image (h, w) with itself, in half the time."""
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
        (k, s, s) cross-correlations of frame changes with event changes, no shift in the middle.
    squares
        (k, 2) squares of both changes.
    slopes
        (k, 3, 2) as ``slope_sums`` gives them.
    """

    patches: Float64
    squares: Float64
    slopes: Float64

    @staticmethod
    def stacked(sums: "Sequence[ShiftSums]") -> "ShiftSums":
        """Return sums of one part each as those of as many parts."""
        return ShiftSums(*(np.array([getattr(each, name) for each in sums]) for name in ShiftSums.__slots__))

    @staticmethod
    def added(sums: "Sequence[ShiftSums]") -> "ShiftSums":
        """Return the sums of the same parts over all of some intervals."""
        return ShiftSums(*(np.sum([getattr(each, name) for each in sums], axis=0) for name in ShiftSums.__slots__))


@dataclass(frozen=True, slots=True)
class IntervalChanges:
    """By how much frames and events change between two frames (h, w), and flags of its pixels.

    ``level`` is that of the earlier frame; ``flags`` are those of ``shift_kernels``.
    """

    level: NDArray[np.floating]
    change: Float64
    events: Float64
    flags: NDArray[np.uint8]

    def sums(self, flag: int, boxes: Sequence[tuple[int, int, int, int]]) -> ShiftSums:
        """Return the sums over flagged pixels of parts of the image: top, bottom, left, right."""
        patches = np.empty((len(boxes), 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        squares, slopes = np.empty((len(boxes), 2)), np.zeros((len(boxes), 3, 2))
        for i, box in enumerate(boxes):
            squares[i] = correlate(self.change, self.events, self.flags, flag, box, 0.0, patches[i])
            add_slopes(self.level, self.change, self.flags, flag, box, slopes[i])
        return ShiftSums(patches, squares, slopes)

    def tile_sums(self, flag: int, tiles: int) -> ShiftSums:
        """Return the sums over flagged pixels of each of ``tiles`` by ``tiles`` parts of the image, rows first."""
        rows, columns = ([-(-edge * size // tiles) for edge in range(tiles + 1)] for size in self.flags.shape)
        return self.sums(flag, [(*down, *right) for down in pairwise(rows) for right in pairwise(columns)])

    def patch(self, flag: int) -> Float64:
        """Return the cross-correlation over the flagged pixels of the whole image."""
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
    """Yield the chosen ones of successive intervals, in order; each is overwritten by the next.

    A pixel whose signal changes against its last events is on its way back through both thresholds and has not fired
    yet: its flags exclude it.

    Parameters
    ----------
    signal_of
        Gives the signal (h, w) of a frame, and where it is known.
    counts
        (n - 1, 2, h, w) darker and brighter events.
    threshold_on, threshold_off
        Change of the signal by one event, as positive numbers.
    chosen
        Numbers of intervals, ascending.
    before
        (2, h, w) events before the first interval. The first events of a pixel of which nothing is known before count
        as a change of sign.

    Yields
    ------
    IntervalChanges
        Whose arrays are used again for the next: copy what is needed longer.
    """
    shape, steps = counts.shape[2:], (-threshold_off, threshold_on)
    change, events = np.empty(shape), np.empty(shape)
    signs, flags = np.zeros(shape, np.int8), np.empty(shape, np.uint8)
    if before is not None:
        follow_signs(before, signs)
    for i in range(max(chosen, default=-1) + 1):
        if i not in chosen:
            # Which pixels have turned follows from all events before, also of intervals that are not correlated.
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
        (2 R + 1, 2 R + 1), rows down and columns right, no shift in the middle.

    Returns
    -------
    Shift | None
        None where the largest value is not positive, or lies at the border.
    """
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(correlation)), correlation.shape))
    # A largest value at the border may be the flank of a peak farther out.
    last = 2 * RADIUS_PX
    if correlation[row, column] <= 0 or not (0 < row < last and 0 < column < last):
        return None
    # Parabola through the peak and its neighbours along each axis.
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
        (2,) right and down, px; None where the sum without one of the intervals has no peak.
    """
    peaks = [peak(total - patch) for patch in patches]
    shifts = [(shift.right_px, shift.down_px) for shift in peaks if shift is not None]
    if len(shifts) < len(peaks):
        return None
    return jackknife_errors(shifts)


def slope_sums(level: NDArray[np.floating], change: Float64, usable: Bool) -> Float64:
    """Return sums of slopes over neighbouring usable pixels.

    Parameters
    ----------
    level, change
        (h, w) level of the earlier frame, and its change.
    usable
        (h, w) pixels that count.

    Returns
    -------
    Float64
        (3, 2), to the right and down: absolute slopes of the level, their squares, and squares of the slopes of its
        change; in units of the level a pixel.
    """
    sums = np.zeros((3, 2))
    add_slopes(level, change, usable.view(np.uint8), USABLE, (0, usable.shape[0], 0, usable.shape[1]), sums)
    return sums


def open_level_errors(sums: Float64, threshold: float) -> tuple[Float64, Float64]:
    """Return the standard error (2,) and the lag (2,), px, to the right and down, from ``slope_sums`` of an interval.

    Standard error: C sqrt(2/3 / sum g^2), g the slope of the change. Where little moves e hardly changes from interval
    to interval, so this is not divided by their number. Lag: a level that has risen lies above its reference, by C/2 on
    average, so that events follow the motion by at most C/2 mean|g| / mean g^2, g the slope of the level.

    Parameters
    ----------
    sums
        (3, 2) of ``slope_sums``.
    threshold
        C, in the unit of the level.

    Returns
    -------
    tuple[Float64, Float64]
        (2,) standard errors and (2,) bounds of the lag, px.
    """
    level, level_squares, change_squares = sums
    # At each of two frames the level is uniform over 2 C, of variance (2 C)^2 / 12; so Var(e) = 2/3 C^2.
    # Regression of e on g: C sqrt(2/3 / sum g^2).
    errors = threshold * np.sqrt(2 / 3 / np.maximum(change_squares, 1e-300))
    # Half a threshold of level over the slope is the distance by which events trail.
    lags = threshold / 2 * level / np.maximum(level_squares, 1e-300)
    return errors, lags


@dataclass(frozen=True, slots=True)
class PartShift:
    """The part whose shift along an axis differs most from the usual one.

    Attributes
    ----------
    part, axis
        Number of the part; 0 (right) or 1 (down).
    alike
        (k,) parts that are shifted by more than half as much.
    shift_px, standard_error_px
        Its shift less the median of all parts; the other way round where that lies farther from zero.
    compared
        Parts that were compared.
    """

    part: int
    axis: int
    alike: Bool
    shift_px: float
    standard_error_px: float
    compared: int


def most_shifted(
    sums: ShiftSums, intervals: int, threshold: float, least: float, with_turned: Float64 | None = None
) -> PartShift | None:
    """Return the part that is shifted most against the others; None where too few have a shift of their own.

    Parameters
    ----------
    sums
        Of k parts.
    intervals
        So many were summed in each part; what events leave open hardly changes from one to the next.
    threshold
        C, in the unit of the level.
    least
        Correlation, 0 to 1, below which a part has no peak of its own.
    with_turned
        (k, s, s) correlations including pixels that have turned: by how much these move a peak is an error of its part.

    Returns
    -------
    PartShift | None
        In px, to the right or down.
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
        # Where parts usually scatter beyond their errors, the errors are too small by as much.
        errors = errors * max(1.0, MAD_TO_SIGMA * float(np.median(np.abs(scores))))
    scores = np.where(is_finite[:, np.newaxis], np.abs(deviations) / errors, -1.0)
    part, axis = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))
    shift_px = float(deviations[part, axis])
    alike = is_finite & (deviations[:, axis] / shift_px > 1 / 2) if shift_px else is_finite
    if abs(usual[axis] + shift_px) < abs(usual[axis]):
        # Most parts are shifted, and this one is not.
        alike, shift_px = is_finite & ~alike, -shift_px
    return PartShift(part, axis, alike, shift_px, float(errors[part, axis]), int(np.count_nonzero(is_finite)))


def _vertex(three: Float64) -> float:
    """Return where the parabola through three values at -1, 0, 1 has its top; the middle one is the largest."""
    # (y_- - y_+) / (2 (y_- - 2 y_0 + y_+)), the zero of the derivative of the parabola.
    bend = float(three[0] - 2 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0 else 0.0
