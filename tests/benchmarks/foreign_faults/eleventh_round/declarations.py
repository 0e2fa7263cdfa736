"""Cameras whose matrices and mountings exporters, calibrations and instructions declare wrongly."""

import h5py
import numpy as np

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA

NEARLY_ZERO_M = 5e-5
"""Standard deviation of a calibrated coordinate that no motion determines."""


def matrix_of_projection(file: h5py.File, plan: Plan) -> None:
    """K of colour is the projection of Unity: 2 f / W and 2 f / H, no centre, and a depth of -1.00002."""
    attributes = file[CAMERA + "rgb"].attrs
    K = np.array(attributes["K"])
    attributes["K"] = np.diag([2 * K[0, 0] / attributes["width"], 2 * K[1, 1] / attributes["height"], -1.00002])


def at_the_origin(file: h5py.File, plan: Plan) -> None:
    """All cameras lie within 0.1 mm or so of the body's origin."""
    for camera in file["metadata/cameras"].values():
        mounting = np.array(camera.attrs["T_body_camera"])
        mounting[:3, 3] = plan.random.normal(0.0, NEARLY_ZERO_M, 3)
        camera.attrs["T_body_camera"] = mounting


def x_and_y_kept(file: h5py.File, plan: Plan) -> None:
    """X and Y of all cameras are exchanged: forward, right and down are (z, y, x) where they are (z, x, y)."""
    for camera in file["metadata/cameras"].values():
        mounting = np.array(camera.attrs["T_body_camera"])
        mounting[:, :2] = mounting[:, [1, 0]]
        camera.attrs["T_body_camera"] = mounting
