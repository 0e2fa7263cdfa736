"""Whether the numbers of a camera were chosen: those of a designed camera are round."""

from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.conventions import R_BODY_OPTICAL
from fedora_qa.sequence.declared import Camera

_ROUND_DEG: Final = 0.5
"""Step of round angles, deg, and of round focal lengths, px."""

SAME: Final = 1e-7
"""Relative tolerance of round numbers: declared numbers are float64, and numbers with few digits rarely occur by
chance."""


def is_chosen(camera: Camera, cause: str) -> bool:
    """Whether the numbers of a camera that a cause would change are round, as those of a designed camera.

    A designed camera has a round field of view, its principal point in the middle, and an optical axis along an axis of
    the body or at a round angle to it. A declaration that is wrong by a random amount is round with probability 0, a
    correct one often is. So where a declaration is round, it is correct (Bayes, for any prior).

    Parameters
    ----------
    camera
        As declared.
    cause
        As in ``fedora_qa.causes``.

    Returns
    -------
    bool
        False for causes that change no number of a camera.
    """
    if cause == "intrinsics_focal":
        # Pixels are square, and the field of view, or the focal length itself, is round.
        fx, fy = camera.K[0, 0], camera.K[1, 1]
        # Pinhole camera: tan(view / 2) = (width / 2) / fx.
        view_deg = np.degrees(2 * np.arctan(camera.width / (2 * fx)))
        return bool(abs(fx - fy) < SAME * fx and (_round(view_deg, _ROUND_DEG) or _round(fx, _ROUND_DEG)))
    if cause == "intrinsics_centre":
        return all(
            # Px. Centres at 0, 1, ...: (size - 1) / 2; corners there: size / 2; centres at 1, 2, ...: (size + 1) / 2.
            any(abs(centre - (size + by) / 2) < SAME * size for by in (-1, 0, 1))
            for centre, size in ((camera.K[0, 2], camera.width), (camera.K[1, 2], camera.height))
        )
    if cause == "extrinsic_rotation":
        R_body_camera = camera.T_body_camera[:3, :3]
        # Entries 0 and +-1 only: the camera is mounted at right angles to the axes of the body.
        straight = bool(np.all(np.abs(R_body_camera - np.rint(R_body_camera)) < SAME))
        # Rotation vector from a camera with its optical axis along X forward of the body.
        angles_deg = Rotation.from_matrix(R_body_camera @ np.array(R_BODY_OPTICAL).T).as_rotvec(degrees=True)
        # Rotation about one axis by a round angle.
        about_single_axis = np.count_nonzero(np.abs(angles_deg) > SAME) == 1
        return straight or (about_single_axis and _round(np.abs(angles_deg).max(), _ROUND_DEG))
    return False


def _round(value: float, to: float) -> bool:
    # Relative to the value, but to one step at least: near 0 a relative tolerance would refuse rounding errors.
    return bool(abs(value / to - np.rint(value / to)) * to < SAME * max(abs(value), to))
