"""Colour frames and depth that engines, converters, drivers and renderers change."""

from typing import Final

import cv2
import h5py
import numpy as np
from scipy.ndimage import minimum_filter

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fifth_round.frames import on_bytes
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sensor import LUMA

COLOUR: Final = "path/rgb"
DEPTH: Final = "path/depth"

INVALID_16_BITS: Final = 65_535
"""What stands for no depth in 16 bits."""

LEVELS: Final = 255
"""Of depth in 8 bits."""

NEARLY_BLACK: Final = 0.02
"""Of the light, in a frame that is nearly black."""


def encoded_for_a_screen(file: h5py.File, plan: Plan) -> None:
    """Frames have the curve of sRGB."""
    light = np.arange(256) / 255
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    replace_values(file, COLOUR, on_bytes(255 * curve)[file[COLOUR][...]])


def exposure_adapts(file: h5py.File, plan: Plan) -> None:
    """At the beginning of the plan's rows frames are brighter by so many percent, and this decays to the end."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    passed = np.arange(rows.stop - rows.start) / (rows.stop - rows.start)
    gain = 1 + plan.size / 100 * np.exp(-3 * passed)
    frames[rows] = on_bytes(frames[rows] * gain[:, None, None, None])
    replace_values(file, COLOUR, frames)


def now_and_then_nearly_black(file: h5py.File, plan: Plan) -> None:
    """So many percent of the frames, at least one, have a fiftieth of their light."""
    frames = file[COLOUR][...]
    dark = plan.random.random(len(frames)) < plan.size / 100
    dark[int(plan.random.integers(len(frames)))] = True
    frames[dark] = on_bytes(NEARLY_BLACK * frames[dark])
    replace_values(file, COLOUR, frames)


def each_frame_again(file: h5py.File, plan: Plan) -> None:
    """Each of the plan's frames occurs so many times more, with its time."""
    times = np.ones(len(file[COLOUR]), dtype=np.int64)
    times[plan.rows(len(times))] += int(plan.size)
    keep_rows(file, "rgb", np.repeat(np.arange(len(times)), times))
    update_index_maps(file)


def a_part_of_the_frames(file: h5py.File, plan: Plan) -> None:
    """Of each so many of the plan's frames in sequence, the first alone is kept."""
    kept = np.ones(len(file[COLOUR]), dtype=bool)
    rows = plan.rows(len(kept))
    kept[rows] = np.arange(rows.stop - rows.start) % int(plan.size) == 0
    keep_rows(file, "rgb", np.flatnonzero(kept))
    update_index_maps(file)


def behind_the_pose(file: h5py.File, plan: Plan) -> None:
    """Colour and depth of each frame are those of so many frames before; the first ones repeat."""
    for key in (COLOUR, DEPTH):
        frames = file[key][...]
        replace_values(file, key, frames[np.maximum(np.arange(len(frames)) - int(plan.size), 0)])


def invalid_as_65535(file: h5py.File, plan: Plan) -> None:
    """What has no depth is 65535."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, np.where(np.isnan(depth), INVALID_16_BITS, depth).astype(depth.dtype))


def in_8_bits(file: h5py.File, plan: Plan) -> None:
    """Depth is a whole number of 255ths of a far plane, so many metres away."""
    depth = file[DEPTH][...]
    step_mm = 1000 * plan.size / LEVELS
    replace_values(file, DEPTH, (np.rint(depth / step_mm) * step_mm).astype(depth.dtype))


def share_of_a_shorter_range(file: h5py.File, plan: Plan) -> None:
    """A share of the far plane's distance was multiplied by this distance less that of a near plane, so many m."""
    depth = file[DEPTH][...]
    far_m = float(file["metadata/depth_range"][1])
    replace_values(file, DEPTH, (depth * (1 - plan.size / far_m)).astype(depth.dtype))


def near_things_inflated(file: h5py.File, plan: Plan) -> None:
    """Each pixel has the least depth of those within so many px; what had none stays without."""
    depth = file[DEPTH][...]
    window = 2 * int(plan.size) + 1
    for number, frame in enumerate(depth):
        nearest = minimum_filter(np.where(np.isnan(frame), np.inf, frame), window, mode="nearest")
        depth[number] = np.where(np.isnan(frame), np.nan, nearest)
    replace_values(file, DEPTH, depth)


def grey_in_place_of_depth(file: h5py.File, plan: Plan) -> None:
    """A pixel of depth has the luma of the nearest colour frame in time, 0 to 255."""
    depth = file[DEPTH][...]
    colour_us = file["path/rgb_ts"][...]
    height, width = depth.shape[1:]
    for number, instant_us in enumerate(file["path/depth_ts"][...].tolist()):
        luma = file[COLOUR][int(np.argmin(np.abs(colour_us - instant_us)))] @ LUMA
        depth[number] = cv2.resize(luma, (width, height), interpolation=cv2.INTER_AREA)
    replace_values(file, DEPTH, depth)
