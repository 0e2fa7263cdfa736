"""Faults that tests plant in copies of a canonical file, written from the format alone."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

Planter = Callable[[h5py.File], None]

TIMES = "path/events/t"


def planted(clean: Path, target: Path, *faults: Planter) -> Path:
    """A copy of a file with faults."""
    shutil.copyfile(clean, target)
    with h5py.File(target, "r+") as file:
        for plant in faults:
            plant(file)
    return target


def delay_events(file: h5py.File) -> None:
    """Make events 3 ms late; the index maps are those of the events as they are stored."""
    events_us = file[TIMES][()] + 3000
    file[TIMES][...] = events_us
    for stream in ("rgb", "depth"):
        file[f"metadata/{stream}_to_event"][...] = np.searchsorted(events_us, file[f"path/{stream}_ts"][()], "left")


def flip_polarity(file: h5py.File) -> None:
    file["path/events/p"][...] = 1 - file["path/events/p"][()]


def bias_gyro(file: h5py.File) -> None:
    file["path/imu/angular_velocity"][...] += np.array([0.02, -0.03, 0.01])
