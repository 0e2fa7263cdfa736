"""Cameras that are declared otherwise than the images were made."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign_faults.kind import Plan, Plant


def _attributes(file: h5py.File, camera: str) -> h5py.AttributeManager:
    return file[f"metadata/cameras/{camera}"].attrs


def focal(camera: str) -> Plant:
    """Both focal lengths are too large by so many percent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        K = np.array(_attributes(file, camera)["K"])
        K[[0, 1], [0, 1]] *= 1 + plan.size / 100
        _attributes(file, camera)["K"] = K

    return plant


def centre(camera: str) -> Plant:
    """The principal point lies so many px off, in a random direction."""

    def plant(file: h5py.File, plan: Plan) -> None:
        K = np.array(_attributes(file, camera)["K"])
        angle = plan.random.uniform(0, 2 * np.pi)
        K[:2, 2] += plan.size * np.array([np.cos(angle), np.sin(angle)])
        _attributes(file, camera)["K"] = K

    return plant


def centres_of_corners(file: h5py.File, plan: Plan) -> None:
    """Pixels are taken to begin at their coordinates: cx = W/2, cy = H/2, for the event camera."""
    K = np.array(_attributes(file, "events")["K"])
    K[:2, 2] += 0.5
    _attributes(file, "events")["K"] = K


def transposed(file: h5py.File, plan: Plan) -> None:
    """K is stored by columns, as Fortran and MATLAB do."""
    for camera in file["metadata/cameras"].values():
        camera.attrs["K"] = np.ascontiguousarray(np.asarray(camera.attrs["K"]).T)


def size_exchanged(file: h5py.File, plan: Plan) -> None:
    """Width and height of the event camera are exchanged."""
    attributes = _attributes(file, "events")
    attributes["width"], attributes["height"] = attributes["height"], attributes["width"]


def tilted(camera: str) -> Plant:
    """The mounting is turned by so many degrees about a random axis."""

    def plant(file: h5py.File, plan: Plan) -> None:
        mount = np.array(_attributes(file, camera)["T_body_camera"])
        turn = Rotation.from_rotvec(np.deg2rad(plan.size) * plan.direction()).as_matrix()
        mount[:3, :3] = mount[:3, :3] @ turn
        _attributes(file, camera)["T_body_camera"] = mount

    return plant


def inverted(file: h5py.File, plan: Plan) -> None:
    """Transforms lead from the body into the cameras."""
    for camera in file["metadata/cameras"].values():
        camera.attrs["T_body_camera"] = np.linalg.inv(np.asarray(camera.attrs["T_body_camera"]))


def range_in_millimetres(file: h5py.File, plan: Plan) -> None:
    """The range of depth is in millimetres."""
    file["metadata/depth_range"][...] = file["metadata/depth_range"][...] * 1000
