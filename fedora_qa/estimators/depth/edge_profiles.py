"""Image edges around steps of depth: how strong they are, and by how much they are shifted along one axis.

A picture in which each pixel is the mean over its own square shows a sharp edge as a difference of neighbours that
follows, over edges at all places within their pixel, the quadratic B-spline: 1/8, 3/4, 1/8 at the steps of a depth
sampled at pixel centres. The centroid of a quadratic B-spline over three samples is its exact place, because B-splines
reproduce straight lines (I. J. Schoenberg, Quart. Appl. Math. 4 (1946)).

The surfaces on both sides of an outline have texture of their own, which moves the peak of its profile along the line
from the farther to the nearer side, one way or the other: by l1 on the one side of things and l2 on the other, both
counted towards the nearer. The shift is the mean of both sides, which errs by (l1 - l2) / 2. Half their difference is
(l1 + l2) / 2, the lean, which bounds that where both lean alike, towards the nearer or away from it. Where one leans
to the nearer and the other away, as under light from one side, both peaks are skewed the same way: taking in one more
pixel on either side then moves the mean.

Each side is looked for by itself: a line beside an outline (a kerb, a shadow, a row of windows) may outshine it on one
side of things, and does not stand as far off the same way on the other. Where the two sides lie apart,
one of them may be in place and the other not, and the lean states by how much the mean then errs.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_steps import DepthSteps
from fedora_qa.estimators.fitting.robust import jackknife_errors

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

RADIUS_PX: Final = 12
"""Farthest shift along an axis that profiles cover, px."""

TILES: Final = 4
"""Tiles of the image in each direction over which profiles are kept apart, for the spread between them."""

_EDGE: Final = np.array([1 / 8, 3 / 4, 1 / 8])
"""Profile of an edge: the filter that finds it best."""

REACH: Final = 1
"""Samples on either side of the peak that belong to it."""

_SURROUNDINGS: Final = 4
"""Samples on either side of the peak that are used: those beyond the reach give the background there."""

FARTHEST_PX: Final = RADIUS_PX - _SURROUNDINGS
"""Farthest shift that is measured: peak and background must lie in the profile."""

FEWEST_TILES: Final = 5
"""Tiles with steps of depth below which their spread is no estimate."""

_MOST_GROUPS: Final = 12
"""Groups of successive windows that are left out in turn."""


@dataclass(frozen=True, slots=True)
class EdgePeaks:
    """Where profiles peak, px, and the fraction (0 to 1) of edge strength in each peak beyond the background."""

    positions_px: Float64
    fractions: Float64


def tile_profiles(
    strength: NDArray[Any], steps: DepthSteps, axis: int, positions: tuple[Float64, Float64], *, first_px: float
) -> Float64:
    """Sum edge profiles along an axis by side and tile.

    Parameters
    ----------
    strength
        (h, w) edge strength; along the axis its first value lies at ``first_px`` (1/2 for differences of neighbours).
    steps
        Steps of depth; each counts alike: its profile is divided by its sum.
    axis
        0 to the right, 1 down.
    positions
        Columns and rows (n,) of the steps in that image, px.

    Returns
    -------
    NDArray
        (2, tiles, 2 R + 1): far side first, then near side first.
    """
    return _tile_profiles(strength, (False, False), steps, axis, positions, first_px, differences=False)


def difference_profiles(
    picture: NDArray[Any], steps: DepthSteps, axis: int, positions: tuple[Float64, Float64],
    mirrored: tuple[bool, bool] = (False, False),
) -> Float64:  # fmt: skip
    """Return ``tile_profiles`` of the absolute differences of a picture's (h, w) neighbours along the axis.

    ``mirrored`` states whether the picture is mirrored left to right, and top to bottom.
    """
    return _tile_profiles(picture, mirrored, steps, axis, positions, 0.5, differences=True)


def find_peaks(profiles: Float64) -> NDArray[np.intp]:
    """Return the sample at which each profile (..., 2 R + 1) peaks, among those whose surroundings lie in it."""
    first, last = RADIUS_PX - FARTHEST_PX, profiles.shape[-1] - (RADIUS_PX - FARTHEST_PX)
    before, centre, after = (profiles[..., first + i : last + i] for i in (-1, 0, 1))
    # Matched filter: the profile of a sharp edge, 1/8, 3/4, 1/8 (derivation in the docstring of the module).
    edges = _EDGE[0] * before + _EDGE[1] * centre + _EDGE[2] * after
    peaks: NDArray[np.intp] = first + np.argmax(edges, axis=-1)
    return peaks


def peaks_near(profiles: Float64, samples: NDArray[np.intp], reach: int = REACH) -> EdgePeaks:
    """Return the centroids around some samples, after taking off a background that may step there.

    Parameters
    ----------
    profiles
        (..., 2 R + 1) of edge strength.
    samples
        (...) about where each profile peaks, as from ``find_peaks``.
    reach
        Samples on either side that belong to the peak.
    """
    offsets, surroundings = np.arange(-reach, reach + 1), np.arange(-_SURROUNDINGS, _SURROUNDINGS + 1)
    near = np.take_along_axis(profiles, samples[..., np.newaxis] + surroundings, axis=-1)
    first, stop = _SURROUNDINGS - reach, _SURROUNDINGS + reach + 1
    # The background steps at the peak: surfaces on both sides of an outline have textures of their own.
    before, after = near[..., :first].mean(axis=-1, keepdims=True), near[..., stop:].mean(axis=-1, keepdims=True)
    background = np.where(offsets < 0, before, np.where(offsets > 0, after, 0.5 * (before + after)))
    excess = near[..., first:stop] - background
    strengths = excess.sum(axis=-1)
    centroids = np.divide(excess @ offsets, strengths, out=np.zeros_like(strengths), where=strengths > 0)
    positions_px = samples - RADIUS_PX + np.clip(centroids, -reach, reach)
    return EdgePeaks(positions_px, strengths / profiles.sum(axis=-1))


class _Axes(NamedTuple):
    """How samples of an image lie in one row of all of them.

    ``origin`` is the first one's index, ``along`` and ``across`` are the ways to the next along and across the axis,
    ``length`` and ``lines`` how many there are each way.
    """

    origin: int
    along: int
    across: int
    length: int
    lines: int


class _Centres(NamedTuple):
    """Positions (n,) around which profiles are read, px of the samples, and their sides."""

    along: Float64
    across: Float64
    near_first: NDArray[np.bool_]


def _tile_profiles(
    picture: NDArray[Any], mirrored: tuple[bool, bool], steps: DepthSteps, axis: int,
    positions: tuple[Float64, Float64], first_px: float, *, differences: bool,
) -> Float64:  # fmt: skip
    values = np.ascontiguousarray(picture, dtype=np.float32)
    height, width = values.shape
    # Where each column and row of pixels begins among all of them, and how far it is to the next.
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
    """Add profiles of an image along one axis, each divided by its sum, to those of its side and tile, (2, t, t, m).

    Parameters
    ----------
    values, axes
        An image, all in one row (h * w,), and how its samples lie there.
    differences
        Whether the absolute differences of neighbours along the axis are meant, and not the image itself.
    first_px
        Where the first sample lies along the axis.
    centres
        Positions around which profiles of m samples are read, between samples linearly. Those whose profile would
        leave the image are left out. Tiles are counted across first.
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
    """Write samples from an index on; beyond ``count`` of them the last one is repeated."""
    for k in range(len(samples)):
        index = start + min(k, count - 1) * along
        value = np.float64(values[index])
        samples[k] = abs(np.float64(values[index + along]) - value) if differences else value


@njit(cache=True)
def root_counts(columns: Int64, rows: Int64, height: int, width: int) -> Float32:
    """Return the square root of how many of some points (n,) lie in each pixel, (H, W); others do not count."""
    counts = np.zeros((height, width), np.float32)
    # Counts are negative until their root has been taken: one pass over the points, none over the pixels.
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
    """Place of the edges relative to the steps of depth.

    Attributes
    ----------
    shift_px, standard_error_px
        To the right (down), px of the picture; the error from leaving out tiles, and segments of time, in turn.
    lean_px
        How far textures draw the peak towards the nearer side.
    skew_px
        By how much the shift changes when one more pixel on either side belongs to the peaks.
    peak_fraction, peak_fraction_error
        Fraction of all edge strength within the radius that lies in the peak, beyond the background.
    """

    shift_px: float
    standard_error_px: float
    lean_px: float
    skew_px: float
    peak_fraction: float
    peak_fraction_error: float

    @property
    def model_error_bound_px(self) -> float:
        """How far texture may move the shift: lean and skew each measure a part of that.

        Of sides further apart than one edge reaches, only one is in place, and may lean by itself.
        """
        single_lean_px = REACH if abs(self.lean_px) > REACH else 0
        return math.hypot(self.lean_px, self.skew_px) + single_lean_px


def edge_shift(sums: Float64) -> EdgeShift | None:
    """Estimate the shift of image edges against steps of depth along one axis.

    Parameters
    ----------
    sums
        (windows, 2, tiles, 2 R + 1) sums of profiles, far side first.

    Returns
    -------
    EdgeShift | None
        None where there are too few steps of depth.
    """
    total = sums.sum(axis=0)
    occupied = np.flatnonzero(total.sum(axis=(0, 2)))
    if len(occupied) < FEWEST_TILES or not np.all(total.sum(axis=(1, 2)) > 0):
        return None
    sides = total.sum(axis=1)
    shift_px, lean_px = (float(value) for value in _shifts_and_leans(sides, REACH))
    wider_px = float(_shifts_and_leans(sides, REACH + 1)[0])

    # Texture differs from tile to tile, and what noise and motion make of it from time to time.
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


def _shifts_and_leans(sides: Float64, reach: int) -> tuple[Float64, Float64]:
    """Return shifts and leans (...) from one profile a side, (..., 2, 2 R + 1)."""
    peaks = peaks_near(sides, find_peaks(sides), reach)
    far_px, near_px = peaks.positions_px[..., 0], peaks.positions_px[..., 1]
    return 0.5 * (far_px + near_px), 0.5 * (far_px - near_px)


def _peak_fractions(sides: Float64) -> Float64:
    """Return the fractions (...) of edge strength where both sides together peak."""
    samples = find_peaks(sides.sum(axis=-2))
    fractions: Float64 = peaks_near(sides, np.stack([samples, samples], axis=-1)).fractions.mean(axis=-1)
    return fractions


def _jackknife(left_out: Float64) -> Float64:
    """Return the standard errors of shift and fraction, of sums (k, 2, 2 R + 1) with one part left out each.

    They are 0 where nothing could be left out.
    """
    usable = left_out[np.all(left_out.sum(axis=2) > 0, axis=1)]
    if len(usable) <= 1:
        return np.zeros(2)
    return jackknife_errors(np.array([_shifts_and_leans(usable, REACH)[0], _peak_fractions(usable)]).T)
