"""Flow that frameworks, codings, jobs and scripts compute or store in another way."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import FLOW_RATES, keep_rows, replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan

DEPTH = "path/depth"

HUES = 180
"""Of OpenCV: a hue counts two degrees."""


def channels_first(file: h5py.File, plan: Plan) -> None:
    """The shape of a field is (2, H, W)."""
    for key in KEYS:
        replace_values(file, key, np.ascontiguousarray(file[key][...].transpose(0, 3, 1, 2)))


def in_doubles(file: h5py.File, plan: Plan) -> None:
    """Vectors are float64."""
    for key in KEYS:
        replace_values(file, key, file[key][...].astype(np.float64))


def invalid_outside(file: h5py.File, plan: Plan) -> None:
    """A vector that leads out of the image is not a number."""
    for key in KEYS:
        fields = file[key][...]
        height, width = fields.shape[1:3]
        columns, rows = np.arange(width) + fields[..., 0], np.arange(height)[:, None] + fields[..., 1]
        inside = (columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1)
        replace_values(file, key, np.where(inside[..., None], fields, np.float32(np.nan)))


def names_of_rates_exchanged(file: h5py.File, plan: Plan) -> None:
    """Fields and intervals of 10 Hz are stored under the name of 25 Hz, and the reverse."""
    for suffix in ("", "_ts"):
        slow, fast = (f"path/flow/{rate}{suffix}" for rate in ("10hz", "25hz"))
        values = file[slow][...], file[fast][...]
        for key, other in zip((fast, slow), values, strict=True):
            replace_values(file, key, other)


def written_twice(file: h5py.File, plan: Plan) -> None:
    """Fields of the plan's rows occur twice, with their intervals, each beside its twin."""
    for rate in FLOW_RATES:
        repeats = np.ones(len(file[f"path/flow/{rate}_ts"]), dtype=np.int64)
        repeats[plan.rows(len(repeats))] = 2
        keep_rows(file, f"flow/{rate}", np.repeat(np.arange(len(repeats)), repeats))


def shrunk_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Vectors of the plan's rows are those of images that are so many times smaller."""
    for key in KEYS:
        fields = file[key][...]
        fields[plan.rows(len(fields))] /= np.float32(plan.size)
        replace_values(file, key, fields)


def through_colours(file: h5py.File, plan: Plan) -> None:
    """A field is a hue for its direction and 8 bits for the share of its longest vector, and is decoded again."""
    for key in KEYS:
        fields = file[key][...]
        for number, field in enumerate(fields):
            u, v = np.moveaxis(field.astype(np.float64), -1, 0)
            longest = float(np.nanmax(np.hypot(u, v)))
            length = np.rint(255 * np.hypot(u, v) / longest) / 255 * longest
            angle = np.floor((np.arctan2(v, u) % (2 * np.pi)) / (2 * np.pi) * HUES) / HUES * 2 * np.pi
            fields[number] = np.stack([length * np.cos(angle), length * np.sin(angle)], axis=-1)
        replace_values(file, key, fields)


def of_a_plane(file: h5py.File, plan: Plan) -> None:
    """Flow is that of points which all have the median depth of their frame."""
    depth = file[DEPTH][...]
    medians = np.nanmedian(depth, axis=(1, 2), keepdims=True)
    replace_values(file, DEPTH, np.where(np.isnan(depth), np.nan, medians).astype(depth.dtype))
    fields = recomputed(file)
    replace_values(file, DEPTH, depth)
    for key, values in fields.items():
        replace_values(file, key, values)


def upside_down(file: h5py.File, plan: Plan) -> None:
    """Rows of all fields count from below, and vectors stay."""
    for key in KEYS:
        replace_values(file, key, np.ascontiguousarray(file[key][...][:, ::-1]))
