"""A plain convention in which an exporter may write a stream or a declaration, and how to plant it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Change = Callable[[h5py.File], None]
POSITION, ORIENTATION = "path/pose/position", "path/pose/orientation"
GYRO, ACCELEROMETER = "path/imu/angular_velocity", "path/imu/linear_acceleration"


@dataclass(frozen=True, slots=True)
class Convention:
    """What is written otherwise.

    Attributes
    ----------
    truth
        Names that are right as the first.
    change
        Writes the stream so.
    """

    truth: tuple[str, ...]
    change: Change


Conventions = Mapping[str, Convention]


def rewrite(file: h5py.File, key: str, values: Array) -> None:
    """Replace all rows of a dataset by as many, in its own type."""
    file[key][...] = values.astype(file[key].dtype)


def mapped(*keys: str, by: Callable[[Array], Array]) -> Change:
    """Return what applies a function to all rows of datasets."""

    def change(file: h5py.File) -> None:
        for key in keys:
            rewrite(file, key, by(file[key][()]))

    return change


def times(factor: float) -> Callable[[Array], Array]:
    """Return what multiplies values."""
    return lambda values: values * factor


def of_flow(by: Callable[[Array, float], Array]) -> Change:
    """Return what applies a function of flow (n, h, w, 2) and its rate, Hz, to every rate."""

    def change(file: h5py.File) -> None:
        for name in file["path/flow"]:
            if name.endswith("hz"):
                key = f"path/flow/{name}"
                rewrite(file, key, by(file[key][()], float(name.removesuffix("hz"))))

    return change


def both(*changes: Change) -> Change:
    """Return what makes several changes, one after the other."""

    def change(file: h5py.File) -> None:
        for each in changes:
            each(file)

    return change


def of_cameras(attribute: str, by: Callable[[Array, h5py.Group], Array], *names: str) -> Change:
    """Return what applies a function of an attribute and its camera to the declared cameras of these names."""

    def change(file: h5py.File) -> None:
        for name in names or ("rgb", "depth", "events"):
            camera = file[f"metadata/cameras/{name}"]
            camera.attrs[attribute] = by(np.array(camera.attrs[attribute], dtype=np.float64), camera)

    return change
