"""Mountings and focal lengths that are declared in other terms."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA

FULL_FRAME_MM = 36.0
"""Width of the film back that is the default of Blender and of most converters."""

UNREAL_MM = 23.76
"""Width of the film back that is the default of Unreal's cine camera."""


def rotation_vector_read_as_angles(file: h5py.File, plan: Plan) -> None:
    """The rotation vector of the mounting of events is taken for its roll, pitch and yaw."""
    attributes = file[CAMERA + "events"].attrs
    mounting = np.array(attributes["T_body_camera"])
    vector = Rotation.from_matrix(mounting[:3, :3]).as_rotvec()
    mounting[:3, :3] = Rotation.from_euler("xyz", vector).as_matrix()
    attributes["T_body_camera"] = mounting


def focal_length_of_full_frame(file: h5py.File, plan: Plan) -> None:
    """The focal length of colour, in mm of a film back of 23.76 mm, is brought into pixels by 36 mm."""
    attributes = file[CAMERA + "rgb"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] *= UNREAL_MM / FULL_FRAME_MM
    attributes["K"] = K


def place_in_optical_axes(file: h5py.File, plan: Plan) -> None:
    """The place of the event camera in the body is given along the axes of the camera."""
    attributes = file[CAMERA + "events"].attrs
    mounting = np.array(attributes["T_body_camera"])
    mounting[:3, 3] = mounting[:3, :3].T @ mounting[:3, 3]
    attributes["T_body_camera"] = mounting


def mountings_without_last_row(file: h5py.File, plan: Plan) -> None:
    """Mountings have three rows."""
    for camera in ("rgb", "depth", "events"):
        attributes = file[CAMERA + camera].attrs
        attributes["T_body_camera"] = np.array(attributes["T_body_camera"])[:3]
