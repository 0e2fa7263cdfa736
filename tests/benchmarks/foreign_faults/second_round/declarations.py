"""Cameras, gravity and index maps that are declared or made wrongly."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan

FILM_MM = 36.0
"""Width of the film that Blender assumes."""


def _cameras(file: h5py.File) -> list[h5py.AttributeManager]:
    return [camera.attrs for camera in file["metadata/cameras"].values()]


def centre_exchanged(file: h5py.File, plan: Plan) -> None:
    """The row of the principal point stands for the column, and the reverse, for all cameras."""
    for attributes in _cameras(file):
        K = np.array(attributes["K"])
        K[:2, 2] = K[1::-1, 2]
        attributes["K"] = K


def focal_in_millimetres(file: h5py.File, plan: Plan) -> None:
    """Focal lengths of all cameras are millimetres of a film that is 36 mm wide; centres are in pixels."""
    for attributes in _cameras(file):
        K = np.array(attributes["K"])
        K[[0, 1], [0, 1]] *= FILM_MM / float(attributes["width"])
        attributes["K"] = K


def rows_upwards(file: h5py.File, plan: Plan) -> None:
    """The vertical focal length of all cameras is negative, as where image rows count upwards."""
    for attributes in _cameras(file):
        K = np.array(attributes["K"])
        K[1, 1] *= -1
        attributes["K"] = K


def skewed(file: h5py.File, plan: Plan) -> None:
    """K of the event camera has a skew of so many percent of the focal length."""
    attributes = file["metadata/cameras/events"].attrs
    K = np.array(attributes["K"])
    K[0, 1] = plan.size / 100 * K[0, 0]
    attributes["K"] = K


def not_a_number(file: h5py.File, plan: Plan) -> None:
    """The focal lengths of the event camera are not a number."""
    attributes = file["metadata/cameras/events"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] = np.nan
    attributes["K"] = K


def mountings_by_columns(file: h5py.File, plan: Plan) -> None:
    """Mountings of all cameras are stored by columns, so that the way stands in the last row."""
    for attributes in _cameras(file):
        attributes["T_body_camera"] = np.ascontiguousarray(np.array(attributes["T_body_camera"]).T)


def way_of_the_inverse(file: h5py.File, plan: Plan) -> None:
    """The place of each camera is that of the body as the camera has it; the rotation is right."""
    for attributes in _cameras(file):
        mount = np.array(attributes["T_body_camera"])
        mount[:3, 3] = np.linalg.inv(mount)[:3, 3]
        attributes["T_body_camera"] = mount


def in_portrait(file: h5py.File, plan: Plan) -> None:
    """The declared mounting of the event camera is turned by 90 degrees about its optical axis."""
    attributes = file["metadata/cameras/events"].attrs
    mount = np.array(attributes["T_body_camera"])
    mount[:3, :3] = mount[:3, :3] @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    attributes["T_body_camera"] = mount


def gravity_downwards(file: h5py.File, plan: Plan) -> None:
    """The declared gravity is negative: the component of a vector that points down."""
    attributes = file["metadata/imu"].attrs
    attributes["gravity"] = -attributes["gravity"]


def colour_map_ends_early(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the entries, at least one, are absent."""
    entries = file["metadata/rgb_to_event"][...]
    lost = max(1, round(plan.size / 100 * len(entries)))
    replace_values(file, "metadata/rgb_to_event", entries[:-lost])


def depth_map_off_from_a_frame_on(file: h5py.File, plan: Plan) -> None:
    """From the first of the plan's rows on, entries are too large by so many events."""
    entries = file["metadata/depth_to_event"][...]
    entries[plan.rows(len(entries)).start :] += int(plan.size)
    replace_values(file, "metadata/depth_to_event", entries)


def maps_of_other_clock(file: h5py.File, plan: Plan) -> None:
    """Entries were sought with stamps of frames that are so many ms late, before the clocks were aligned."""
    for stream in ("rgb", "depth"):
        late_us = file[f"path/{stream}_ts"][...] + round(1000 * plan.size)
        indices = np.searchsorted(file["path/events/t"][...], late_us, "left")
        replace_values(file, f"metadata/{stream}_to_event", indices.astype(np.int64))
