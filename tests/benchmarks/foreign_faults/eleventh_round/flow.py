"""Optical flow that archives, networks, loaders and tools for ground truth change."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.kind import Plan

SLOW, *FAST = KEYS

DIVISOR: Final = 20
"""Of the flow on which a network is trained."""


def upper_half_twice(file: h5py.File, plan: Plan) -> None:
    """The lower half of each field is its upper half."""
    for key in KEYS:
        values = file[key][...]
        half = values.shape[1] // 2
        values[:, -half:] = values[:, :half]
        replace_values(file, key, values)


def as_a_network_gives_it(file: h5py.File, plan: Plan) -> None:
    """Vectors are 20ths of what they should be."""
    for key in KEYS:
        values = file[key][...]
        replace_values(file, key, (values / DIVISOR).astype(values.dtype))


def parts_of_the_slow_flow(file: h5py.File, plan: Plan) -> None:
    """A fast field is the slow one over its time, in proportion to the lengths of their intervals."""
    slow, slow_us = file[SLOW][...], file[f"{SLOW}_ts"][...]
    for key in FAST:
        intervals_us = file[f"{key}_ts"][...]
        over = np.clip(np.searchsorted(slow_us[:, 0], intervals_us[:, 0], "right") - 1, 0, None)
        parts = np.diff(intervals_us, axis=1)[:, 0] / np.diff(slow_us, axis=1)[over, 0]
        replace_values(file, key, (slow[over] * parts[:, None, None, None]).astype(slow.dtype))


def columns_before_rows(file: h5py.File, plan: Plan) -> None:
    """Fields are arrays (W, H, 2); vectors are as they were."""
    for key in KEYS:
        replace_values(file, key, np.ascontiguousarray(np.swapaxes(file[key][...], 1, 2)))


def not_a_number_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Fields of the plan's rows have no values."""
    for key in KEYS:
        values = file[key][...]
        values[plan.rows(len(values))] = np.nan
        replace_values(file, key, values)


def thousands_where_depth_is_invalid(file: h5py.File, plan: Plan) -> None:
    """Pixels without flow have vectors of so many px at the median, in any direction."""
    for key in KEYS:
        values = file[key][...]
        invalid = np.isnan(values).any(axis=-1)
        angle = plan.random.uniform(0, 2 * np.pi, int(invalid.sum()))
        length_px = plan.size * np.exp(plan.random.normal(0.0, 0.5, len(angle)))
        values[invalid] = (length_px * np.array([np.cos(angle), np.sin(angle)])).T
        replace_values(file, key, values)
