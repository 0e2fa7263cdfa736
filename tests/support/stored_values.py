"""What publishers do to the numbers of a correct file: they are rounded, and stored in other types."""

from collections.abc import Callable, Mapping
from pathlib import Path
from shutil import copyfile
from types import MappingProxyType
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

Rounding = Callable[[NDArray[np.floating]], NDArray[np.floating]]

FLOWS: Final = tuple(f"path/flow/{rate}hz" for rate in (10, 25, 50))
ORIENTATIONS, POSITIONS = ("path/pose/orientation",), ("path/pose/position",)
IMU: Final = ("path/imu/angular_velocity", "path/imu/linear_acceleration")


def to_step(step: float) -> Rounding:
    """Round to multiples of a step, in double precision."""
    return lambda values: np.rint(values.astype(np.float64) / step) * step


def to_decimals(decimals: int) -> Rounding:
    """Round to decimals, in the type of the values."""
    return lambda values: np.round(values, decimals)


def through(kind: type[np.floating]) -> Rounding:
    """Round to a type of fewer digits."""
    return lambda values: values.astype(kind)


ROUNDINGS: Final[Mapping[str, tuple[tuple[str, Rounding], ...]]] = MappingProxyType(
    {
        "depth to 1 mm": (("path/depth", to_step(1.0)),),
        "flow to 1/64 px": tuple((key, to_step(1 / 64)) for key in FLOWS),
        "flow to 1/128 px": tuple((key, to_step(1 / 128)) for key in FLOWS),
        "flow to three decimals": tuple((key, to_decimals(3)) for key in FLOWS),
        "flow to four decimals": tuple((key, to_decimals(4)) for key in FLOWS),
        "flow through float16": tuple((key, through(np.float16)) for key in FLOWS),
        "quaternions to six decimals": tuple((key, to_decimals(6)) for key in ORIENTATIONS),
        "quaternions to seven decimals": tuple((key, to_decimals(7)) for key in ORIENTATIONS),
        "quaternions to nine decimals": tuple((key, to_decimals(9)) for key in ORIENTATIONS),
        "quaternions through float32": tuple((key, through(np.float32)) for key in ORIENTATIONS),
        "positions to 0.1 mm": tuple((key, to_decimals(4)) for key in POSITIONS),
        # 16 bits over +-2000 deg/s and +-4 g.
        "imu at 16 bits": (
            (IMU[0], to_step(float(np.radians(2000.0)) / 2**15)),
            (IMU[1], to_step(4 * 9.80665 / 2**15)),
        ),
        "imu as float32 of four decimals": tuple(
            (key, lambda values: np.round(values, 4).astype(np.float32)) for key in IMU
        ),
    }
)
"""Roundings of datasets by what a publisher would call them."""


def store_rounded(source: Path, target: Path, name: str) -> Path:
    """Write a copy of a file with the values of some datasets rounded; types of datasets stay."""
    copyfile(source, target)
    with h5py.File(target, "r+") as file:
        for key, rounding in ROUNDINGS[name]:
            values = file[key][:]
            file[key][:] = rounding(values).astype(values.dtype)
    return target
