"""Flow of other axes, or sums and integers that are taken for displacements."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA

OFFSET_PX: Final = 256
"""Of vectors in 16 bits, of which 2^15 stands for 0 and 128 for a pixel."""


def of_body_axes(file: h5py.File, plan: Plan) -> None:
    """Poses of the body are taken for those of the camera: X, Y and Z of the image are those of the body."""
    attributes = file[CAMERA + "depth"].attrs
    declared = np.array(attributes["T_body_camera"])
    of_body = declared.copy()
    of_body[:3, :3] = np.eye(3)
    attributes["T_body_camera"] = of_body
    fields = recomputed(file)
    attributes["T_body_camera"] = declared
    for key, values in fields.items():
        replace_values(file, key, values)


def offset_left_in(file: h5py.File, plan: Plan) -> None:
    """Components are too large by the offset of their integers."""
    for key in KEYS:
        replace_values(file, key, file[key][...] + np.float32(OFFSET_PX))


def invalid_as_zero_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, what has no flow is 0."""
    for key in KEYS:
        fields = file[key][...]
        rows = plan.rows(len(fields))
        fields[rows] = np.nan_to_num(fields[rows], nan=0.0)
        replace_values(file, key, fields)


def chunks_out_of_order(file: h5py.File, plan: Plan) -> None:
    """At 50 Hz the two halves of the plan's rows, at least a row each, are exchanged with their intervals."""
    order = np.arange(len(file[KEYS[-1]]))
    rows = plan.rows(len(order))
    begin, stop = min(rows.start, len(order) - 2), max(rows.stop, rows.start + 2)
    order[begin:stop] = np.roll(order[begin:stop], (stop - begin) // 2)
    keep_rows(file, "flow/50hz", order)


def summed_in_place(file: h5py.File, plan: Plan) -> None:
    """At 10 Hz a vector is the sum of the vectors of 50 Hz at the same pixel; points are not followed."""
    fine, fine_us = file[KEYS[-1]][...], file[f"{KEYS[-1]}_ts"][...]
    coarse = file[KEYS[0]][...]
    for number, (begin_us, end_us) in enumerate(file[f"{KEYS[0]}_ts"][...]):
        inside = (fine_us[:, 0] >= begin_us) & (fine_us[:, 1] <= end_us)
        coarse[number] = np.where(np.isnan(coarse[number]), np.nan, np.nansum(fine[inside], axis=0))
    replace_values(file, KEYS[0], coarse)
