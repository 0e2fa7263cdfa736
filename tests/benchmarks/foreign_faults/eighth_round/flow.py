"""Flow in other units, types and orders, and without a tile."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.eighth_round.frames import derangement
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.seventh_round.events import CHOICE, tiles_of

FLOW_TIMES: Final = tuple(f"{key}_ts" for key in KEYS)

NANOSECONDS_PER_US: Final = 1000


def per_millisecond(file: h5py.File, plan: Plan) -> None:
    """Vectors are divided by the length of their interval, ms."""
    for key in KEYS:
        fields = file[key][...]
        milliseconds = np.diff(file[f"{key}_ts"][...], axis=1)[:, 0] / 1000
        replace_values(file, key, (fields / milliseconds[:, None, None, None]).astype(fields.dtype))


def in_whole_pixels(file: h5py.File, plan: Plan) -> None:
    """Components lost what is behind their point."""
    for key in KEYS:
        replace_values(file, key, np.trunc(file[key][...]))


def of_texture_coordinates(file: h5py.File, plan: Plan) -> None:
    """Vectors are shares of the width and height, and v points upwards."""
    for key in KEYS:
        fields = file[key][...]
        size = np.array([fields.shape[2], -fields.shape[1]])
        replace_values(file, key, (fields / size).astype(fields.dtype))


def intervals_in_nanoseconds(file: h5py.File, plan: Plan) -> None:
    """Times of flow are in nanoseconds."""
    for key in FLOW_TIMES:
        replace_values(file, key, file[key][...] * NANOSECONDS_PER_US)


def intervals_without_ends(file: h5py.File, plan: Plan) -> None:
    """Of intervals the start alone is stored."""
    for key in FLOW_TIMES:
        replace_values(file, key, file[key][...][:, 0])


def in_any_order(file: h5py.File, plan: Plan) -> None:
    """Fields of each rate are in a random order, and intervals in that of time."""
    for key in KEYS:
        fields = file[key][...]
        replace_values(file, key, fields[derangement(plan.random, len(fields))])


def tile_not_computed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows one of 3 x 3 tiles, one of those that have most flow, is not a number."""
    height, width = file[KEYS[0]].shape[1:3]
    valid = np.isfinite(file[KEYS[0]][0, ..., 0])
    tiles = sorted(tiles_of(width, height), key=lambda tile: int(valid[tile[1], tile[0]].sum()))
    columns, lines = tiles[-1 - int(plan.random.integers(CHOICE))]
    for key in KEYS:
        fields = file[key][...]
        fields[plan.rows(len(fields)), lines, columns] = np.nan
        replace_values(file, key, fields)


def of_half_the_rate_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows fields of 50 Hz are those of 25 Hz of the same time."""
    fine, coarse = file[KEYS[2]][...], file[KEYS[1]][...]
    starts_us = file[FLOW_TIMES[1]][...][:, 0]
    source = np.searchsorted(starts_us, file[FLOW_TIMES[2]][...][:, 0], "right") - 1
    rows = plan.rows(len(fine))
    fine[rows] = coarse[np.clip(source[rows], 0, len(coarse) - 1)]
    replace_values(file, KEYS[2], fine)
