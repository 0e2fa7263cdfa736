"""Optical flow of shutters, normalisations, filters, tiles and trajectories."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import POSITION

TILE = 2
"""Tiles along each side of the image."""


def to_the_end_of_the_shutter(file: h5py.File, plan: Plan) -> None:
    """Flow ends when so many percent of its interval are over, with which the shutter closes."""
    intervals_us = {f"{key}_ts": file[f"{key}_ts"][...] for key in KEYS}
    for key, values in intervals_us.items():
        starts_us, ends_us = values.T
        closed_us = starts_us + np.rint(plan.size / 100 * (ends_us - starts_us)).astype(np.int64)
        file[key][...] = np.stack([starts_us, closed_us], axis=1)
    fields = recomputed(file)
    for key, values in intervals_us.items():
        file[key][...] = values
    for key, values in fields.items():
        replace_values(file, key, values)


def over_its_longest_vector(file: h5py.File, plan: Plan) -> None:
    """Vectors of each field are divided by the length of its longest one."""
    for key in KEYS:
        values = file[key][...]
        longest_px = np.nanmax(np.linalg.norm(values, axis=-1), axis=(1, 2))
        replace_values(file, key, (values / longest_px[:, None, None, None]).astype(values.dtype))


def mean_with_the_next(file: h5py.File, plan: Plan) -> None:
    """A field is the mean of itself and the one that follows; the last one stays."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, np.concatenate([(values[:-1] + values[1:]) / 2, values[-1:]]))


def tile_of_the_interval_before(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows a quarter of the image is that of the field before."""
    column, row = plan.random.integers(TILE, size=2)
    for key in KEYS:
        values = file[key][...]
        rows = plan.rows(len(values))
        height, width = values.shape[1:3]
        tile = np.s_[
            row * height // TILE : (row + 1) * height // TILE, column * width // TILE : (column + 1) * width // TILE
        ]
        before = values.copy()
        for number in range(max(1, rows.start), max(2, rows.stop)):
            values[number][tile] = before[number - 1][tile]
        replace_values(file, key, values)


def of_a_trajectory_of_another_scale(file: h5py.File, plan: Plan) -> None:
    """Flow is made of the depth of the file and positions that are too far apart by so many percent."""
    position_m = file[POSITION][...]
    file[POSITION][...] = position_m * (1 + plan.size / 100)
    fields = recomputed(file)
    file[POSITION][...] = position_m
    for key, values in fields.items():
        replace_values(file, key, values)
