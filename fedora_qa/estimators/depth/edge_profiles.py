"""Image edges around steps of depth: their strength, and their shift along one axis.

Profiles. In an image whose pixels are means over their squares, a sharp edge gives differences of neighbouring pixels.
Averaged over edges at all places within a pixel, and sampled around the step of a depth that is known at pixel centres,
these differences follow the quadratic B-spline: 1/8, 3/4, 1/8. The centroid of a quadratic B-spline over three samples
is its exact place, because B-splines reproduce straight lines (I. J. Schoenberg, Quart. Appl. Math. 4 (1946)).

Errors by texture. Both surfaces beside an outline have texture. The texture moves the peak of the profile towards the
nearer or the farther surface: by l1 where the nearer surface lies on the right (below), and by l2 where it lies on the
left (above), both counted towards the nearer surface. The shift is the mean of both sides; its error is (l1 - l2) / 2.
Half the difference of both sides is the lean, (l1 + l2) / 2. If l1 and l2 have one sign, the lean bounds the error. If
they have different signs, as under light from one side, both peaks are skewed in the same direction; the mean then
changes when one more pixel on each side belongs to the peaks. This change is the skew.

Peaks of the two sides are searched separately. A line beside an outline (a kerb, a shadow, a row of windows) can be
stronger than the outline on one side of an object, but does not have the same distance from it on the other side. If
the peaks of the two sides lie far apart, one of them can be right and the other wrong; the lean is then the error of
the mean.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import DepthSteps
from fedora_qa.estimators.fitting.robust import jackknife_errors

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

RADIUS_PX: Final = 12
"""Farthest shift along an axis that profiles cover, px."""

TILES: Final = 4
"""Tiles of the image in each direction. Profiles are summed by tile, so that the scatter of the tiles can be
estimated."""

_EDGE: Final = np.array([1 / 8, 3 / 4, 1 / 8])
"""Profile of a sharp edge, used as matched filter."""

REACH: Final = 1
"""Samples on each side of the peak that belong to it."""

_SURROUNDINGS: Final = 4
"""Samples on each side of the peak that are used. Those beyond the reach give the background of the peak."""

FARTHEST_PX: Final = RADIUS_PX - _SURROUNDINGS
"""Farthest shift that is measured, px: peak and background must lie in the profile."""

FEWEST_TILES: Final = 5
"""Least number of tiles with steps of depth. The scatter of fewer tiles is too uncertain."""

_MOST_GROUPS: Final = 12
"""Largest number of groups of successive windows that are left out in turn."""


@dataclass(frozen=True, slots=True)
class EdgePeaks:
    """Peaks of profiles of any shape (...).

    Attributes
    ----------
    positions_px
        (...) positions of the peaks relative to the middle of the profile, px.
    fractions
        (...) share of the edge strength of the whole profile that lies in the peak above the background, at most 1.
    """

    positions_px: Float64
    fractions: Float64


def tile_profiles(
    strength: NDArray[Any], steps: DepthSteps, axis: int, positions: tuple[Float64, Float64], *, first_px: float
) -> Float64:
    """Sum edge profiles around steps of depth along an axis, by side and tile.

    Parameters
    ----------
    strength
        (h, w) edge strength, 0 or larger.
    steps
        n steps of depth. The profile of each is divided by its sum, so that all steps have the same weight.
    axis
        Axis of the profiles: 0 to the right, 1 down.
    positions
        Columns and rows (n,) of the steps in the image, px.
    first_px
        Position along the axis of the first value of ``strength``, px: 0 for pixels, 1/2 for differences of neighbours.

    Returns
    -------
    Float64
        (2, tiles, 2 R + 1) sums of profiles, R = ``RADIUS_PX``: first of steps whose farther surface lies on the left
        (above), then of steps whose nearer surface lies there.
    """
    return _tile_profiles(strength, (False, False), steps, axis, positions, first_px, differences=False)


def difference_profiles(
    picture: NDArray[Any], steps: DepthSteps, axis: int, positions: tuple[Float64, Float64],
    mirrored: tuple[bool, bool] = (False, False),
) -> Float64:  # fmt: skip
    """Sum profiles of the absolute differences of neighbouring pixels, as ``tile_profiles`` does.

    Parameters
    ----------
    picture
        (h, w) image.
    steps
        n steps of depth.
    axis
        Axis of the profiles and of the differences: 0 to the right, 1 down.
    positions
        Columns and rows (n,) of the steps in the image, px; in the mirrored image where it is mirrored.
    mirrored
        Whether the picture is first mirrored left to right, and top to bottom.

    Returns
    -------
    Float64
        (2, tiles, 2 R + 1) sums of profiles, as those of ``tile_profiles``.
    """
    return _tile_profiles(picture, mirrored, steps, axis, positions, 0.5, differences=True)


def find_peaks(profiles: Float64) -> NDArray[np.intp]:
    """Return the index (...) of the peak of each profile (..., 2 R + 1).

    Only samples whose surroundings lie in the profile are searched.
    """
    first, last = RADIUS_PX - FARTHEST_PX, profiles.shape[-1] - (RADIUS_PX - FARTHEST_PX)
    before, centre, after = (profiles[..., first + i : last + i] for i in (-1, 0, 1))
    # Matched filter: the profile of a sharp edge, 1/8, 3/4, 1/8 (derivation in the docstring of the module).
    edges = _EDGE[0] * before + _EDGE[1] * centre + _EDGE[2] * after
    peaks: NDArray[np.intp] = first + np.argmax(edges, axis=-1)
    return peaks


def peaks_near(profiles: Float64, samples: NDArray[np.intp], reach: int = REACH) -> EdgePeaks:
    """Return the centroids of profiles around given samples, after subtraction of the background.

    Parameters
    ----------
    profiles
        (..., 2 R + 1) profiles of edge strength.
    samples
        (...) indices near the peak of each profile, as ``find_peaks`` returns them.
    reach
        Samples on each side that belong to the peak.

    Returns
    -------
    EdgePeaks
        (...) positions within ``reach`` of the samples, px; the sample itself where the peak is not above the
        background.
    """
    offsets, surroundings = np.arange(-reach, reach + 1), np.arange(-_SURROUNDINGS, _SURROUNDINGS + 1)
    near = np.take_along_axis(profiles, samples[..., np.newaxis] + surroundings, axis=-1)
    first, stop = _SURROUNDINGS - reach, _SURROUNDINGS + reach + 1
    # The background changes at the peak: the surfaces on both sides of an outline have different textures.
    before, after = near[..., :first].mean(axis=-1, keepdims=True), near[..., stop:].mean(axis=-1, keepdims=True)
    background = np.where(offsets < 0, before, np.where(offsets > 0, after, 0.5 * (before + after)))
    excess = near[..., first:stop] - background
    strengths = excess.sum(axis=-1)
    # Centroid: the sum of offset times excess over the sum of the excess.
    centroids = np.divide(excess @ offsets, strengths, out=np.zeros_like(strengths), where=strengths > 0)
    positions_px = samples - RADIUS_PX + np.clip(centroids, -reach, reach)
    return EdgePeaks(positions_px, strengths / profiles.sum(axis=-1))


class _Axes(NamedTuple):
    """Layout of the samples of an image in a flat array.

    Attributes
    ----------
    origin
        Index of the first sample.
    along, across
        Steps of the index to the next sample along and across the axis; negative where the image is mirrored.
    length, lines
        Number of samples along and across the axis.
    """

    origin: int
    along: int
    across: int
    length: int
    lines: int


class _Centres(NamedTuple):
    """Positions around which profiles are read.

    Attributes
    ----------
    along, across
        (n,) positions along and across the axis, px.
    near_first
        (n,) True where the nearer surface lies on the left (above).
    """

    along: Float64
    across: Float64
    near_first: NDArray[np.bool_]


def _tile_profiles(
    picture: NDArray[Any], mirrored: tuple[bool, bool], steps: DepthSteps, axis: int,
    positions: tuple[Float64, Float64], first_px: float, *, differences: bool,
) -> Float64:  # fmt: skip
    values = np.ascontiguousarray(picture, dtype=np.float32)
    height, width = values.shape
    # Of columns and rows: index of the first, step of the index to the next, and number.
    columns, rows = (width - 1, -1, width) if mirrored[0] else (0, 1, width), (0, width, height)
    if mirrored[1]:
        rows = ((height - 1) * width, -width, height)
    along, across = (columns, rows) if axis == 0 else (rows, columns)
    sums = np.zeros((2, TILES, TILES, 2 * RADIUS_PX + 1))
    axes = _Axes(along[0] + across[0], along[1], across[1], along[2], across[2])
    centres = _Centres(positions[axis], positions[1 - axis], steps.near_first)
    _add_profiles(values.ravel(), axes, differences, first_px, centres, TILES, sums)
    return sums.reshape(2, TILES * TILES, -1)


@njit(cache=True)
def _add_profiles(
    values: Float32, axes: _Axes, differences: bool, first_px: float, centres: _Centres, tiles: int, sums: Float64
) -> None:
    """Add profiles of an image along one axis, each divided by its sum, to the sums of their side and tile.

    Parameters
    ----------
    values, axes
        (h * w,) the image, and the layout of its samples.
    differences
        Whether profiles are of the absolute differences of neighbours along the axis instead of the image itself.
    first_px
        Position of the first sample along the axis, px.
    centres
        Positions around which profiles of m samples are read, with bilinear interpolation. Positions whose profile
        would leave the image are left out.
    tiles
        Number t of tiles in each direction.
    sums
        (2, t, t, m) is added to: by side, tile across the axis, tile along the axis.
    """
    m = sums.shape[3]
    length, lines = axes.length - differences, axes.lines
    samples, next_line, profile = np.empty(m + 1), np.empty(m + 1), np.empty(m)
    for i in range(len(centres.along)):
        start, line = centres.along[i] - first_px - (m // 2), centres.across[i]
        if not (start >= 0 and start + m - 1 <= length - 1 and 0 <= line <= lines - 1):
            continue
        # Bilinear: between two lines first, then between two samples of the line.
        first, upper = int(start), int(line)
        part_along, part_across = start - first, line - upper
        origin = axes.origin + upper * axes.across + first * axes.along
        _read_line(values, origin, axes.along, length - first, differences, samples)
        if part_across > 0:
            _read_line(values, origin + axes.across, axes.along, length - first, differences, next_line)
            for k in range(m + 1):
                samples[k] += part_across * (next_line[k] - samples[k])
        total = 0.0
        for k in range(m):
            profile[k] = samples[k] + part_along * (samples[k + 1] - samples[k])
            total += profile[k]
        if total > 0.0:
            side, column = int(centres.near_first[i]), min(int(centres.along[i] * tiles / length), tiles - 1)
            tile_sums = sums[side, min(int(line * tiles / lines), tiles - 1), column]
            for k in range(m):
                tile_sums[k] += profile[k] / total


@njit(cache=True)
def _read_line(values: Float32, start: int, along: int, count: int, differences: bool, samples: Float64) -> None:
    """Write samples from an index on; after ``count`` samples the last one is repeated."""
    for k in range(len(samples)):
        index = start + min(k, count - 1) * along
        value = np.float64(values[index])
        samples[k] = abs(np.float64(values[index + along]) - value) if differences else value


@njit(cache=True)
def root_counts(columns: Int64, rows: Int64, height: int, width: int) -> Float32:
    """Return the square root of the number of points in each pixel.

    Parameters
    ----------
    columns, rows
        (n,) pixels of the points, px; points outside of the image do not count.
    height, width
        Size H, W of the image, px.

    Returns
    -------
    Float32
        (H, W).
    """
    counts = np.zeros((height, width), np.float32)
    # Counts are stored as negative numbers until their root is taken, so that no pass over all pixels is needed.
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            counts[rows[i], columns[i]] -= 1
    for i in range(len(rows)):
        if 0 <= columns[i] < width and 0 <= rows[i] < height:
            count = counts[rows[i], columns[i]]
            counts[rows[i], columns[i]] = np.sqrt(-count) if count < 0 else count
    return counts


@dataclass(frozen=True, slots=True)
class EdgeShift:
    """Shift of image edges relative to the steps of depth along one axis.

    Attributes
    ----------
    shift_px, standard_error_px
        Shift of the image edges to the right (down), px of the image, and its standard error by leaving out tiles and
        groups of windows in turn (jackknife).
    lean_px
        Mean shift of the peaks of both sides towards the nearer surface, px.
    skew_px
        Change of the shift when one more pixel on each side belongs to the peaks, px.
    peak_fraction, peak_fraction_error
        Share (0 to 1) of the edge strength within the radius that lies in the peak above the background, and its
        standard error.
    """

    shift_px: float
    standard_error_px: float
    lean_px: float
    skew_px: float
    peak_fraction: float
    peak_fraction_error: float

    @property
    def model_error_bound_px(self) -> float:
        """Bound on the error of the shift by texture, px: lean and skew each measure a part of this error.

        If the peaks of the two sides lie farther apart than an edge reaches, only one of them is right. Its own lean,
        up to ``REACH``, is added.
        """
        single_lean_px = REACH if abs(self.lean_px) > REACH else 0
        return math.hypot(self.lean_px, self.skew_px) + single_lean_px


def edge_shift(sums: Float64) -> EdgeShift | None:
    """Estimate the shift of image edges against steps of depth along one axis.

    Parameters
    ----------
    sums
        (windows, 2, tiles, 2 R + 1) sums of profiles of each window, as those of ``tile_profiles``.

    Returns
    -------
    EdgeShift | None
        None where fewer than five tiles have steps of depth, or one side has none.
    """
    total = sums.sum(axis=0)
    occupied = np.flatnonzero(total.sum(axis=(0, 2)))
    if len(occupied) < FEWEST_TILES or not np.all(total.sum(axis=(1, 2)) > 0):
        return None
    sides = total.sum(axis=1)
    shift_px, lean_px = (float(value) for value in _shifts_and_leans(sides, REACH))
    wider_px = float(_shifts_and_leans(sides, REACH + 1)[0])

    # Texture varies between tiles; the effects of noise and motion vary between windows.
    by_window = sums.sum(axis=2)
    groups = np.array_split(by_window, min(len(by_window), _MOST_GROUPS))
    by_tile = _jackknife(sides - np.moveaxis(total[:, occupied], 1, 0))
    by_time = _jackknife(sides - np.array([group.sum(axis=0) for group in groups]))
    shift_error, fraction_error = np.hypot(by_tile, by_time)
    return EdgeShift(
        shift_px,
        float(shift_error),
        lean_px,
        wider_px - shift_px,
        float(_peak_fractions(sides)),
        float(fraction_error),
    )


def peak_fraction_gain(sums: Float64, other: Float64) -> tuple[float, float]:
    """Return by how much a second peak of the same steps of depth exceeds a first one, and its standard error.

    The difference is taken of both before parts are left out: texture that both share has no effect on it.

    Parameters
    ----------
    sums, other
        (windows, 2, tiles, 2 R + 1) sums of profiles, as those of ``edge_shift``.

    Returns
    -------
    tuple
        Difference of ``EdgeShift.peak_fraction``; both are 0 where fewer than five tiles have steps of depth.
    """
    both = np.stack([sums, other])
    total = both.sum(axis=1)
    occupied = np.flatnonzero(np.all(total.sum(axis=(1, 3)) > 0, axis=0))
    if len(occupied) < FEWEST_TILES:
        return 0.0, 0.0
    sides, by_window = total.sum(axis=2), both.sum(axis=3)
    groups = np.array_split(by_window, min(by_window.shape[1], _MOST_GROUPS), axis=1)
    left_out = (
        sides[:, np.newaxis] - np.moveaxis(total[:, :, occupied], 2, 1),
        sides[:, np.newaxis] - np.stack([group.sum(axis=1) for group in groups], axis=1),
    )
    errors = [
        jackknife_errors(np.diff(_peak_fractions(each), axis=0).T)[0] if each.shape[1] > 1 else 0.0 for each in left_out
    ]
    return float(np.diff(_peak_fractions(sides))[0]), float(np.linalg.norm(errors))


def _shifts_and_leans(sides: Float64, reach: int) -> tuple[Float64, Float64]:
    """Return shifts and leans (...), px, from one profile for each side, (..., 2, 2 R + 1)."""
    # shift = (far + near) / 2, lean = (far - near) / 2: positions of the peaks of both sides.
    peaks = peaks_near(sides, find_peaks(sides), reach)
    far_px, near_px = peaks.positions_px[..., 0], peaks.positions_px[..., 1]
    return 0.5 * (far_px + near_px), 0.5 * (far_px - near_px)


def _peak_fractions(sides: Float64) -> Float64:
    """Return the shares (...) of edge strength in the peak of the sum of both sides."""
    samples = find_peaks(sides.sum(axis=-2))
    fractions: Float64 = peaks_near(sides, np.stack([samples, samples], axis=-1)).fractions.mean(axis=-1)
    return fractions


def _jackknife(left_out: Float64) -> Float64:
    """Return the standard errors (2,) of shift, px, and fraction, from k sums (k, 2, 2 R + 1) that leave out one part.

    They are 0 where fewer than two sums have profiles of both sides.
    """
    usable = left_out[np.all(left_out.sum(axis=2) > 0, axis=1)]
    if len(usable) <= 1:
        return np.zeros(2)
    return jackknife_errors(np.array([_shifts_and_leans(usable, REACH)[0], _peak_fractions(usable)]).T)
