"""Cameras, sensor models, units and index maps that are declared or made wrongly."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP


def _declare_focal(file: h5py.File, camera: str, of_half_angle: float) -> None:
    """Declare W / (2 tan a) as both focal lengths, px."""
    attributes = file[CAMERA + camera].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] = float(attributes["width"]) / (2 * np.tan(of_half_angle))
    attributes["K"] = K


def _half_angle(file: h5py.File, camera: str) -> float:
    """Return half of the horizontal angle of view, rad."""
    attributes = file[CAMERA + camera].attrs
    return float(np.arctan(float(attributes["width"]) / (2 * attributes["K"][0, 0])))


def angle_not_halved(file: h5py.File, plan: Plan) -> None:
    """The focal length of the colour camera is that of twice its angle of view."""
    _declare_focal(file, "rgb", 2 * _half_angle(file, "rgb"))


def angle_not_in_radians(file: h5py.File, plan: Plan) -> None:
    """The focal length of the event camera is that of an angle whose degrees are taken for radians."""
    _declare_focal(file, "events", float(np.rad2deg(_half_angle(file, "events"))))


def shares_of_size(file: h5py.File, plan: Plan) -> None:
    """K of all cameras is in shares of the width and the height of their images."""
    for camera in file["metadata/cameras"].values():
        size = np.array([[camera.attrs["width"]], [camera.attrs["height"]], [1]], dtype=np.float64)
        camera.attrs["K"] = np.array(camera.attrs["K"]) / size


def all_tilted(file: h5py.File, plan: Plan) -> None:
    """Declared mountings of all cameras are turned together, by so many degrees about a random axis of the body."""
    turn = Rotation.from_rotvec(np.deg2rad(plan.size) * plan.direction()).as_matrix()
    for camera in file["metadata/cameras"].values():
        mount = np.array(camera.attrs["T_body_camera"])
        mount[:3, :3] = turn @ mount[:3, :3]
        camera.attrs["T_body_camera"] = mount


def threshold_in_percent(file: h5py.File, plan: Plan) -> None:
    """Declared thresholds are percent: of the light where the sensor is logarithmic, else of the full scale."""
    attributes = file["metadata/events"].attrs
    for name in ("threshold_on", "threshold_off"):
        attributes[name] = attributes[name] * (100 if attributes["model"] == "log" else 100 / 255)


def event_noise_declared(file: h5py.File, plan: Plan) -> None:
    """Shot noise of so many Hz and leakage of 0.1 Hz are declared, and not added."""
    attributes = file["metadata/events"].attrs
    attributes["shot_rate_hz"], attributes["leak_rate_hz"] = np.float64(plan.size), np.float64(0.1)


def depth_labelled_in_metres(file: h5py.File, plan: Plan) -> None:
    """The label of depth says metres, and the values are millimetres."""
    file["path/depth"].attrs["units"] = "m"


def colour_map_off_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Entries of the plan's rows are too large by so many events."""
    entries = file[COLOUR_MAP][...]
    entries[plan.rows(len(entries))] += int(plan.size)
    replace_values(file, COLOUR_MAP, np.clip(entries, 0, len(file["path/events/t"])))


def colour_map_in_doubles(file: h5py.File, plan: Plan) -> None:
    """Entries are float64."""
    replace_values(file, COLOUR_MAP, file[COLOUR_MAP][...].astype(np.float64))


def _entries_of_next(file: h5py.File) -> np.ndarray:
    """Return the entries of the frames that follow, and the number of events after the last one."""
    return np.append(file[DEPTH_MAP][1:], np.int64(len(file["path/events/t"])))


def depth_map_of_pairs(file: h5py.File, plan: Plan) -> None:
    """An entry has two numbers: where the events of a frame begin, and where they end."""
    replace_values(file, DEPTH_MAP, np.stack([file[DEPTH_MAP][...], _entries_of_next(file)], axis=1))


def depth_map_of_ends(file: h5py.File, plan: Plan) -> None:
    """An entry is where the events of a frame end, which is the beginning of those of the next one."""
    replace_values(file, DEPTH_MAP, _entries_of_next(file))
