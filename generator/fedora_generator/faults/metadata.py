"""Faults of what a file declares; the streams stay as they are."""

from collections.abc import Callable
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError

Floats = NDArray[np.float64]
MatrixChange = Callable[[Floats], Floats]

CAMERAS: Final = "metadata/cameras"


def intrinsics_focal(file: h5py.File, fault: Fault) -> None:
    """Declare focal lengths of every camera too large by the magnitude."""
    edit_cameras(file, "K", longer_focal(fault))


def intrinsics_centre(file: h5py.File, fault: Fault) -> None:
    """Declare the principal point of every camera too far right by the magnitude, in its own pixels."""
    edit_cameras(file, "K", shifted_centre(fault))


def extrinsic_rotation(file: h5py.File, fault: Fault) -> None:
    """Declare every camera rolled about its optical axis, clockwise as seen from behind, by the magnitude."""
    edit_cameras(file, "T_body_camera", rolled(fault))


def lever_arm(file: h5py.File, fault: Fault) -> None:
    """Declare every camera too far forward in the body by the magnitude."""
    shift = np.zeros((4, 4))
    shift[0, 3] = fault.magnitude_in("m")
    edit_cameras(file, "T_body_camera", lambda T_body_camera: T_body_camera + shift)


def frame_convention(file: h5py.File, fault: Fault) -> None:
    """Declare cameras without the rotation from body to optical axes."""

    def without_rotation(T_body_camera: Floats) -> Floats:
        bare = np.eye(4)
        bare[:, 3] = T_body_camera[:, 3]
        return bare

    edit_cameras(file, "T_body_camera", without_rotation)


def rectification_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare a map of the pixels of the event camera to the view of depth that leaves each pixel where it is."""
    camera = group_in(file, f"{CAMERAS}/events").attrs
    columns, rows = np.meshgrid(np.arange(int(camera["width"])), np.arange(int(camera["height"])))
    group_in(file, "metadata").pop("rectify_map", None)
    file["metadata/rectify_map"] = np.dstack((columns, rows)).astype(np.float32)


def gravity_magnitude(file: h5py.File, fault: Fault) -> None:
    """Declare a gravity too large by the magnitude."""
    if "gravity" not in group_in(file, "metadata/imu").attrs:
        raise FaultError("Expected a declared gravity in metadata/imu, got none")
    attributes = file["metadata/imu"].attrs
    attributes["gravity"] = attributes["gravity"] + fault.magnitude_in("m/s^2")


def nan_in_stream(file: h5py.File, fault: Fault) -> None:
    """Declare the intrinsics of the given number of cameras as NaN."""
    cameras = [*group_in(file, CAMERAS).values()]
    count = fault.positive_count()
    if count > len(cameras):
        raise FaultError(f"Expected at most the {len(cameras)} cameras of the file, got {count}")
    for camera in cameras[:count]:
        camera.attrs["K"] = np.full((3, 3), np.nan)


def declare_noise(file: h5py.File, key: str, names: tuple[str, ...], fault: Fault) -> None:
    """Scale the declared noises that are not 0.

    Parameters
    ----------
    file
        An open file.
    key
        Group of the declaration.
    names
        Attributes of the group that are noises.
    fault
        Its magnitude is the change, percent.

    Raises
    ------
    FaultError
        The group is missing, or every noise is missing or 0.
    """
    attributes = group_in(file, key).attrs
    present = [name for name in names if attributes.get(name, 0)]
    if not present:
        raise FaultError(f"Expected declared noise in {key}, got none; plant this in a file with noise")
    for name in present:
        attributes[name] = attributes[name] * (1 + fault.magnitude_in("percent") / 100)


def group_in(file: h5py.File, key: str) -> h5py.Group:
    """Return a group of the file; raises ``FaultError`` where it is missing."""
    if key not in file:
        raise FaultError(f"Expected {key} in the file, got none; there is nothing to misdeclare")
    return file[key]


def edit_cameras(file: h5py.File, attribute: str, change: MatrixChange) -> None:
    """Change one matrix of every camera.

    Parameters
    ----------
    attribute
        ``K`` or ``T_body_camera``.
    change
        From a matrix to the wrong one.
    """
    for camera in group_in(file, CAMERAS).values():
        camera.attrs[attribute] = change(np.array(camera.attrs[attribute], dtype=np.float64))


def longer_focal(fault: Fault) -> MatrixChange:
    """Return the change of K that makes both focal lengths too large by the magnitude."""
    gain = 1 + fault.magnitude_in("percent") / 100
    gains = np.array([[gain, gain, 1.0], [1.0, gain, 1.0], [1.0, 1.0, 1.0]])
    return lambda K: K * gains


def shifted_centre(fault: Fault) -> MatrixChange:
    """Return the change of K that moves the principal point to the right by the magnitude."""
    shift = np.zeros((3, 3))
    shift[0, 2] = fault.magnitude_in("px")
    return lambda K: K + shift


def rolled(fault: Fault) -> MatrixChange:
    """Return the change of T_body_camera that turns the camera about its optical axis by the magnitude."""
    angle_rad = fault.magnitude_in("rad")
    T_camera_rolled = np.eye(4)
    T_camera_rolled[:2, :2] = [[np.cos(angle_rad), -np.sin(angle_rad)], [np.sin(angle_rad), np.cos(angle_rad)]]
    return lambda T_body_camera: T_body_camera @ T_camera_rolled
