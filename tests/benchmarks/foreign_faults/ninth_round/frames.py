"""Colour and depth that codecs, recorders, lenses, networks and drivers change."""

from itertools import pairwise
from typing import Final

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.depth import DEPTH
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR

HOOD_SHARE: Final = 0.05
"""Of the half diagonal, the width of the edge of a hood."""

BLOCK_PX: Final = 16

BRIGHT_QUANTILE: Final = 0.9
"""Of luma, above which light blooms."""

BLOOM_SHARE: Final = 0.03
"""Of the width, the standard deviation of a bloom."""

STRIDE_PX: Final = 32
"""Sizes that networks take are whole multiples of it."""

EDGE_SHARE: Final = 0.05
"""Of depth, what the values beside an edge differ at least."""

METRE_MM: Final = 1000


def brighter_in_bytes(file: h5py.File, plan: Plan) -> None:
    """Light is raised by so many percent, and what exceeds a byte begins again at 0."""
    values = np.rint(np.arange(256) * (1 + plan.size / 100)).astype(np.int64) % 256
    replace_values(file, COLOUR, values.astype(np.uint8)[file[COLOUR][...]])


def like_the_last_left_out(file: h5py.File, plan: Plan) -> None:
    """Frames are left out that differ less from the last one kept than so many percent of neighbours do."""
    frames = file[COLOUR][...].astype(np.float32)
    differences = np.abs(np.diff(frames, axis=0)).mean(axis=(1, 2, 3))
    least = np.quantile(differences, plan.size / 100)
    kept = [0]
    for number in range(1, len(frames)):
        if np.abs(frames[number] - frames[kept[-1]]).mean() > least:
            kept.append(number)
    keep_rows(file, "rgb", np.array(kept))
    update_index_maps(file)


def behind_a_hood(file: h5py.File, plan: Plan) -> None:
    """A hood hides what lies in the outermost so many percent of the half diagonal; its edge is out of focus."""
    frames = file[COLOUR][...]
    rows, columns = np.indices(frames.shape[1:3])
    radius = np.hypot(rows - (frames.shape[1] - 1) / 2, columns - (frames.shape[2] - 1) / 2)
    inwards = (1 - plan.size / 100) - radius / radius.max()
    passes = np.clip(0.5 + inwards / HOOD_SHARE, 0, 1)
    replace_values(file, COLOUR, np.rint(frames * passes[None, ..., None]).astype(np.uint8))


def shaken_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Each of the plan's frames is shifted at random, with a standard deviation of so many px along each axis."""
    frames = file[COLOUR][...]
    height, width = frames.shape[1:3]
    rows = plan.rows(len(frames))
    for number in range(rows.start, rows.stop):
        shift = np.c_[np.eye(2), plan.random.normal(0.0, plan.size, 2)]
        frames[number] = cv2.warpAffine(frames[number], shift, (width, height), borderMode=cv2.BORDER_REPLICATE)
    replace_values(file, COLOUR, frames)


def some_of_the_run_before(file: h5py.File, plan: Plan) -> None:
    """One of so many frames in sequence is that of another run."""
    frames = file[COLOUR][...]
    every = int(plan.size)
    with h5py.File(plan.donor) as donor:
        frames[every - 1 :: every] = donor[COLOUR][...][every - 1 :: every]
    replace_values(file, COLOUR, frames)


def turned_by_half_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows frames are turned by 180 degrees."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = frames[rows, ::-1, ::-1].copy()
    replace_values(file, COLOUR, frames)


def alpha_first(file: h5py.File, plan: Plan) -> None:
    """The first three of alpha, red, green and blue are stored."""
    frames = file[COLOUR][...]
    opaque = np.full_like(frames[..., :1], 255)
    replace_values(file, COLOUR, np.concatenate([opaque, frames[..., :2]], axis=-1))


def still_blocks_kept_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows a block of 16 x 16 px is replaced only when it differs, in the mean, by so many DN."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    for number in range(max(1, rows.start), rows.stop):
        for top in range(0, frames.shape[1], BLOCK_PX):
            for left in range(0, frames.shape[2], BLOCK_PX):
                block = np.s_[top : top + BLOCK_PX, left : left + BLOCK_PX]
                before, after = frames[number - 1][block], frames[number][block]
                if np.abs(after.astype(np.float64) - before).mean() < plan.size:
                    frames[number][block] = before
    replace_values(file, COLOUR, frames)


def bloom(file: h5py.File, plan: Plan) -> None:
    """So many percent of what is brighter than nine tenths of the image is added around it, out of focus."""
    frames = file[COLOUR][...]
    least = np.quantile(frames, BRIGHT_QUANTILE)
    for number, frame in enumerate(frames):
        bright = np.where(frame > least, frame, 0).astype(np.float64)
        glow = cv2.GaussianBlur(bright, (0, 0), BLOOM_SHARE * frame.shape[1])
        frames[number] = np.rint(np.minimum(frame + plan.size / 100 * glow, 255)).astype(np.uint8)
    replace_values(file, COLOUR, frames)


def padded_for_a_network(file: h5py.File, plan: Plan) -> None:
    """Frames are padded, right and below, to whole multiples of 32 px, and made as small as they were."""
    depth = file[DEPTH][...]
    height, width = depth.shape[1:]
    below, right = -height % STRIDE_PX, -width % STRIDE_PX
    for number, frame in enumerate(depth):
        padded = np.pad(frame, ((0, below), (0, right)), mode="edge")
        depth[number] = cv2.resize(padded, (width, height), interpolation=cv2.INTER_NEAREST)
    replace_values(file, DEPTH, depth)


def edges_invalid_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows what lies within so many px of a step of depth has no value."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    around = np.ones((2 * int(plan.size) + 1,) * 2, dtype=np.uint8)
    for number in range(rows.start, rows.stop):
        frame = np.nan_to_num(depth[number], nan=np.nanmax(depth[number]))
        nearest, farthest = (change(frame, np.ones((3, 3), dtype=np.uint8)) for change in (cv2.erode, cv2.dilate))
        is_edge = (farthest - nearest > EDGE_SHARE * nearest).astype(np.uint8)
        depth[number][cv2.dilate(is_edge, around) > 0] = np.nan
    replace_values(file, DEPTH, depth)


def in_bytes_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows depth is in steps of so many mm."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    depth[rows] = np.rint(depth[rows] / plan.size) * plan.size
    replace_values(file, DEPTH, depth)


def in_millimetres_twice(file: h5py.File, plan: Plan) -> None:
    """What is in millimetres is multiplied by 1000 again."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, (depth * METRE_MM).astype(depth.dtype))


def faded_from_a_lower_rate(file: h5py.File, plan: Plan) -> None:
    """One of so many frames is a key; the others are weighted means of the keys before and after them."""
    depth = file[DEPTH][...]
    every = int(plan.size)
    keys = np.unique(np.r_[np.arange(0, len(depth), every), len(depth) - 1])
    faded = depth.copy()
    for begin, end in pairwise(keys):
        before, after = depth[begin], depth[end]
        for number in range(begin + 1, end):
            share = (number - begin) / (end - begin)
            mean = (1 - share) * before + share * after
            # Where one key has no value, the other one counts alone.
            mean = np.where(np.isnan(before), after, np.where(np.isnan(after), before, mean))
            faded[number] = np.where(np.isnan(depth[number]), np.nan, mean)
    replace_values(file, DEPTH, faded)
