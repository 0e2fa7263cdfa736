"""Cameras, sensor models and index maps that are declared or made wrongly."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP


def angles_of_mountings_in_degrees(file: h5py.File, plan: Plan) -> None:
    """Roll, pitch and yaw of all mountings are in degrees, and taken for radians."""
    for camera in file["metadata/cameras"].values():
        mount = np.array(camera.attrs["T_body_camera"])
        angles = Rotation.from_matrix(mount[:3, :3]).as_euler("xyz", degrees=True)
        mount[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
        camera.attrs["T_body_camera"] = mount


def linear_below_declared(file: h5py.File, plan: Plan) -> None:
    """A constant of so many DN is declared to be added to the light before the logarithm."""
    file["metadata/events"].attrs["log_eps_dn"] = np.float64(plan.size)


def hot_pixels_row_first(file: h5py.File, plan: Plan) -> None:
    """The list of hot pixels gives the row before the column."""
    attributes = file["metadata/events"].attrs
    attributes["hot_pixels"] = np.ascontiguousarray(np.array(attributes["hot_pixels"])[:, ::-1])


def nine_numbers(file: h5py.File, plan: Plan) -> None:
    """K of all cameras is a list of nine numbers."""
    for camera in file["metadata/cameras"].values():
        camera.attrs["K"] = np.array(camera.attrs["K"]).ravel()


def depth_map_in_32_bits(file: h5py.File, plan: Plan) -> None:
    """Entries are int32."""
    replace_values(file, DEPTH_MAP, file[DEPTH_MAP][...].astype(np.int32))


def colour_map_as_column(file: h5py.File, plan: Plan) -> None:
    """The shape of the map is (N, 1)."""
    replace_values(file, COLOUR_MAP, file[COLOUR_MAP][...][:, None])


def depth_map_to_nearest(file: h5py.File, plan: Plan) -> None:
    """An entry is the event that is nearest in time, before or after the frame."""
    events_us, frames_us = file["path/events/t"][...], file["path/depth_ts"][...]
    after = np.clip(np.searchsorted(events_us, frames_us, "left"), 1, len(events_us) - 1)
    is_earlier_nearer = frames_us - events_us[after - 1] < events_us[after] - frames_us
    replace_values(file, DEPTH_MAP, (after - is_earlier_nearer).astype(np.int64))
