"""What the declared cameras state of themselves: numbers that were chosen, and a mounting beside that of the others."""

from collections.abc import Collection
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.conventions import R_BODY_OPTICAL
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.faults.cameras import MountingRotation
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.event_camera import AXES_AGREE, is_about_parallel

_ROUND_DEG: Final = 0.5
_SAME: Final = 1e-7
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
        return bool(abs(fx - fy) < _SAME * fx and (_round(view_deg, _ROUND_DEG) or _round(fx, _ROUND_DEG)))
    if cause == "intrinsics_centre":
        return all(
            # Px. Centres at 0, 1, ...: (size - 1) / 2; corners there: size / 2; centres at 1, 2, ...: (size + 1) / 2.
            any(abs(centre - (size + by) / 2) < _SAME * size for by in (-1, 0, 1))
            for centre, size in ((camera.K[0, 2], camera.width), (camera.K[1, 2], camera.height))
        )
    if cause == "extrinsic_rotation":
        R_body_camera = camera.T_body_camera[:3, :3]
        # Entries 0 and +-1 only: the camera is mounted at right angles to the axes of the body.
        straight = bool(np.all(np.abs(R_body_camera - np.rint(R_body_camera)) < _SAME))
        # Rotation vector from a camera with its optical axis along X forward of the body.
        angles_deg = Rotation.from_matrix(R_body_camera @ np.array(R_BODY_OPTICAL).T).as_rotvec(degrees=True)
        # Rotation about one axis by a round angle.
        about_single_axis = np.count_nonzero(np.abs(angles_deg) > _SAME) == 1
        return straight or (about_single_axis and _round(np.abs(angles_deg).max(), _ROUND_DEG))
    return False


def _round(value: float, to: float) -> bool:
    # Relative to the value, but to one step at least: near 0 a relative tolerance would refuse rounding errors.
    return bool(abs(value / to - np.rint(value / to)) * to < _SAME * max(abs(value), to))


def odd_mounting(facts: Facts) -> MountingRotation | None:
    """Return the rotation of the one camera whose axes differ from the common axes of all others.

    Cameras of one rig look in one direction. A camera that does not, by an angle that nobody chose (``is_chosen``), is
    declared wrongly, or was bent.

    Parameters
    ----------
    facts
        With the declared cameras.

    Returns
    -------
    MountingRotation | None
        Of that camera against the others, of up to 10 deg; None without other cameras, or where several differ.
    """
    cameras = {
        name: camera for name, camera in facts.declared.cameras.items() if np.isfinite(camera.T_body_camera).all()
    }
    odd = [
        (name, others[0])
        for name, camera in cameras.items()
        if (others := [other for other_name, other in cameras.items() if other_name != name])
        and all(_has_axes_of(others[0], other) for other in others)
        and not _has_axes_of(others[0], camera)
        and not is_chosen(camera, "extrinsic_rotation")
    ]
    # Of two cameras that differ, neither is odd unless the numbers of the other were chosen.
    if len(odd) != 1 or not is_about_parallel(cameras[odd[0][0]], odd[0][1]):
        return None
    ((name, other),) = odd
    # R_odd = R_others Exp(rotation).
    R = other.T_body_camera[:3, :3].T @ cameras[name].T_body_camera[:3, :3]
    x_deg, y_deg, z_deg = (float(angle) for angle in Rotation.from_matrix(R).as_rotvec(degrees=True))
    return MountingRotation("metadata", (x_deg, y_deg, z_deg), name)


def hypotheses_of_mountings(facts: Facts, compared: Collection[str]) -> tuple[Hypothesis, ...]:
    """Return the mounting of one of the compared cameras as a cause, where it differs from those of all others."""
    odd = odd_mounting(facts)
    if odd is None or odd.camera not in compared:
        return ()
    return (Hypothesis("extrinsic_rotation", "metadata", support("metadata.odd_mounting"), odd.magnitude, "deg"),)


def _has_axes_of(camera1: Camera, camera2: Camera) -> bool:
    return bool(np.abs(camera1.T_body_camera[:3, :3] - camera2.T_body_camera[:3, :3]).max() <= AXES_AGREE)
