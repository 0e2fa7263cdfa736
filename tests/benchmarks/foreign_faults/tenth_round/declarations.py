"""Cameras, event sensors and units that are declared in other terms."""

import h5py
import numpy as np

from tests.benchmarks.foreign_faults.inertial import GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA


def dead_time_declared(file: h5py.File, plan: Plan) -> None:
    """A pixel is declared to be blind for so many us after an event, and is not."""
    file["metadata/events"].attrs["refractory_us"] = np.int64(plan.size)


def angle_of_view_over_the_diagonal(file: h5py.File, plan: Plan) -> None:
    """The angle between the left and the right side of depth is taken for that between its corners."""
    attributes = file[CAMERA + "depth"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] *= np.hypot(attributes["width"], attributes["height"]) / attributes["width"]
    attributes["K"] = K


def places_of_cameras_in_frd(file: h5py.File, plan: Plan) -> None:
    """Places of cameras in the body are given forward, right and down; their axes are not."""
    for camera in ("rgb", "depth", "events"):
        attributes = file[CAMERA + camera].attrs
        mounting = np.array(attributes["T_body_camera"])
        mounting[1:3, 3] *= -1
        attributes["T_body_camera"] = mounting


def gyro_labelled_in_degrees(file: h5py.File, plan: Plan) -> None:
    """The label of rates says deg/s, which they are not."""
    file[GYRO].attrs["units"] = "deg/s"
