"""Flow that renderers, resizing and readers compute or store in another way."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.kind import Plan

LEVELS: Final = 1024
"""Of vectors as shares of half the image: 10 bits."""


def in_10_bits(file: h5py.File, plan: Plan) -> None:
    """Vectors are whole numbers of 1024ths of half the width and height."""
    for key in KEYS:
        fields = file[key][...]
        step = np.array([fields.shape[2], fields.shape[1]]) / 2 / LEVELS
        replace_values(file, key, (np.rint(fields / step) * step).astype(fields.dtype))


def of_another_size(file: h5py.File, plan: Plan) -> None:
    """Vectors are those of an image so many times as large, or as small where the size is negative."""
    factor = plan.size if plan.size > 0 else -1 / plan.size
    for key in KEYS:
        fields = file[key][...]
        replace_values(file, key, (fields * factor).astype(fields.dtype))


def towards_the_frame_before(file: h5py.File, plan: Plan) -> None:
    """A field leads from its start to the start of the interval before, as that interval's vectors turned around.

    The first field is that of its own interval, turned around.
    """
    for key in KEYS:
        fields = file[key][...]
        replace_values(file, key, -np.concatenate([fields[:1], fields[:-1]]))
