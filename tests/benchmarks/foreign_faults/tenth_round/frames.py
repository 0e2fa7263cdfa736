"""Colour and depth frames that readers of mosaics, shutters, films, streams and buffers change."""

from typing import Final

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fifth_round.frames import on_bytes
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sensor import LUMA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR, DEPTH
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME

FLOW: Final = "path/flow/50hz"
EXPOSURES: Final = 9
"""Instants over which the light of an open shutter is averaged."""

GRAIN_PX: Final = 0.8
INCH_MM: Final = 25.4
DEPTH_TIME: Final = "path/depth_ts"


def mosaic_from_the_other_corner(file: h5py.File, plan: Plan) -> None:
    """Pixels have one of R, G and B, from R at the first one on, and are read as if from B on."""
    frames = file[COLOUR][...]
    mosaic = frames[..., 1].copy()
    mosaic[:, ::2, ::2] = frames[:, ::2, ::2, 0]
    mosaic[:, 1::2, 1::2] = frames[:, 1::2, 1::2, 2]
    # OpenCV names a pattern by its second row, from the second pixel on: that of RGGB is BG, that of BGGR is RG.
    read = [cv2.cvtColor(frame, cv2.COLOR_BayerRG2RGB) for frame in mosaic]
    replace_values(file, COLOUR, np.stack(read))


def gammas_of_channels(file: h5py.File, plan: Plan) -> None:
    """Red is raised to a power, blue to its inverse."""
    frames = file[COLOUR][...]
    for channel, power in ((0, plan.size), (2, 1 / plan.size)):
        frames[..., channel] = on_bytes(255 * (np.arange(256) / 255) ** power)[frames[..., channel]]
    replace_values(file, COLOUR, frames)


def saturated(file: h5py.File, plan: Plan) -> None:
    """Differences of channels from their luma grow by so many percent."""
    frames = file[COLOUR][...].astype(np.float64)
    luma = (frames @ LUMA)[..., None]
    replace_values(file, COLOUR, on_bytes(luma + (1 + plan.size / 100) * (frames - luma)))


def exposed_from_its_time_on(file: h5py.File, plan: Plan) -> None:
    """A frame is the mean of the light of so many percent of the period that begins at its time.

    Light moves along the flow from the frame to the next; the last frame moves as the one before it.
    """
    frames, fields = file[COLOUR][...], np.nan_to_num(file[FLOW][...])
    starts_us = file[f"{FLOW}_ts"][...][:, 0]
    columns, rows = np.meshgrid(np.arange(frames.shape[2], dtype=float), np.arange(frames.shape[1], dtype=float))
    for number, time_us in enumerate(file[COLOUR_TIME][...]):
        u, v = np.moveaxis(fields[int(np.argmin(np.abs(starts_us - time_us)))].astype(np.float64), -1, 0)
        frame = frames[number].astype(np.float64)
        shares = plan.size / 100 * (np.arange(EXPOSURES) + 0.5) / EXPOSURES
        frames[number] = on_bytes(np.mean([sampled(frame, columns - s * u, rows - s * v) for s in shares], axis=0))
    replace_values(file, COLOUR, frames)


def with_grain(file: h5py.File, plan: Plan) -> None:
    """Grain of that standard deviation, DN, the same in all channels, and most of it in the middle tones."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames.astype(np.float64)):
        grain = cv2.GaussianBlur(plan.random.normal(size=frame.shape[:2]), (0, 0), GRAIN_PX)
        tone = frame @ LUMA / 255
        frames[number] = on_bytes(frame + (plan.size * grain / grain.std() * 4 * tone * (1 - tone))[..., None])
    replace_values(file, COLOUR, frames)


def in_fewer_pixels_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows a frame was resized by one in so many, and back."""
    frames = file[COLOUR][...]
    height, width = frames.shape[1:3]
    rows = plan.rows(len(frames))
    for number in range(rows.start, rows.stop):
        smaller = (round(width / plan.size), round(height / plan.size))
        reduced = cv2.resize(frames[number], smaller, interpolation=cv2.INTER_AREA)
        frames[number] = cv2.resize(reduced, (width, height), interpolation=cv2.INTER_NEAREST)
    replace_values(file, COLOUR, frames)


def squeezed_beside_a_border(file: h5py.File, plan: Plan) -> None:
    """Columns of depth are squeezed to the left by so many percent; what remains at the right has no value."""
    depth = file[DEPTH][...]
    width = depth.shape[2]
    columns = np.rint(np.arange(width) / (1 - plan.size / 100)).astype(int)
    squeezed = np.full_like(depth, np.nan)
    squeezed[..., columns < width] = depth[..., columns[columns < width]]
    replace_values(file, DEPTH, squeezed)


def ring_read_from_its_middle(file: h5py.File, plan: Plan) -> None:
    """The plan's frames lay in a ring, and were written from another one than the oldest on."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    count = rows.stop - rows.start
    depth[rows] = np.roll(depth[rows], plan.random.integers(1, max(2, count)), axis=0)
    replace_values(file, DEPTH, depth)


def in_inches(file: h5py.File, plan: Plan) -> None:
    """Depth is in inches."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, (depth / INCH_MM).astype(depth.dtype))


def lost_and_renumbered(file: h5py.File, plan: Plan) -> None:
    """So many depth frames in sequence are lost, and those that follow take their times."""
    timestamps_us = file[DEPTH_TIME][...]
    total, lost = len(timestamps_us), int(plan.size)
    first = max(1, round(plan.begin * (total - lost - 1)))
    keep_rows(file, "depth", np.r_[0:first, first + lost : total])
    replace_values(file, DEPTH_TIME, timestamps_us[: total - lost])
    update_index_maps(file)
