"""Cameras that simulators declare wrongly."""

import h5py
import numpy as np

from tests.benchmarks.foreign_faults.kind import Plan


def centres_from_1(file: h5py.File, plan: Plan) -> None:
    """Principal points of all cameras are those of pixels that count from 1: too large by 1 px."""
    for camera in file["metadata/cameras"].values():
        K = np.array(camera.attrs["K"])
        K[:2, 2] += 1
        camera.attrs["K"] = K
