"""Depth that stereo, filters, confidence and rotating sensors change."""

from typing import Final

import h5py
import numpy as np
from scipy.ndimage import uniform_filter

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sensor import LUMA

DEPTH: Final = "path/depth"

BASE_LINE_MM: Final = 210.0
"""Of the stereo camera."""

WINDOW_PX: Final = 7
"""Side of the window that stereo matches."""


def holes_kept_from_before(file: h5py.File, plan: Plan) -> None:
    """A pixel without depth has the latest that it had; before the first there is none."""
    depth = file[DEPTH][...]
    for number in range(1, len(depth)):
        depth[number] = np.where(np.isnan(depth[number]), depth[number - 1], depth[number])
    replace_values(file, DEPTH, depth)


def even_surfaces_invalid(file: h5py.File, plan: Plan) -> None:
    """Where colour varies least, in so many percent of each frame, there is no depth."""
    depth = file[DEPTH][...]
    colour_us = file["path/rgb_ts"][...]
    for number, instant_us in enumerate(file["path/depth_ts"][...].tolist()):
        luma = file["path/rgb"][int(np.argmin(np.abs(colour_us - instant_us)))] @ LUMA
        varies = uniform_filter(luma**2, WINDOW_PX) - uniform_filter(luma, WINDOW_PX) ** 2
        # Even surfaces vary equally, by nothing: which of them have depth is drawn by place.
        order = np.argsort(varies + 1e-6 * plan.random.random(varies.shape), axis=None)
        depth[number].ravel()[order[: round(plan.size / 100 * order.size)]] = np.nan
    replace_values(file, DEPTH, depth)


def disparity_off(file: h5py.File, plan: Plan) -> None:
    """Depth is f b / (f b / z + d): all disparities are too large by so many px."""
    depth = file[DEPTH][...]
    product = float(file["metadata/cameras/depth"].attrs["K"][0, 0]) * BASE_LINE_MM
    replace_values(file, DEPTH, (product / (product / depth + plan.size)).astype(depth.dtype))


def columns_swept(file: h5py.File, plan: Plan) -> None:
    """Columns are of different times, the last so many ms after the first, and the middle one of the frame's."""
    depth = file[DEPTH][...]
    frames_us = file["path/depth_ts"][...].astype(np.float64)
    width = depth.shape[2]
    swept = np.empty_like(depth)
    for column in range(width):
        wanted_us = frames_us + 1000 * plan.size * (column / (width - 1) - 0.5)
        nearest = np.abs(frames_us[None] - wanted_us[:, None]).argmin(axis=1)
        swept[:, :, column] = depth[nearest, :, column]
    replace_values(file, DEPTH, swept)
