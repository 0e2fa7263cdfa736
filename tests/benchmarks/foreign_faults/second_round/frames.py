"""Colour frames that cameras, encoders, renderers and players change."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan

COLOUR = "path/rgb"
STAMPS = "path/rgb_ts"


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _from_middle(file: h5py.File) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return columns and rows of all pixels, px, counted from the middle of the image."""
    height, width = file[COLOUR].shape[1:3]
    columns, rows = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
    return columns, rows


def _squared_radius(file: h5py.File) -> NDArray[np.float64]:
    """Return the square of the distance from the middle, 1 at a corner."""
    columns, rows = _from_middle(file)
    squared: NDArray[np.float64] = (columns**2 + rows**2) / (columns**2 + rows**2).max()
    return squared


def on_ticks_of_display(file: h5py.File, plan: Plan) -> None:
    """A frame carries the time of the display's refresh, 60 a second, that follows it."""
    ticks = np.ceil(file[STAMPS][...] * 60 / 1e6)
    replace_values(file, STAMPS, np.rint(ticks * 1e6 / 60).astype(np.int64))
    update_index_maps(file)


def repeated_here_and_there(file: h5py.File, plan: Plan) -> None:
    """So many percent of the frames, at least one, anywhere, repeat the frame before."""
    frames = file[COLOUR][...]
    count = max(1, round(plan.size / 100 * len(frames)))
    for row in np.sort(plan.random.choice(np.arange(1, len(frames)), count, replace=False)):
        frames[row] = frames[row - 1]
    replace_values(file, COLOUR, frames)


def in_order_of_decoding(file: h5py.File, plan: Plan) -> None:
    """Of every three frames after the first, the third comes before the other two, which are predicted from it."""
    frames = file[COLOUR][...]
    order = np.arange(len(frames))
    for first in range(1, len(frames) - 2, 3):
        order[first : first + 3] = [first + 2, first, first + 1]
    replace_values(file, COLOUR, frames[order])


def backwards_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows stand from the last to the first, under stamps in order."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    rows = slice(min(rows.start, len(frames) - 2), max(rows.stop, rows.start + 2))
    frames[rows] = frames[rows][::-1].copy()
    replace_values(file, COLOUR, frames)


def lost_here_and_there(file: h5py.File, plan: Plan) -> None:
    """So many percent of the frames, at least one, anywhere but at both ends, are absent with their stamps."""
    total = len(file[STAMPS])
    lost = plan.random.choice(np.arange(1, total - 1), max(1, round(plan.size / 100 * total)), replace=False)
    keep_rows(file, "rgb", np.setdiff1d(np.arange(total), lost))
    update_index_maps(file)


def chroma_exchanged(file: h5py.File, plan: Plan) -> None:
    """The two planes of chroma (ITU-R BT.601, full range) are taken for each other."""
    frames = file[COLOUR][...].astype(np.float64)
    luma = frames @ np.array([0.299, 0.587, 0.114])
    blue, red = (frames[..., 2] - luma) / 1.772, (frames[..., 0] - luma) / 1.402
    blue, red = red, blue
    replace_values(
        file,
        COLOUR,
        _on_bytes(np.stack([luma + 1.402 * red, luma - 0.344136 * blue - 0.714136 * red, luma + 1.772 * blue], -1)),
    )


def exposure_controlled(file: h5py.File, plan: Plan) -> None:
    """The gain follows the content so that a frame's mean comes to so many DN: a third of the way with each frame."""
    frames = file[COLOUR][...]
    wanted = np.log(plan.size / np.maximum(frames.mean(axis=(1, 2, 3)), 1.0))
    gain = wanted[0]
    for number, frame in enumerate(frames):
        gain += (wanted[number] - gain) / 3
        frames[number] = _on_bytes(frame * np.exp(gain))
    replace_values(file, COLOUR, frames)


def logarithmic(file: h5py.File, plan: Plan) -> None:
    """Values are ln(1 + a L) / ln(1 + a), L from 0 to 1, with the plan's a."""
    light = np.arange(256) / 255
    replace_values(file, COLOUR, _on_bytes(255 * np.log1p(plan.size * light) / np.log1p(plan.size))[file[COLOUR][...]])


def shaded_by_channel(file: h5py.File, plan: Plan) -> None:
    """A filter in front of the sensor darkens corners: red by so many percent, green and blue by less."""
    fall = 1 - plan.size / 100 * _squared_radius(file)[..., None] * np.array([1.0, 0.64, 0.47])
    replace_values(file, COLOUR, _on_bytes(file[COLOUR][...] * fall))


def shading_corrected_twice(file: h5py.File, plan: Plan) -> None:
    """Corners are brighter by so many percent."""
    replace_values(
        file, COLOUR, _on_bytes(file[COLOUR][...] * (1 + plan.size / 100 * _squared_radius(file))[..., None])
    )


def stabilised(file: h5py.File, plan: Plan) -> None:
    """Each frame is moved against a shake of so many px, whose rate of its own in each axis is 2 to 7 Hz."""
    frames = file[COLOUR][...]
    seconds = file[STAMPS][...] / 1e6
    phases, rates_hz = plan.random.uniform(0, 2 * np.pi, 2), plan.random.uniform(2, 7, 2)
    move = plan.size * np.sin(2 * np.pi * rates_hz * seconds[:, None] + phases)
    columns, rows = np.meshgrid(*(np.arange(extent, dtype=float) for extent in frames.shape[2:0:-1]))
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(frame.astype(float), columns - move[number, 0], rows - move[number, 1]))
    replace_values(file, COLOUR, frames)


def read_ahead(file: h5py.File, plan: Plan) -> None:
    """Each row holds the frame that is so many rows later; the last is repeated."""
    frames = file[COLOUR][...]
    replace_values(file, COLOUR, frames[np.minimum(np.arange(len(frames)) + int(plan.size), len(frames) - 1)])


def rolling_shutter(file: h5py.File, plan: Plan) -> None:
    """Rows are exposed one after the other, the last so many ms after the first: each shows what has moved since."""
    frames = file[COLOUR][...]
    flow, intervals_us = file["path/flow/50hz"][...], file["path/flow/50hz_ts"][...]
    columns, rows = np.meshgrid(*(np.arange(extent, dtype=float) for extent in frames.shape[2:0:-1]))
    for number, frame in enumerate(frames):
        field = min(number, len(flow) - 1)
        duration_us = float(intervals_us[field, 1] - intervals_us[field, 0])
        share = 1000 * plan.size / duration_us * rows / (frames.shape[1] - 1)
        u, v = np.moveaxis(np.nan_to_num(flow[field].astype(float)), -1, 0)
        frames[number] = _on_bytes(sampled(frame.astype(float), columns - share * u, rows - share * v))
    replace_values(file, COLOUR, frames)


def interlaced(file: h5py.File, plan: Plan) -> None:
    """Every other line is of the frame before."""
    frames = file[COLOUR][...]
    frames[1:, 1::2] = frames[:-1, 1::2].copy()
    replace_values(file, COLOUR, frames)


def torn_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, what lies below a line, another one in each frame, is of the frame before."""
    frames = file[COLOUR][...]
    old = frames.copy()
    rows, height = plan.rows(len(frames)), frames.shape[1]
    for row in range(max(1, rows.start), rows.stop):
        line = int(plan.random.integers(height // 5, 4 * height // 5))
        frames[row, line:] = old[row - 1, line:]
    replace_values(file, COLOUR, frames)


def channels_of_other_sizes(file: h5py.File, plan: Plan) -> None:
    """Red is enlarged by so many percent about the middle, and blue is made smaller by as many."""
    frames = file[COLOUR][...]
    dx, dy = _from_middle(file)
    height, width = frames.shape[1:3]
    for channel, factor in ((0, 1 + plan.size / 100), (2, 1 - plan.size / 100)):
        at = (width - 1) / 2 + dx / factor, (height - 1) / 2 + dy / factor
        for frame in frames:
            frame[..., channel] = _on_bytes(sampled(frame[..., channel].astype(float), *at))
    replace_values(file, COLOUR, frames)


def in_fog(file: h5py.File, plan: Plan) -> None:
    """Light of a point falls by e in so many metres, and bright grey of 190 DN takes its place."""
    frames = file[COLOUR][...]
    depth, depth_us = file["path/depth"], file["path/depth_ts"][...]
    for number, instant_us in enumerate(file[STAMPS][...]):
        nearest = int(np.argmin(np.abs(depth_us - instant_us)))
        clear = np.exp(-np.nan_to_num(depth[nearest] / 1000, nan=float(file["metadata/depth_range"][1])) / plan.size)
        frames[number] = _on_bytes(frames[number] * clear[..., None] + 190 * (1 - clear[..., None]))
    replace_values(file, COLOUR, frames)
