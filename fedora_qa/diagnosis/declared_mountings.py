"""Improbable mountings of the declared cameras, each with what corrects it.

Positions may be in another unit, mountings inverted or of a body with other axes, and one camera of a rig may look
elsewhere than the others.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.conventions import FRD_FROM_FLU, R_BODY_OPTICAL, SAME_AXES
from fedora_qa.diagnosis.designed_cameras import is_chosen
from fedora_qa.faults.fault import Matrix3
from fedora_qa.faults.mountings import CameraAxes, InvertedMounting, MountingRotation, MountingUnit
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.camera_axes import AXES_AGREE, CENTRES_AGREE_M, is_about_parallel

_FARTHEST_M: Final = 2.0
"""Distance of a camera from the origin of its body, m, above which another unit is tried. The value is not derived:
flying bodies and their sensor heads are smaller, and a trial decides."""

_UNITS: Final = (1000.0, 100.0)
"""Declared over correct lengths: millimetres, centimetres."""


def mounting_units(facts: Facts) -> tuple[MountingUnit, ...]:
    """Return the units in which positions of the cameras may be declared; none where they are near the body."""
    distances_m = (float(np.linalg.norm(camera.T_body_camera[:3, 3])) for camera in facts.declared.cameras.values())
    farthest_m = max(distances_m, default=0.0)
    if not _FARTHEST_M < farthest_m < np.inf:
        return ()
    return tuple(MountingUnit(unit, farthest_m * (1 - 1 / unit)) for unit in _UNITS if farthest_m / unit < _FARTHEST_M)


def inverted_mountings(facts: Facts) -> tuple[InvertedMounting, ...]:
    """Return the cameras that have the axes of all others once their mounting is inverted, and have not as declared.

    Of two cameras either may be the inverse of the other: the one that looks farther from straight ahead is first.
    """
    cameras = {name: camera for name, camera in facts.declared.cameras.items() if _is_rotated(camera)}
    inverted = [
        name
        for name, camera in cameras.items()
        if (others := [other for other_name, other in cameras.items() if other_name != name])
        and not any(_has_axes_of(camera, other) for other in others)
        and all(_has_axes_of(_inverse(camera), other) for other in others)
    ]
    return tuple(InvertedMounting(name) for name in sorted(inverted, key=lambda name: -_from_straight(cameras[name])))


def brings_centres_together(facts: Facts) -> bool:
    """Whether the centres of depth and events are one point once an inverted mounting is inverted back."""
    cameras = facts.declared.cameras
    if not {"depth", "events"} <= cameras.keys():
        return False
    for fault in inverted_mountings(facts):
        depth_m, events_m = (
            (_inverse(cameras[name]) if name == fault.camera else cameras[name]).T_body_camera[:3, 3]
            for name in ("depth", "events")
        )
        if np.abs(depth_m - events_m).max() <= CENTRES_AGREE_M:
            return True
    return False


def mountings_of_other_bodies(facts: Facts) -> tuple[CameraAxes | InvertedMounting, ...]:
    """Return the conventions by which all cameras may be declared; none where one looks about straight ahead, upright.

    A body with Y to the right and Z down is the commonest other one. Another one is that of the exchanged and negated
    axes in which a camera comes nearest to straight ahead. Inverted, mountings may come nearer, too. Cameras may look
    down, so that none of these is likely before a trial.
    """
    cameras = [camera for camera in facts.declared.cameras.values() if _is_rotated(camera)]
    nearest = [_nearest_axes(camera.T_body_camera[:3, :3] @ np.array(R_BODY_OPTICAL).T) for camera in cameras]
    if not cameras or any(np.array_equal(axes, np.eye(3)) for axes in nearest):
        return ()
    bodies = dict.fromkeys((FRD_FROM_FLU, *(_matrix(axes) for axes in nearest)))
    inverses = (InvertedMounting(),) if all(_from_straight(_inverse(c)) < _from_straight(c) for c in cameras) else ()
    # Cameras that are not rotated have the optical axes of no camera: those of the body were taken for them.
    is_bare = all(np.allclose(camera.T_body_camera[:3, :3], np.eye(3), atol=AXES_AGREE) for camera in cameras)
    bare = (CameraAxes(),) if is_bare else ()
    return (*bare, *inverses, *(CameraAxes(SAME_AXES, body_axes) for body_axes in bodies))


def _inverse(camera: Camera) -> Camera:
    return replace(camera, T_body_camera=np.linalg.inv(camera.T_body_camera).astype(np.float64))


def _from_straight(camera: Camera) -> float:
    """Return the angle of a camera from one that looks straight ahead, rad."""
    R = np.array(R_BODY_OPTICAL).T @ camera.T_body_camera[:3, :3]
    return float(Rotation.from_matrix(R).magnitude())


def _nearest_axes(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation that only exchanges and negates axes and is nearest to another rotation."""
    # The 24 rotations of a cube.
    axes = Rotation.create_group("O").as_matrix()
    return np.asarray(np.rint(axes[np.argmax(np.einsum("nij,ij->n", axes, R))]), dtype=np.float64)


def _matrix(rows: NDArray[np.float64]) -> Matrix3:
    first, second, third = ((float(x), float(y), float(z)) for x, y, z in rows + 0.0)
    return first, second, third


def odd_mounting(facts: Facts) -> MountingRotation | None:
    """Return the rotation of the one camera whose axes differ from the common axes of all others.

    Cameras of one rig look in one direction. A camera that does not, by an angle that nobody chose (``is_chosen``), is
    declared wrongly, or was bent; except for a camera with a lens beside its rectified views. One that looks far away,
    by whatever angle, shows nothing of what the others show.

    Parameters
    ----------
    facts
        With the declared cameras.

    Returns
    -------
    MountingRotation | None
        Of that camera against the others; None without other cameras, or where several differ.
    """
    cameras = {name: camera for name, camera in facts.declared.cameras.items() if _is_rotated(camera)}
    odd = [
        (name, others[0])
        for name, camera in cameras.items()
        if (others := [other for other_name, other in cameras.items() if other_name != name])
        and all(_has_axes_of(others[0], other) for other in others)
        and not _has_axes_of(others[0], camera)
        and not (
            is_about_parallel(others[0], camera)
            and (is_chosen(camera, "extrinsic_rotation") or _is_rectified_to(others[0], camera))
        )
    ]
    # Of two cameras that differ, neither is odd unless the numbers of the other were chosen.
    if len(odd) != 1:
        return None
    ((name, other),) = odd
    # R_odd = R_others Exp(rotation).
    R = other.T_body_camera[:3, :3].T @ cameras[name].T_body_camera[:3, :3]
    x_deg, y_deg, z_deg = (float(angle) for angle in Rotation.from_matrix(R).as_rotvec(degrees=True))
    return MountingRotation("metadata", (x_deg, y_deg, z_deg), name)


def _is_rectified_to(view: Camera, camera: Camera) -> bool:
    """Whether a camera has a lens and the view has none: the axes of rectified views follow from both of their cameras.

    They are at an angle to each of them, which nobody chose either.
    """
    return camera.lens is not None and view.lens is None


def _is_rotated(camera: Camera) -> bool:
    """Whether the declared mounting has a rotation, not a mirroring or another matrix."""
    R = camera.T_body_camera[:3, :3]
    return bool(np.isfinite(R).all() and np.abs(R.T @ R - np.eye(3)).max() <= AXES_AGREE and np.linalg.det(R) > 0)


def _has_axes_of(camera1: Camera, camera2: Camera) -> bool:
    return bool(np.abs(camera1.T_body_camera[:3, :3] - camera2.T_body_camera[:3, :3]).max() <= AXES_AGREE)
