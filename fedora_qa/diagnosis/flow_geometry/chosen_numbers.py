"""Whether a declared camera has numbers that somebody chose: a declaration that went wrong by any amount has none.

A designed camera has a round field of view, its principal point in the middle, and an optical axis along an axis of
the body or at a round angle to it. A declaration that is wrong by some amount is round with probability 0, a correct
one often: where it is round, what disagrees with it is wrong (Bayes, whatever the prior).
"""

from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.sequence.declared import Camera

_ROUND_DEG: Final = 0.5
_SAME: Final = 1e-7
"""Relative; declared numbers are float64, and shorter ones rarely come from an accident."""


def is_chosen(camera: Camera, cause: str) -> bool:
    """Whether that of a camera which a cause would spoil looks chosen; False for causes that spoil none of it."""
    tests = {
        "intrinsics_focal": _focal_chosen,
        "intrinsics_centre": _centre_chosen,
        "extrinsic_rotation": _mount_chosen,
    }
    return cause in tests and tests[cause](camera)


def _focal_chosen(camera: Camera) -> bool:
    """Whether pixels are square and the field of view, or the focal length itself, is round."""
    fx, fy = camera.K[0, 0], camera.K[1, 1]
    # Pinhole camera: tan(view / 2) = (width / 2) / fx.
    view_deg = np.degrees(2 * np.arctan(camera.width / (2 * fx)))
    return bool(abs(fx - fy) < _SAME * fx and (_round(view_deg, _ROUND_DEG) or _round(fx, _ROUND_DEG)))


def _centre_chosen(camera: Camera) -> bool:
    """Whether the principal point lies in the middle, by any of the three conventions."""
    return all(
        # Px. Centres at 0, 1, ...: (size - 1) / 2; corners there: size / 2; centres at 1, 2, ...: (size + 1) / 2.
        any(abs(centre - (size + by) / 2) < _SAME * size for by in (-1, 0, 1))
        for centre, size in ((camera.K[0, 2], camera.width), (camera.K[1, 2], camera.height))
    )


def _mount_chosen(camera: Camera) -> bool:
    """Whether the camera is turned about each axis by a round angle."""
    R_body_camera = camera.T_body_camera[:3, :3]
    # Entries 0 and +-1 only: the camera is mounted at right angles to the axes of the body.
    straight = bool(np.all(np.abs(R_body_camera - np.rint(R_body_camera)) < _SAME))
    # Columns: axes (X right, Y down, Z forward) of a camera that looks ahead, in the body (X forward, Y left, Z up).
    forward = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    angles_deg = Rotation.from_matrix(R_body_camera @ forward.T).as_rotvec(degrees=True)
    return straight or (np.count_nonzero(np.abs(angles_deg) > _SAME) == 1 and _round(np.abs(angles_deg).max(), 0.5))


def _round(value: float, to: float) -> bool:
    # Relative to the value, but to one step at least: near 0 a relative tolerance would refuse rounding errors.
    return bool(abs(value / to - np.rint(value / to)) * to < _SAME * max(abs(value), to))
