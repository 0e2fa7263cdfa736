"""Cameras, gravity and ranges that are declared in other axes, sizes and units, or by default."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA


def intrinsics_of_calibration(file: h5py.File, plan: Plan) -> None:
    """K of depth is that of images so many times as large."""
    attributes = file[CAMERA + "depth"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] *= plan.size
    # Corners of pixels scale, and not their centres.
    K[:2, 2] = plan.size * (K[:2, 2] + 0.5) - 0.5
    attributes["K"] = K


def events_of_default_angle(file: h5py.File, plan: Plan) -> None:
    """The focal length of events is that of a horizontal angle of view of 90 degrees, half the width."""
    attributes = file[CAMERA + "events"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] = float(attributes["width"]) / 2
    attributes["K"] = K


def colour_to_the_side(file: h5py.File, plan: Plan) -> None:
    """The mounting of colour is turned by so many degrees about the vertical of the body."""
    attributes = file[CAMERA + "rgb"].attrs
    mounting = np.array(attributes["T_body_camera"])
    mounting[:3, :3] = Rotation.from_euler("z", plan.size, degrees=True).as_matrix() @ mounting[:3, :3]
    attributes["T_body_camera"] = mounting


def events_left_handed(file: h5py.File, plan: Plan) -> None:
    """The mounting of the event camera leads into a body whose Y points right."""
    attributes = file[CAMERA + "events"].attrs
    attributes["T_body_camera"] = np.diag([1.0, -1.0, 1.0, 1.0]) @ np.asarray(attributes["T_body_camera"])


def gravity_in_g(file: h5py.File, plan: Plan) -> None:
    """Gravity is declared as 1."""
    file["metadata/imu"].attrs["gravity"] = np.float64(1.0)


def range_of_another_sensor(file: h5py.File, plan: Plan) -> None:
    """The declared range of depth ends at so many metres."""
    file["metadata/depth_range"][1] = plan.size
