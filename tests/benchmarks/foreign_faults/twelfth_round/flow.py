"""Optical flow that renderers, resizing, scripts and lists of intervals spoil."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant
from tests.benchmarks.foreign_faults.paths import FLOW

SLOW, MIDDLE, FAST = FLOW
"""Of 10, 25 and 50 Hz."""

UNITS: Final = ("px/s", "px s", "sizes of the image")


def multiplied(u: float, v: float) -> Plant:
    """Components of all fields are multiplied by constants."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for key in FLOW:
            values = file[key][...]
            replace_values(file, key, values * np.array([u, v], dtype=values.dtype))

    return plant


def too_long(file: h5py.File, plan: Plan) -> None:
    """Vectors are too long by so many percent."""
    multiplied(1 + plan.size / 100, 1 + plan.size / 100)(file, plan)


def in_another_unit(file: h5py.File, plan: Plan) -> None:
    """All fields are divided by their interval, multiplied by it, or relative to the image, by chance."""
    unit = plan.random.choice(UNITS)
    for key in FLOW:
        values = file[key][...]
        intervals_s = np.diff(file[f"{key}_ts"][...], axis=1)[:, :, None, None] / 1e6
        height, width = values.shape[1:3]
        factor = {"px/s": 1 / intervals_s, "px s": intervals_s, "sizes of the image": 1 / np.array([width, height])}
        replace_values(file, key, (values * factor[unit]).astype(values.dtype))


def fast_as_middle(file: h5py.File, plan: Plan) -> None:
    """A field of 25 Hz is that of 50 Hz which begins with it."""
    values, fast = file[MIDDLE][...], file[FAST][...]
    starts_us, fast_starts_us = (file[f"{key}_ts"][...][:, 0] for key in (MIDDLE, FAST))
    rows = np.clip(np.searchsorted(fast_starts_us, starts_us), 0, len(fast) - 1)
    replace_values(file, MIDDLE, fast[rows].astype(values.dtype))


def of_another_interval(file: h5py.File, plan: Plan) -> None:
    """A field of 50 Hz belongs to so many intervals before its own; at an end the last one repeats."""
    values = file[FAST][...]
    rows = np.clip(np.arange(len(values)) - int(plan.size), 0, len(values) - 1)
    replace_values(file, FAST, values[rows])


def repeated(file: h5py.File, plan: Plan) -> None:
    """So many fields of 50 Hz in sequence are the one before them."""
    values = file[FAST][...]
    count = min(int(plan.size), len(values) - 2)
    first = 1 + round(plan.begin * (len(values) - count - 1))
    values[first : first + count] = values[first - 1]
    replace_values(file, FAST, values)


def neighbours_exchanged(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows each two fields of 25 Hz in sequence are exchanged, at least two; their times stay."""
    values = file[MIDDLE][...]
    rows = plan.rows(len(values) - 1)
    places = np.arange(len(values))
    for first in range(rows.start, rows.stop, 2):
        places[[first, first + 1]] = places[[first + 1, first]]
    replace_values(file, MIDDLE, values[places])
