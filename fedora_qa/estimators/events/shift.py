"""Shift of events against frames: the peak of their cross-correlation, and its errors.

The events of a pixel determine its level only to within a threshold C on each side. Their sum differs from the change
of the level between two frames by e, of variance 2/3 C^2. If the change of the level has the slope g, the peak of the
correlation moves by the coefficient of the regression of e on g.

A correlation at whole shifts does not determine its values between them, because scenes have edges sharper than a
pixel: at whole shifts a spatial frequency f (1/px) has the same values as f - 1. A parabola through three values draws
the peak to whole pixels: a shift of 0.3 px gives 0.16 px. Frames, however, can be resampled anywhere. At the corners of
pixels, half a pixel to the right and down, they give the correlation at half shifts too. Both lattices together are a
quincunx, on which f has the same values as f + (1, 1) and f + (1, -1), but not as f + (1, 0). Smoothing by a Gaussian
of standard deviation s multiplies f by exp(-2 pi^2 s^2 |f|^2). With s = ``SMOOTHING_PX`` the equivalents of frequencies
along an axis, at 1 / px or more, are multiplied by less than 1e-4. The smoothed sum over both lattices is then that
over all shifts, and its peak is not drawn anywhere.

A sum of products also grows with the energies (sums of squares) of both images in its pairs, so that it can peak at
another, stronger edge. Within a part that is hardly larger than the shifts, pairs are few at far shifts, and chance
correlates them most: a product scaled by the number of pairs peaks there. Events of a part are therefore paired with
frames beyond it, so that pairs are lost at the border of the image only. Each sum is divided by the root of both
energies, which bounds it by 1 (Cauchy and Schwarz) with equality where both images are alike. Shifts at which less than
``LEAST_PAIRS`` of the part have a partner are not compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.shift_errors import bracketed_level_errors
from fedora_qa.estimators.events.shift_kernels import (
    FIRED,
    KNOWN,
    OPEN,
    RADIUS,
    USABLE,
    add_slopes,
    correlate,
    correlate_with_itself,
)
from fedora_qa.estimators.fitting.robust import jackknife_errors, robust_sigma

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

RADIUS_PX: Final = RADIUS
"""Farthest shift that is tried in each direction, px."""

CLEAR: Final = 0.5
"""Correlation above which the peak of a tile comes from the scene of the tile. Tiles contain few edges, and parallel
edges correlate by chance."""

LEAST_PAIRS: Final = 0.5
"""Least share of the pixels of a part that have a partner in the image. A correlation by chance is inverse to the root
of the number of pairs: at all shifts that are compared, it is at most 1.4 times that at no shift."""

FEWEST_PARTS: Final = 4
"""Least number of parts with a peak: with fewer, no part can differ from the others."""

SMOOTHING_PX: Final = 0.7
"""Standard deviation of the Gaussian that smooths a correlation on both lattices, px (module docstring). With 0.5 px a
shift of 0.3 px is drawn to whole pixels by 5%, with 0.7 px by 1%; errors by noise grow with it."""

_MOST_GROUPS: Final = 30
"""Groups of a jackknife: its error is then itself certain to 1 / sqrt(2 * 29), 13%."""

_MOST_STEPS, _CONVERGED_PX, _FARTHEST_PX = 30, 1e-6, 1.5
"""Newton's method takes three to six steps to the peak, which lies within a pixel of the largest value."""

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
    whole = 0, usable.shape[0], 0, usable.shape[1]
    correlate(change, events, flags, flags, USABLE, whole, whole, rest, patch, np.empty((2, 0, 0)))
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
        (k, 2, s, s) cross-correlations of frame changes with event changes, s = 2 R + 1, as ``lattice_peak`` takes
        them: divided by the root of both energies at a shift, and multiplied by that at no shift.
    squares
        (k, 2) sums of squares of frame changes and of event changes.
    slopes
        (k, 3, 2) sums of slopes, as ``slope_sums`` returns them, where the change by events is known.
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


@dataclass(frozen=True)
class IntervalChanges:
    """Changes by frames and by events between two frames, and flags of the pixels.

    Attributes
    ----------
    level
        (h, w) level of the earlier frame.
    changes
        Changes (h, w) by frames at the centres of the pixels, and at their corners, half a pixel to the right and down.
    flags
        (h, w) flags of ``shift_kernels`` for both changes.
    events
        (h, w) changes by events, in the unit of the level.
    """

    level: NDArray[np.floating]
    changes: tuple[Float64, Float64]
    flags: tuple[NDArray[np.uint8], NDArray[np.uint8]]
    events: Float64

    def sums(self, boxes: Sequence[tuple[int, int, int, int]]) -> ShiftSums:
        """Return the sums over the usable pixels of parts of the image, whose events are paired with all frames.

        Parameters
        ----------
        boxes
            Top, bottom, left and right of each of the k parts, px, half open.

        Returns
        -------
        ShiftSums
            Of the k parts.
        """
        patches = np.empty((len(boxes), 2, 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        squares, slopes = np.empty((len(boxes), 2)), np.zeros((len(boxes), 3, 2))
        for i, box in enumerate(boxes):
            squares[i] = self._correlate(self.events, box, patches[i])
            add_slopes(self.level, self.changes[0], self.flags[0], KNOWN, box, slopes[i])
        return ShiftSums(patches, squares, slopes)

    def tile_sums(self, tiles: int) -> ShiftSums:
        """Return the sums over the usable pixels of each tile of the image.

        Parameters
        ----------
        tiles
            Number of tiles along each axis.

        Returns
        -------
        ShiftSums
            Of tiles^2 parts, by rows.
        """
        rows, columns = ([-(-edge * size // tiles) for edge in range(tiles + 1)] for size in self.events.shape)
        return self.sums([(*down, *right) for down in pairwise(rows) for right in pairwise(columns)])

    def lag_sums(self) -> Float64:
        """Return the sums (4, 2) to the right and down by which ``shift_errors.reference_lags`` bounds a lag.

        Of |g| at pixels whose change by events is not known, of g^2 at all pixels with a change by events, of h^2 and
        of c^2 at all usable pixels: g is the slope of the level, h that of its change, c the change less its mean.
        """
        whole, sums = (0, self.level.shape[0], 0, self.level.shape[1]), np.zeros((3, 3, 2))
        for flag, of_flag in zip((OPEN, FIRED, USABLE), sums, strict=True):
            add_slopes(self.level, self.changes[0], self.flags[0], flag, whole, of_flag)
        usable = self.changes[0][(self.flags[0] & USABLE) > 0]
        squares = usable.size * np.var(usable) if usable.size else 0.0
        return np.array([sums[0, 0], sums[1, 1], sums[2, 2], [squares, squares]])

    def patches(self, events: Float64) -> Float64:
        """Return the correlations (2, 2 R + 1, 2 R + 1) of the whole image with other changes (h, w) by events."""
        patches = np.empty((2, 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        self._correlate(events, (0, events.shape[0], 0, events.shape[1]), patches)
        return patches

    @cached_property
    def areas(self) -> tuple[tuple[int, int, int, int] | None, ...]:
        """Rectangle around the usable pixels of each change: top, bottom, left and right, px; None without any."""
        areas: list[tuple[int, int, int, int] | None] = []
        for flags in self.flags:
            rows, columns = (np.flatnonzero(flags.any(axis=axis)) for axis in (1, 0))
            area = (int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1) if len(rows) else None
            areas.append(area)
        return tuple(areas)

    def _correlate(self, events: Float64, box: tuple[int, int, int, int], patches: Float64) -> tuple[float, float]:
        """Write the correlations (2, 2 R + 1, 2 R + 1) of a part, and return the sums of squares of both changes."""
        squares, at_no_shift, energies = [], 0.0, np.empty((2, *patches.shape[1:]))
        for change, flags, area, patch in zip(self.changes, self.flags, self.areas, patches, strict=True):
            # Without usable pixels the correlation is 0, whatever the area.
            # Events lie at the centres of pixels, whichever the lattice of the changes.
            squares.append(
                correlate(change, events, flags, self.flags[0], USABLE, box, area or box, 0.0, patch, energies)
            )
            # Of an image with fewer pixels than tiles, some tiles are empty.
            if area is None or box[0] == box[1] or box[2] == box[3]:
                continue
            roots = np.sqrt(np.maximum(energies.prod(axis=0), 0.0))
            # Of both lattices, the centres come first.
            at_no_shift = at_no_shift or roots[RADIUS_PX, RADIUS_PX]
            # rho(s) = sum c(x - s) e(x) / sqrt(sum c(x - s)^2 sum e(x)^2), over the pairs at s (module docstring). To
            # keep sums over intervals weighted by energy, it is multiplied by the root of both energies at no shift.
            # Energies are differences of running sums, whose rounding has a root of 1e-7 of the largest.
            counts = (roots > 1e-6 * roots.max()) & (_share_of_pairs(box, area) >= LEAST_PAIRS)
            patch[:] = np.where(counts, patch * at_no_shift / np.where(counts, roots, 1.0), 0.0)
        return squares[0]


@lru_cache(maxsize=256)
def _share_of_pairs(box: tuple[int, int, int, int], area: tuple[int, int, int, int]) -> Float64:
    """Return the share of the pixels of a part whose partners lie within an area, by shifts as in a correlation."""
    shifts, shares = np.arange(-RADIUS_PX, RADIUS_PX + 1), []
    for start, stop, first, last in zip(box[::2], box[1::2], area[::2], area[1::2], strict=True):
        # The partner of x is x - s.
        partners = np.arange(start, stop) - shifts[:, np.newaxis]
        shares.append(np.mean((partners >= first) & (partners < last), axis=1))
    share: Float64 = np.outer(*shares)
    return share


def lattice_peak(correlations: Float64) -> Shift | None:
    """Return the shift of the peak of a correlation that is sampled at whole and at half shifts, and smoothed.

    Parameters
    ----------
    correlations
        (2, 2 R + 1, 2 R + 1) by shifts down (rows) and to the right (columns): whole shifts, no shift in the middle,
        and shifts that are smaller by half a pixel along both axes. 0 where there are too few pairs.

    Returns
    -------
    Shift | None
        None where the largest value is not positive, or lies at the border, or is no peak after smoothing.
    """
    which, row, column = (int(i) for i in np.unravel_index(int(np.argmax(correlations)), correlations.shape))
    # A largest value at the border can belong to a peak outside of the range. Shifts without enough pairs have zeros.
    around = correlations[which, max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    if correlations[which, row, column] <= 0 or around.size < 9 or not around.all():
        return None
    shifts = np.arange(-RADIUS_PX, RADIUS_PX + 1.0) - np.array([[0.0], [0.5]])
    start = np.array([shifts[which, row], shifts[which, column]])
    position = start.copy()
    for _ in range(_MOST_STEPS):
        # Derivatives of S(x) = sum_l R(l) exp(-|l - x|^2 / (2 s^2)) over both lattices, with x in units of s: [i, j] is
        # of order i down and j to the right. The orders along an axis are by lattice, axis and order.
        apart = (shifts[:, np.newaxis] - position[:, np.newaxis]) / SMOOTHING_PX
        gaussian = np.exp(-(apart**2) / 2)
        orders = np.stack([gaussian, apart * gaussian, (apart**2 - 1) * gaussian], axis=2)
        derivatives = (orders[:, 0] @ correlations @ orders[:, 1].swapaxes(1, 2)).sum(axis=0)
        value, gradient = derivatives[0, 0], np.array([derivatives[1, 0], derivatives[0, 1]])
        mixed = derivatives[1, 1]
        curvature = np.array([[derivatives[2, 0], mixed], [mixed, derivatives[0, 2]]])
        if value <= 0:
            return None
        # Newton's step near a maximum, where the determinant and minus the trace are positive; else a step uphill.
        is_concave = np.linalg.det(curvature) > 0 and np.trace(curvature) < 0
        step = SMOOTHING_PX * (-np.linalg.solve(curvature, gradient) if is_concave else gradient / value)
        position += np.clip(step, -0.5, 0.5)
        if np.abs(position - start).max() > _FARTHEST_PX:
            return None
        if np.abs(step).max() < _CONVERGED_PX:
            return Shift(right_px=float(position[1]), down_px=float(position[0]))
    return None


def lattice_spread(patches: Float64) -> Float64 | None:
    """Return the standard error of ``lattice_peak`` of the sum of correlations by the delete-one jackknife.

    Parameters
    ----------
    patches
        (k, 2, s, s) correlations of single parts. Many parts are joined to groups of successive ones.

    Returns
    -------
    Float64 | None
        (2,) to the right and down, px; None where the sum without one of the parts or groups has no peak.
    """
    total, groups = patches.sum(axis=0), np.array_split(patches, max(1, min(len(patches), _MOST_GROUPS)))
    peaks = [lattice_peak(total - group.sum(axis=0)) for group in groups]
    shifts = [(shift.right_px, shift.down_px) for shift in peaks if shift is not None]
    if len(shifts) < len(peaks):
        return None
    return jackknife_errors(shifts)


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


def slopes_where_fired(level: NDArray[np.floating], change: Float64, usable: Bool) -> Float64:
    """Return sums of slopes over the pixels that are expected to fire.

    A pixel fires in proportion to its change. Weights by the change, unlike those by events, are in place whatever the
    shift of the events.

    Parameters
    ----------
    level, change
        (h, w) level of the earlier frame, and its absolute change.
    usable
        (h, w) True for pixels that count.

    Returns
    -------
    Float64
        (2, 2): sums of w |g| and of w g^2, to the right and down, with g the slope of the level in its unit / px, and w
        the change.
    """
    sums = np.zeros((2, 2))
    for i, axis in enumerate((1, 0)):
        pairs = [(np.delete(image, -1, axis), np.delete(image, 0, axis)) for image in (level, change, usable)]
        (here, there), (changed, changed_there), (counts, counts_there) = pairs
        both = counts & counts_there
        slopes = np.abs(there[both].astype(np.float64) - here[both])
        weights = changed[both] + changed_there[both]
        sums[:, i] = weights @ slopes, weights @ slopes**2
    return sums


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


@dataclass(frozen=True, slots=True)
class PartShifts:
    """Shifts of k parts with their standard errors.

    Attributes
    ----------
    shifts_px
        (k, 2) to the right and down, px; NaN for parts without a peak of their own.
    errors_px
        (k, 2) standard errors, px; infinite for such parts.
    """

    shifts_px: Float64
    errors_px: Float64

    @property
    def is_finite(self) -> Bool:
        """(k,) True for parts with a peak of their own."""
        return np.asarray(np.isfinite(self.shifts_px).all(axis=1))


def shifts_of_parts(
    sums: ShiftSums,
    intervals: int,
    threshold: float,
    least: float,
    *,
    spreads: Sequence[Float64 | None] | None = None,
    variants: Sequence[Float64] = (),
) -> PartShifts:
    """Return the shift of each part.

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
    spreads
        Standard errors (2,) of each part by the jackknife, which count where they are larger; a part with None is not
        compared. None: no such errors.
    variants
        (k, 2, s, s) correlations with the level changes of other assumptions. The distances of their peaks are added to
        the error of a part.

    Returns
    -------
    PartShifts
        Of the k parts.
    """
    count = len(sums.patches)
    shifts, errors = np.full((count, 2), np.nan), np.full((count, 2), np.inf)
    strengths = sums.patches.max(axis=(1, 2, 3)) / np.maximum(np.sqrt(sums.squares.prod(axis=1)), 1e-300)
    for i in np.flatnonzero(strengths >= least).tolist():
        shift, spread = lattice_peak(sums.patches[i]), np.zeros(2) if spreads is None else spreads[i]
        if shift is not None and spread is not None:
            shifts[i] = shift.right_px, shift.down_px
            errors[i] = np.maximum(bracketed_level_errors(sums.slopes[i] / intervals, threshold), spread)
            for variant in variants:
                other = lattice_peak(variant[i])
                if other is not None:
                    errors[i] = np.hypot(errors[i], (other.right_px - shift.right_px, other.down_px - shift.down_px))
    return PartShifts(shifts, errors)


def most_shifted(parts: PartShifts) -> PartShift | None:
    """Return the part that is shifted most against the others, in standard errors.

    Returns
    -------
    PartShift | None
        None where fewer than four parts have a peak of their own.
    """
    shifts, errors, is_finite = parts.shifts_px, parts.errors_px, parts.is_finite
    if np.count_nonzero(is_finite) < FEWEST_PARTS:
        return None
    usual = np.median(shifts[is_finite], axis=0)
    deviations = shifts - usual
    scores = deviations[is_finite] / errors[is_finite]
    if len(scores) >= _FREEDOM + 2:
        # If the scatter of the parts exceeds their errors, the errors are widened to the scatter.
        errors = errors * max(1.0, float(robust_sigma(scores.ravel(), 0.0)))
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
