"""Colour and depth frames that engines, loaders, converters and screens change."""

from typing import Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fifth_round.frames import on_bytes
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR, DEPTH
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME

DEFAULT_RATES_HZ: Final = (24, 25, 30, 60)
"""Rates of frames that video writers and animations take by default."""

BAR_DN: Final = 214
"""Grey of the bar above a window."""

GUARD_DN: Final = 23
"""Of what is fixed to the vehicle."""

METRE_MM: Final = 1000


def with_a_filmic_curve(file: h5py.File, plan: Plan) -> None:
    """Narkowicz's fit of the ACES curve is applied to light that is so many times as bright."""
    x = plan.size * np.arange(256) / 255
    curve = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    replace_values(file, COLOUR, on_bytes(255 * curve)[file[COLOUR][...]])


def at_a_default_rate(file: h5py.File, plan: Plan) -> None:
    """A time is the number of its frame over 24, 25, 30 or 60 Hz."""
    timestamps_us = file[COLOUR_TIME][...]
    period_us = 1e6 / plan.random.choice(DEFAULT_RATES_HZ)
    numbered_us = timestamps_us[0] + np.rint(np.arange(len(timestamps_us)) * period_us).astype(np.int64)
    replace_values(file, COLOUR_TIME, numbered_us)
    update_index_maps(file)


def behind_warm_up(file: h5py.File, plan: Plan) -> None:
    """The first frame occurs so many times more, and all others are as many frames late."""
    frames = file[COLOUR][...]
    replace_values(file, COLOUR, frames[np.maximum(np.arange(len(frames)) - int(plan.size), 0)])


def derangement(random: np.random.Generator, count: int) -> NDArray[np.int64]:
    """Return a random order in which the first of at least two is not first."""
    order = random.permutation(count)
    if order[0] == 0:
        order[[0, -1]] = order[[-1, 0]]
    return order


def batch_shuffled(file: h5py.File, plan: Plan) -> None:
    """The plan's frames, at least two, are in a random order."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    begin, stop = min(rows.start, len(frames) - 2), max(rows.stop, rows.start + 2)
    batch = frames[begin:stop]
    frames[begin:stop] = batch[derangement(plan.random, len(batch))]
    replace_values(file, COLOUR, frames)


def channels_first(file: h5py.File, plan: Plan) -> None:
    """Frames have the shape (3, H, W)."""
    replace_values(file, COLOUR, np.ascontiguousarray(np.moveaxis(file[COLOUR][...], -1, 1)))


def below_a_title_bar(file: h5py.File, plan: Plan) -> None:
    """Frames lie so many px lower, below an even bar."""
    frames = file[COLOUR][...]
    height = int(plan.size)
    frames[:, height:] = frames[:, :-height].copy()
    frames[:, :height] = BAR_DN
    replace_values(file, COLOUR, frames)


def corners_darker_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's frames light falls with the square of the distance from the middle, at corners by so many %."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    height, width = frames.shape[1:3]
    y, x = np.mgrid[:height, :width] - np.array([(height - 1) / 2, (width - 1) / 2])[:, None, None]
    squared = (x**2 + y**2) / (x**2 + y**2).max()
    frames[rows] = on_bytes(frames[rows] * (1 - plan.size / 100 * squared)[None, ..., None])
    replace_values(file, COLOUR, frames)


def both_eyes_side_by_side(file: h5py.File, plan: Plan) -> None:
    """A frame holds two views of half the width, which are the same, as of eyes at one place."""
    frames = file[COLOUR][...]
    height, width = frames.shape[1:3]
    for number, frame in enumerate(frames.copy()):
        views = [cv2.resize(frame, (extent, height), interpolation=cv2.INTER_AREA)
                 for extent in (width // 2, width - width // 2)]  # fmt: skip
        frames[number] = np.concatenate(views, axis=1)
    replace_values(file, COLOUR, frames)


def guards_in_view(file: h5py.File, plan: Plan) -> None:
    """Discs around the lower corners, with a radius of so many percent of the width, hide what is behind them."""
    frames = file[COLOUR][...]
    height, width = frames.shape[1:3]
    rows, columns = np.mgrid[:height, :width]
    radius = plan.size / 100 * width
    hidden = np.hypot(np.minimum(columns, width - 1 - columns), height - 1 - rows) <= radius
    frames[:, hidden] = GUARD_DN
    replace_values(file, COLOUR, frames)


def in_whole_metres(file: h5py.File, plan: Plan) -> None:
    """Depth lost what is behind the point of its metres."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, np.floor(depth / METRE_MM) * np.float32(METRE_MM))


def of_the_next_tick(file: h5py.File, plan: Plan) -> None:
    """Depth of each frame is that of so many frames later; the last one repeats."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, depth[np.minimum(np.arange(len(depth)) + int(plan.size), len(depth) - 1)])


def border_of_zeros(file: h5py.File, plan: Plan) -> None:
    """So many px at each side have the depth 0."""
    depth = file[DEPTH][...]
    edge = int(plan.size)
    inner = depth[:, edge:-edge, edge:-edge].copy()
    depth[...] = 0
    depth[:, edge:-edge, edge:-edge] = inner
    replace_values(file, DEPTH, depth)


def invalid_as_infinite_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's frames, what has no depth is infinite."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    depth[rows] = np.where(np.isnan(depth[rows]), np.inf, depth[rows])
    replace_values(file, DEPTH, depth)


def first_frames_of_the_run_before(file: h5py.File, plan: Plan) -> None:
    """The first so many frames are the last ones of another sequence."""
    depth = file[DEPTH][...]
    with h5py.File(plan.donor) as donor:
        depth[: int(plan.size)] = donor[DEPTH][-int(plan.size) :]
    replace_values(file, DEPTH, depth)


def times_left_out(file: h5py.File, plan: Plan) -> None:
    """Depth has no times."""
    del file["path/depth_ts"]


def rays_of_default_angle(file: h5py.File, plan: Plan) -> None:
    """Lengths of rays became z by the rays of a camera with a horizontal angle of view of 90 degrees."""
    K = np.asarray(file[CAMERA + "depth"].attrs["K"])
    depth = file[DEPTH][...]
    rows, columns = np.indices(depth.shape[1:])
    squared = (columns - K[0, 2]) ** 2 + (rows - K[1, 2]) ** 2
    default = depth.shape[2] / 2
    factor = np.sqrt((1 + squared / K[0, 0] ** 2) / (1 + squared / default**2))
    replace_values(file, DEPTH, (depth * factor).astype(depth.dtype))
