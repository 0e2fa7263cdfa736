"""Cameras, thresholds and index maps that are declared or made wrongly."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP


def threshold_in_decades(file: h5py.File, plan: Plan) -> None:
    """Declared thresholds are those of the logarithm to the base of 10."""
    attributes = file["metadata/events"].attrs
    for name in ("threshold_on", "threshold_off"):
        attributes[name] = attributes[name] / np.log(10)


def mountings_from_the_nose(file: h5py.File, plan: Plan) -> None:
    """Places of all cameras count from a point so many metres before the body's origin."""
    for camera in file["metadata/cameras"].values():
        mount = np.array(camera.attrs["T_body_camera"])
        mount[0, 3] -= plan.size
        camera.attrs["T_body_camera"] = mount


def whole_numbers_of_pixels(file: h5py.File, plan: Plan) -> None:
    """What K of all cameras has behind the point is cut off."""
    for camera in file["metadata/cameras"].values():
        camera.attrs["K"] = np.trunc(np.array(camera.attrs["K"]))


def colour_map_left_out(file: h5py.File, plan: Plan) -> None:
    """The map is absent."""
    del file[COLOUR_MAP]


def depth_map_of_intervals(file: h5py.File, plan: Plan) -> None:
    """An entry is where the events of an interval between two frames begin: there is none for the last frame."""
    replace_values(file, DEPTH_MAP, file[DEPTH_MAP][...][:-1])


def colour_map_before_a_filter(file: h5py.File, plan: Plan) -> None:
    """Entries count the events before a filter which removed so many percent of them."""
    entries = file[COLOUR_MAP][...] / (1 - plan.size / 100)
    replace_values(file, COLOUR_MAP, np.rint(entries).astype(np.int64))
