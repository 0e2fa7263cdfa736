"""The camera of the picture in space: its position and direction, so that the whole box of a path is visible."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

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
