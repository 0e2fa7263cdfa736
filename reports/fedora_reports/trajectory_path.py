"""The path of a flight as drawings need it: poses, a box of round metres, frusta, and the camera."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.evidence import FRUSTA, FRUSTUM_CAMERAS, named
from fedora_reports.colour_maps import SEQUENTIAL
from fedora_reports.evidence import Evidence
from fedora_reports.scales import Axis

Float64 = NDArray[np.float64]

MOST_POINTS: Final = 600
"""Largest number of poses of a path on a page."""

_STILL_M: Final = 1e-6
"""A path within this length is a point; it gets a box of a metre."""
_STILL_M_S: Final = 1e-6
_LEAST_SHARES: Final = np.array([0.4, 0.4, 0.15])
"""Least sides of the box as shares of its longest side, so that a straight or a vertical flight has a ground."""


@dataclass(frozen=True, slots=True)
class FlownPath:
    """Poses whose positions are finite, in the order of time; speeds and directions may be NaN.

    Attributes
    ----------
    times_us
        (n,), on the file's clock.
    positions_world_m, forward_world
        (n, 3): positions, and the body's X axis.
    speeds_m_s
        (n,).
    runs
        Half-open ranges of rows between which positions are missing.
    """

    times_us: Float64
    positions_world_m: Float64
    speeds_m_s: Float64
    forward_world: Float64
    runs: tuple[tuple[int, int], ...]

    @property
    def speed_range_m_s(self) -> tuple[float, float] | None:
        """The least and the greatest finite speed; None where there is none."""
        finite = self.speeds_m_s[np.isfinite(self.speeds_m_s)]
        return (float(finite.min()), float(finite.max())) if finite.size else None

    @property
    def speed_varies(self) -> bool:
        """Whether speeds differ by more than a thousandth of the greatest speed, and by more than rounding."""
        low, high = self.speed_range_m_s or (0.0, 0.0)
        return high - low > max(1e-3 * max(abs(low), abs(high)), _STILL_M_S)


@dataclass(frozen=True, slots=True)
class Box:
    """The space of a drawing, metres in the world: whole steps of a round size, ``low`` to ``high`` (3,)."""

    low_m: Float64
    high_m: Float64

    @property
    def centre_m(self) -> Float64:
        """Its centre (3,)."""
        return self.low_m / 2 + self.high_m / 2

    @property
    def span_m(self) -> float:
        """Its longest side."""
        return float(np.max(self.high_m - self.low_m))

    def ticks(self, axis: int, most: int = 7) -> tuple[tuple[float, str], ...]:
        """Return round metres along an axis (0 X, 1 Y, 2 Z) with their labels; short sides get fewer."""
        low, high = float(self.low_m[axis]), float(self.high_m[axis])
        # Far from the origin (1e17 m) metres are below the resolution of float64, and all sides are zero.
        wanted = max(1, round(most * (high - low) / self.span_m)) if self.span_m > 0 else 1
        return tuple((low + tick.share * (high - low), tick.label) for tick in Axis(low, high).ticks(wanted))


def flown_path(times_us: Any, positions_world_m: Any, speeds_m_s: Any, forward_world: Any, *, most: int) -> FlownPath:
    """Keep the poses that can be drawn.

    Parameters
    ----------
    times_us
        (n,), on the file's clock.
    positions_world_m
        (n, 3); a pose whose position is not finite is left out.
    speeds_m_s
        (n,).
    forward_world
        (n, 3), the body's X axis.
    most
        Largest number of poses; more are thinned evenly.

    Raises
    ------
    ValueError
        Where the arrays are not (n,), (n, 3), (n,) and (n, 3).
    """
    times, speeds = np.asarray(times_us, dtype=np.float64), np.asarray(speeds_m_s, dtype=np.float64)
    places, forward = np.asarray(positions_world_m, dtype=np.float64), np.asarray(forward_world, dtype=np.float64)
    shapes = (times.shape, places.shape, speeds.shape, forward.shape)
    n = len(times) if times.ndim == 1 else -1
    if shapes != ((n,), (n, 3), (n,), (n, 3)):
        raise ValueError(f"Expected shapes (n,), (n, 3), (n,) and (n, 3), got {', '.join(map(str, shapes))}")
    thin = np.unique(np.linspace(0, n - 1, most).round().astype(np.intp)) if n > most else np.arange(n)
    kept = thin[np.isfinite(places[thin]).all(axis=1)]
    breaks = np.flatnonzero(np.diff(np.searchsorted(thin, kept)) > 1) + 1
    edges = [0, *breaks.tolist(), len(kept)] if len(kept) else []
    return FlownPath(times[kept], places[kept], speeds[kept], forward[kept], tuple(pairwise(edges)))


def box_around(positions_world_m: Float64) -> Box:
    """Return a box of round metres around finite positions (n, 3), n > 0. A thin side is widened."""
    low, high = positions_world_m.min(axis=0), positions_world_m.max(axis=0)
    span = float(np.max(high - low))
    span = span if span > _STILL_M else 1.0
    sides = np.maximum(high - low, _LEAST_SHARES * span)
    flat_step = round_step_m(span / 10)
    steps = np.array([flat_step, flat_step, round_step_m(sides[2] / 4)])
    middle = low / 2 + high / 2
    return Box(np.floor((middle - sides / 2) / steps) * steps, np.ceil((middle + sides / 2) / steps) * steps)


def speed_colours(n: int) -> tuple[str, ...]:
    """Return n colours from slow to fast, without the darkest and brightest: lines are visible on any background."""
    return tuple("#" + bytes(SEQUENTIAL[level]).hex() for level in np.linspace(64, 250, n).astype(int))


def round_step_m(rough_m: float) -> float:
    """Return the least 1, 2 or 5 times a power of ten that is not below ``rough_m``."""
    power = 10.0 ** np.floor(np.log10(rough_m))
    return float(next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough_m * (1 - 1e-9)))


OUTLINE: Final = (0, 1, 5, 2, 1, 4, 0, 3, 4, 3, 2, 0)
"""Corners of a frustum in the order in which one line draws all of its edges."""

_REACH: Final = 0.1
"""Length of the rays to the corners as a share of the longest side of the box."""
_PEAK: Final = 0.3
"""Height of the peak above the upper edge as a share of the image's height."""


@dataclass(frozen=True, slots=True)
class Frusta:
    """Views of one camera.

    Attributes
    ----------
    camera
        Its stream.
    centres_world_m
        (f, 3) centres of projection.
    rays_world
        (f, 4, 3), to the top left, top right, bottom right and bottom left corner of the image.
    """

    camera: str
    centres_world_m: Float64
    rays_world: Float64

    @property
    def sentence(self) -> str:
        """What a drawing of them shows, for its caption."""
        return f"Frusta show the view of the camera of {self.camera}; a peak marks the upper edge of its image."

    def places(self, box: Box) -> Float64:
        """Return the corners of frusta that do not overlap, about the middle of a box, in units of its longest side.

        One whose centre lies outside of the box is left out, and one of which no corner is as far from that of another
        as the rays are long: neighbours touch at most.

        Returns
        -------
        ndarray
            (g, 6, 3): the centre of projection, the four corners of the image, and a peak above its upper edge.
        """
        with np.errstate(all="ignore"):
            lengths = np.linalg.norm(self.rays_world, axis=-1).max(axis=-1)
            within = ((self.centres_world_m >= box.low_m) & (self.centres_world_m <= box.high_m)).all(axis=-1)
        usable = within & np.isfinite(lengths) & (lengths > 0)
        centres = (self.centres_world_m[usable] - box.centre_m) / box.span_m
        image = self.rays_world[usable] * (_REACH / lengths[usable, None, None])
        top, bottom = image[:, :2].mean(axis=1), image[:, 2:].mean(axis=1)
        peak = top + _PEAK * (top - bottom)
        offsets = np.concatenate([np.zeros_like(peak)[:, None], image, peak[:, None]], axis=1)
        places: Float64 = centres[:, None] + offsets
        apart: list[int] = []
        for row, corners in enumerate(places):
            if all(np.linalg.norm(corners - places[other], axis=-1).max() >= _REACH for other in apart):
                apart.append(row)
        return places[apart]


def frusta_of(evidence: Evidence) -> Frusta | None:
    """Return the frusta of the file; None where none were kept, or their arrays do not fit."""
    for camera in FRUSTUM_CAMERAS:
        centres_m = evidence.numbers(named(FRUSTA, camera, "centres_world_m"), None, 3)
        rays = (
            None if centres_m is None else evidence.numbers(named(FRUSTA, camera, "rays_world"), len(centres_m), 4, 3)
        )
        if centres_m is not None and rays is not None:
            return Frusta(camera, centres_m.astype(np.float64), rays.astype(np.float64))
    return None


_ELEVATION_RAD: Final = np.radians(27.0)
_OFF_THE_SIDE_RAD: Final = np.radians(62.0)
"""Angle between the direction of flight and the direction of the view: a straight flight is shown mostly sideways."""
_USUAL_AZIMUTH_RAD: Final = np.radians(-62.0)
"""A view from the south-south-east, east to the right."""


@dataclass(frozen=True, slots=True)
class View:
    """A perspective camera. ``eye`` and ``target`` (3,); ``axes`` (3, 3): right, up and backward as rows."""

    eye: Float64
    target: Float64
    axes: Float64

    def project(self, points: Float64) -> Float64:
        """Return points (n, 3) as (right, up) slopes (n, 2) off the line of sight."""
        local = (points - self.eye) @ self.axes.T
        slopes: Float64 = local[:, :2] / -local[:, 2:]
        return slopes


def view_of(positions: Float64, corners: Float64, most_slopes: tuple[float, float]) -> View:
    """Return the view across the main direction of a path, from the least distance from which all corners are visible.

    Parameters
    ----------
    positions
        (n, 3), the path.
    corners
        (m, 3), the corners of its box, in the same units.
    most_slopes
        The greatest slopes off the line of sight, to the right and upward.
    """
    # The eye is beside the main horizontal direction, on the side nearest to the usual view.
    azimuth_rad = float(_USUAL_AZIMUTH_RAD)
    flat = positions[:, :2] - positions[:, :2].mean(axis=0)
    spread = flat.T @ flat
    if np.ptp(np.linalg.eigvalsh(spread)) > 0.5 * np.trace(spread):
        main = np.linalg.eigh(spread)[1][:, -1]
        along_rad = np.arctan2(main[1], main[0])
        choices_rad = [along_rad + sign * _OFF_THE_SIDE_RAD + turn for sign in (-1, 1) for turn in (0.0, np.pi)]
        azimuth_rad = float(max(choices_rad, key=lambda choice_rad: np.cos(choice_rad - _USUAL_AZIMUTH_RAD)))
    across = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    backward_axis = np.cos(_ELEVATION_RAD) * across + np.sin(_ELEVATION_RAD) * np.array([0.0, 0.0, 1.0])
    right_axis = np.array([-across[1], across[0], 0.0])
    axes = np.stack([right_axis, np.cross(backward_axis, right_axis), backward_axis])
    right, up, backward = (corners @ axes.T).T
    # A corner is visible where |offset| <= slope * depth: both sides of a direction bound target and distance together.
    (target_right, distance_right) = _between(right, backward, most_slopes[0])
    (target_up, distance_up) = _between(up, backward, most_slopes[1])
    target = np.array([target_right, target_up, 0.0]) @ axes
    return View(target + max(distance_right, distance_up) * axes[2], target, axes)


def _between(offsets: Float64, backward: Float64, slope: float) -> tuple[float, float]:
    """Return the target along one direction, and the least distance at which all offsets are within the slope."""
    above, below = np.max(offsets + slope * backward), np.max(-offsets + slope * backward)
    return float(above - below) / 2, float(above + below) / (2 * slope)
