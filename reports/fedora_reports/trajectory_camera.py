"""From where a path is looked at."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

_ELEVATION_RAD: Final = np.radians(27.0)
_OFF_THE_SIDE_RAD: Final = np.radians(62.0)
"""Between the direction of flight and that of the view: a straight flight is seen mostly from the side."""
_USUAL_AZIMUTH_RAD: Final = np.radians(-62.0)
"""A view from the south-south-east, east to the right."""


@dataclass(frozen=True, slots=True)
class View:
    """A perspective camera. ``eye`` and ``target`` (3,); ``axes`` (3, 3): right, up and backward as rows."""

    eye: Float64
    target: Float64
    axes: Float64

    def seen(self, points: Float64) -> Float64:
        """Return points (n, 3) as (right, up) slopes (n, 2) off the line of sight."""
        local = (points - self.eye) @ self.axes.T
        slopes: Float64 = local[:, :2] / -local[:, 2:]
        return slopes


def view_of(positions: Float64, corners: Float64, half_angles: tuple[float, float]) -> View:
    """Return the view, across the main direction of ``positions`` (n, 3), that just holds ``corners`` (m, 3).

    ``half_angles`` are the greatest slopes off the line of sight, to the right and upward.
    """
    axes = _axes(_azimuth_rad(positions), _ELEVATION_RAD)
    right, up, backward = (corners @ axes.T).T
    # A corner is inside when |offset| <= slope * depth: both sides of a direction bound target and distance together.
    (target_right, distance_right) = _between(right, backward, half_angles[0])
    (target_up, distance_up) = _between(up, backward, half_angles[1])
    target = np.array([target_right, target_up, 0.0]) @ axes
    return View(target + max(distance_right, distance_up) * axes[2], target, axes)


def _between(offsets: Float64, backward: Float64, slope: float) -> tuple[float, float]:
    """Return where to aim along one direction, and the least distance, so that all offsets are inside the slope."""
    above, below = np.max(offsets + slope * backward), np.max(-offsets + slope * backward)
    return float(above - below) / 2, float(above + below) / (2 * slope)


def _axes(azimuth_rad: float, elevation_rad: float) -> Float64:
    flat = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    backward = np.cos(elevation_rad) * flat + np.sin(elevation_rad) * np.array([0.0, 0.0, 1.0])
    right = np.array([-flat[1], flat[0], 0.0])
    return np.stack([right, np.cross(backward, right), backward])


def _azimuth_rad(positions: Float64) -> float:
    """Return from where to look: beside the main horizontal direction, on the side nearest to the usual view."""
    flat = positions[:, :2] - positions[:, :2].mean(axis=0)
    spread = flat.T @ flat
    if np.ptp(np.linalg.eigvalsh(spread)) <= 0.5 * np.trace(spread):
        return float(_USUAL_AZIMUTH_RAD)
    main = np.linalg.eigh(spread)[1][:, -1]
    along = np.arctan2(main[1], main[0])
    choices = [along + sign * _OFF_THE_SIDE_RAD + turn for sign in (-1, 1) for turn in (0.0, np.pi)]
    return float(max(choices, key=lambda azimuth: np.cos(azimuth - _USUAL_AZIMUTH_RAD)))
