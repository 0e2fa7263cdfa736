"""Colour and depth frames that readers, links, cameras and buffers change."""

from typing import Final

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fifth_round.frames import on_bytes
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR, DEPTH
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME

ALIGNMENT_PX: Final = 64
"""Rows of a buffer on a graphics card have a multiple of so many pixels."""

PLACES: Final = (0.1, 0.7)
"""Of the height, where a line is lost."""


def interleaved_read_as_planes(file: h5py.File, plan: Plan) -> None:
    """The values R, G, B of all pixels in sequence are read as three images, one behind the other."""
    frames = file[COLOUR][...]
    count, height, width, channels = frames.shape
    planes = frames.reshape(count, channels, height, width)
    replace_values(file, COLOUR, np.ascontiguousarray(np.moveaxis(planes, 1, -1)))


def lines_of_the_mosaic_lost(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows a line of each frame's mosaic (RGGB) is lost anywhere; those below move up.

    The last line occurs twice. Colours are then interpolated as if nothing were lost.
    """
    frames = file[COLOUR][...]
    rows, height = plan.rows(len(frames)), frames.shape[1]
    for number in range(rows.start, rows.stop):
        mosaic = frames[number, ..., 1].copy()
        mosaic[::2, ::2] = frames[number, ::2, ::2, 0]
        mosaic[1::2, 1::2] = frames[number, 1::2, 1::2, 2]
        line = int(plan.random.uniform(*PLACES) * height)
        mosaic[line:-1] = mosaic[line + 1 :]
        # OpenCV names a pattern by its second row, from the second pixel on: that of RGGB is BG.
        frames[number] = cv2.cvtColor(mosaic, cv2.COLOR_BayerBG2RGB)
    replace_values(file, COLOUR, frames)


def gap_of_times_before_that_of_frames(file: h5py.File, plan: Plan) -> None:
    """So many frames are lost behind the plan's rows, and as many times before them; maps follow the times."""
    frames, timestamps_us = file[COLOUR][...], file[COLOUR_TIME][...]
    total, lost = len(frames), int(plan.size)
    first = max(1, round(plan.begin * (total - lost - 2)))
    behind = min(total - lost - 1, max(first + 1, round(plan.end * (total - lost))))
    replace_values(file, COLOUR, np.delete(frames, np.s_[behind : behind + lost], axis=0))
    replace_values(file, COLOUR_TIME, np.delete(timestamps_us, np.s_[first : first + lost]))
    update_index_maps(file)


def begins_at_another_column(file: h5py.File, plan: Plan) -> None:
    """Rows of all frames begin so many pixels too late, and end with what is before."""
    frames = file[COLOUR][...]
    replace_values(file, COLOUR, np.roll(frames, int(plan.size) % frames.shape[2], axis=2))


def zoom_grows(file: h5py.File, plan: Plan) -> None:
    """The focal length of colour grows evenly from that of K, by so many percent in all."""
    frames = file[COLOUR][...]
    K = np.array(file[CAMERA + "rgb"].attrs["K"])
    columns, rows = np.meshgrid(np.arange(frames.shape[2], dtype=float), np.arange(frames.shape[1], dtype=float))
    for number, share in enumerate(np.linspace(0, 1, len(frames))):
        zoom = 1 + plan.size / 100 * share
        at = [centre + (places - centre) / zoom for places, centre in ((columns, K[0, 2]), (rows, K[1, 2]))]
        frames[number] = on_bytes(sampled(frames[number].astype(np.float64), *at))
    replace_values(file, COLOUR, frames)


def every_second_frame_again(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows every second frame, at least one, is the one before it."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    for number in range(max(1, rows.start), max(2, rows.stop), 2):
        frames[number] = frames[number - 1]
    replace_values(file, COLOUR, frames)


def fewer_times_than_frames(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the times are absent, and all frames are there; maps follow the times."""
    timestamps_us = file[COLOUR_TIME][...]
    absent = max(1, round(plan.size / 100 * len(timestamps_us)))
    replace_values(file, COLOUR_TIME, timestamps_us[:-absent])
    update_index_maps(file)


def rows_of_an_aligned_buffer(file: h5py.File, plan: Plan) -> None:
    """Rows of a buffer, whose ends have no value, are read as if they had the width of the image."""
    depth = file[DEPTH][...]
    count, height, width = depth.shape
    aligned = -(-width // ALIGNMENT_PX) * ALIGNMENT_PX
    aligned += ALIGNMENT_PX if aligned == width else 0
    buffer = np.full((count, height, aligned), np.nan, dtype=depth.dtype)
    buffer[..., :width] = depth
    replace_values(file, DEPTH, buffer.reshape(count, -1)[:, : height * width].reshape(depth.shape))


def without_values_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows have no values."""
    depth = file[DEPTH][...]
    depth[plan.rows(len(depth))] = np.nan
    replace_values(file, DEPTH, depth)


def squares_of_zeros_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Each frame of the plan's rows has a square of zeros anywhere, whose side is so many percent of the height."""
    depth = file[DEPTH][...]
    height, width = depth.shape[1:]
    side = max(2, round(plan.size / 100 * height))
    rows = plan.rows(len(depth))
    for number in range(rows.start, rows.stop):
        top, left = plan.random.integers(height - side + 1), plan.random.integers(width - side + 1)
        depth[number, top : top + side, left : left + side] = 0
    replace_values(file, DEPTH, depth)


def registered_with_the_mirrored_centre(file: h5py.File, plan: Plan) -> None:
    """Depth lies so many pixels too far to the right: its centre counts from the other side. The edge is repeated."""
    depth = file[DEPTH][...]
    width = depth.shape[2]
    replace_values(file, DEPTH, np.take(depth, np.clip(np.arange(width) - int(plan.size), 0, width - 1), axis=2))
