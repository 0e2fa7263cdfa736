"""Faults of the depth frames."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import edit_values

CAMERA = "metadata/cameras/depth"


def unit_mm_m(file: h5py.File, fault: Fault) -> None:
    """Multiply depth by the magnitude: 0.001 writes metres."""
    factor = np.float32(fault.magnitude_in("1"))
    edit_values(file, fault, lambda depths: depths * factor)


def depth_ray_not_z(file: h5py.File, fault: Fault) -> None:
    """Write the length of the ray from the camera's centre: z times |K^-1 (u, v, 1)|."""
    if CAMERA not in file:
        raise FaultError(f"Expected {CAMERA}, got none: the intrinsics are needed")
    height, width = file["path/depth"].shape[1:]
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    directions = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(file[CAMERA].attrs["K"]).T
    lengths = np.linalg.norm(directions, axis=-1)
    edit_values(file, fault, lambda depths: (depths * lengths).astype(depths.dtype))
