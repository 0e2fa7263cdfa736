"""Numbers that the formats of other data sets and libraries hold, taken over without what they mean there."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION

UNKNOWN_FLOW: Final = 1.666_666_752e9
"""What Middlebury's files hold where flow is not known: above 1e9, in single precision."""


def flow_of_kitti(file: h5py.File, plan: Plan) -> None:
    """Vectors went through 16 bits, (u 64 + 2^15), and what is not valid is 0 there, which is -512 px."""
    for key in KEYS:
        stored = np.rint(np.clip(file[key][...].astype(np.float64) * 64 + 32_768, 0, 65_535))
        replace_values(file, key, ((np.nan_to_num(stored, nan=0.0) - 32_768) / 64).astype(np.float32))


def flow_of_dsec(file: h5py.File, plan: Plan) -> None:
    """Vectors are whole numbers of 1/128 px: the offset of 2^15 is subtracted, and nothing divides."""
    for key in KEYS:
        replace_values(file, key, np.rint(file[key][...] * np.float32(128)))


def unknown_flow_of_middlebury(file: h5py.File, plan: Plan) -> None:
    """What has no flow has the number that says so."""
    for key in KEYS:
        replace_values(file, key, np.nan_to_num(file[key][...], nan=np.float32(UNKNOWN_FLOW)))


def events_of_smaller_sensor(file: h5py.File, plan: Plan) -> None:
    """Coordinates are scaled to a sensor smaller by so many percent, and rounded down; K and size stay."""
    for axis in "xy":
        values = file[f"path/events/{axis}"][...]
        replace_values(file, f"path/events/{axis}", np.floor(values * (1 - plan.size / 100)).astype(values.dtype))


def columns_in_few_bits(file: h5py.File, plan: Plan) -> None:
    """The highest bit of columns is cut off, so that those behind a power of two come back at the left."""
    columns = file["path/events/x"][...]
    width = int(file["metadata/cameras/events"].attrs["width"])
    bits = (width - 1).bit_length() - 1
    replace_values(file, "path/events/x", (columns & ((1 << bits) - 1)).astype(columns.dtype))


def increments(file: h5py.File, plan: Plan) -> None:
    """Samples are angles and velocities gained since the sample before."""
    seconds = np.diff(file["path/imu/ts"][...]) / 1e6
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, file[key][...] * np.r_[seconds[:1], seconds][:, None])


def accelerometer_downwards(file: h5py.File, plan: Plan) -> None:
    """The accelerometer is in FRD, and the gyro in FLU."""
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] * np.array([1.0, -1.0, -1.0]))


def imu_in_world(file: h5py.File, plan: Plan) -> None:
    """Both vectors are in the axes of the world."""
    stamps_us = file["path/pose/ts"][...].astype(np.float64)
    attitude = Slerp(stamps_us, Rotation.from_quat(file[ORIENTATION][...]))
    at = attitude(np.clip(file["path/imu/ts"][...].astype(np.float64), stamps_us[0], stamps_us[-1]))
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, at.apply(file[key][...]))


def _angles(file: h5py.File) -> NDArray[np.float64]:
    """Return yaw, pitch and roll, rad."""
    angles: NDArray[np.float64] = Rotation.from_quat(file[ORIENTATION][...]).as_euler("ZYX")
    return angles


def angles_in_coarse_steps(file: h5py.File, plan: Plan) -> None:
    """Yaw, pitch and roll were written as text, in steps of so many degrees."""
    step = np.deg2rad(plan.size)
    attitude = Rotation.from_euler("ZYX", np.rint(_angles(file) / step) * step)
    replace_values(file, ORIENTATION, attitude.as_quat())


def angles_in_another_order(file: h5py.File, plan: Plan) -> None:
    """Yaw, pitch and roll are applied as rotations about X, Y and Z in this order: roll comes first."""
    replace_values(file, ORIENTATION, Rotation.from_euler("XYZ", _angles(file)[:, ::-1]).as_quat())


def angle_of_view_of_other_side(file: h5py.File, plan: Plan) -> None:
    """The horizontal angle of view of the event camera is taken for the vertical one: f = f H / W."""
    attributes = file["metadata/cameras/events"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] *= int(attributes["height"]) / int(attributes["width"])
    attributes["K"] = K


def mountings_in_millimetres(file: h5py.File, plan: Plan) -> None:
    """Where cameras sit is in millimetres."""
    for camera in file["metadata/cameras"].values():
        mount = np.array(camera.attrs["T_body_camera"])
        mount[:3, 3] *= 1000
        camera.attrs["T_body_camera"] = mount
