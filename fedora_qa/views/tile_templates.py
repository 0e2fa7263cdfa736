"""What small faults of camera, mounting and time would do to the flow of tiles, from depth and the camera's motion."""

from math import asin, hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.tiles import mean_derivatives
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.so3 import cross_matrices
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_motion import DELAY_NS, motion_over
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_intervals import Interval
from fedora_qa.views.warped_frames import Geometry, geometry_of

Float64 = NDArray[np.float64]

_STRIDE_PX: Final = 8
"""Templates are as smooth as the flow: sixteen pixels give the mean of a tile."""

_ABOUT_OPTICAL_AXIS: Final = np.eye(6)[:, 2:3]
_NARROW: Final = 2.0
"""Trace of a rotation by 60 degrees: up to there the sine determines the angle."""

_PERCENT, _DEG = 0.01, np.pi / 180


def tile_templates(
    window: Window, interval: Interval, origins: NDArray[np.int64], usable: NDArray[np.bool_]
) -> Float64 | None:
    """Return templates (n, 2, 8) of tiles, the columns of ``GEOMETRIC``; None where depth or motion is not known.

    Stored minus true flow, px per unit of a fault in making the flow: the reverse of the same fault of a declaration.
    ``usable`` (n, 32, 32) are the pixels that count. Where poses are noisy the template of time, a difference of
    poses 2 ms apart, is nothing but noise and is left at zero.
    """
    geometry = geometry_of(window, interval)
    if geometry is None:
        return None
    motion = geometry.corrected
    depth_m = window.depth_m(geometry.frames[0])
    of_tiles = mean_derivatives(
        depth_m, origins, usable, _STRIDE_PX // 2, _STRIDE_PX, geometry.track.camera.K, motion.R, motion.t_m
    )
    by_twist, by_focal, by_centre = of_tiles[..., :6], of_tiles[..., 6:7], of_tiles[..., 7:]
    twists = np.concatenate((by_mounting(motion), _by_time(window, interval, geometry), _ABOUT_OPTICAL_AXIS), axis=1)
    # Units of the columns: 1 degree about X, Y, Z of the mounting, 1% of the interval, 1 degree about the optical axis.
    twists *= np.array([_DEG, _DEG, _DEG, _PERCENT, _DEG])
    return np.concatenate((_PERCENT * by_focal, by_centre, by_twist @ twists), axis=2)


def by_mounting(motion: RigidMotion) -> Float64:
    """Return the twists (6, 3) per rad by which a camera's motion changes as it is turned about its axes.

    Turned by w, points move by ``Exp(w)^T (R, t) Exp(w)``, which is the motion followed by the twist
    ``(R w - w, t x R w)``.
    """
    return np.concatenate((motion.R - np.eye(3), cross_matrices(motion.t_m) @ motion.R))


def _by_time(window: Window, interval: Interval, geometry: Geometry) -> Float64:
    """Return the twist (6, 1) per interval by which an earlier motion differs; zero where that is not known."""
    if not is_noisy(window.facts.declared.pose):
        later, earlier = (motion_over(window, geometry.track, interval.moved(by)) for by in (DELAY_NS, -DELAY_NS))
        if later is not None and earlier is not None:
            twist: Float64 = _twist_between(earlier, later)[:, None] * (interval.length_ns / (2 * DELAY_NS))
            return twist
    return np.zeros((6, 1))


def _twist_between(motion: RigidMotion, other: RigidMotion) -> Float64:
    """Return ``motion.twist_from(other)`` (6,), in a tenth of the time where the rotation between them is small.

    By Rodrigues' formula a rotation less its reverse is twice its sine times its axis.
    """
    dR = motion.R @ other.R.T
    if dR[0, 0] + dR[1, 1] + dR[2, 2] < _NARROW:
        return motion.twist_from(other)
    # Rodrigues: R - R^T = 2 sin(angle) [axis]x.
    x, y, z = 0.5 * (dR[2, 1] - dR[1, 2]), 0.5 * (dR[0, 2] - dR[2, 0]), 0.5 * (dR[1, 0] - dR[0, 1])
    sine = min(hypot(x, y, z), 1.0)
    scale = asin(sine) / sine if sine > 0 else 1.0
    return np.concatenate(((scale * x, scale * y, scale * z), motion.t_m - dR @ other.t_m))
