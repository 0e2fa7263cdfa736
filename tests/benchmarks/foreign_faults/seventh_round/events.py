"""Events that simulators, writers and converters move, add, lose or store in another type."""

from typing import Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults import sensor
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP
from tests.benchmarks.foreign_faults.second_round.events import (
    TIME,
    add_events,
    keep_events,
    sensor_size,
    sort_events,
)
from tests.benchmarks.foreign_faults.sensor import LUMA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR, DEPTH

TILES: Final = 3
"""Of an image in each direction."""

CHOICE: Final = 4
"""Of the tiles, those among which a fault is placed, so that it shows."""

DARK_SHARE: Final = 0.25
"""Of the pixels, those that are dark."""


def tiles_of(width: int, height: int) -> list[tuple[slice, slice]]:
    """Return the columns and rows of 3 x 3 tiles of an image."""
    columns, rows = (
        [slice(extent * number // TILES, extent * (number + 1) // TILES) for number in range(TILES)]
        for extent in (width, height)
    )
    return [(inside_columns, inside_rows) for inside_rows in rows for inside_columns in columns]


def _inside_busy_tile(file: h5py.File, plan: Plan) -> NDArray[np.bool_]:
    """Return which events lie in one of the four tiles of the sensor that have most of them."""
    columns, rows = file[COLUMNS][...], file[ROWS][...]
    inside = [
        (columns >= tile_columns.start)
        & (columns < tile_columns.stop)
        & (rows >= tile_rows.start)
        & (rows < tile_rows.stop)
        for tile_columns, tile_rows in tiles_of(*sensor_size(file))
    ]
    inside.sort(key=np.count_nonzero)
    chosen: NDArray[np.bool_] = inside[-1 - int(plan.random.integers(CHOICE))]
    return chosen


def of_the_right_eye(file: h5py.File, plan: Plan) -> None:
    """Events are those of a camera so many metres to the right: a point moves to the left by f b / z."""
    camera, depth_camera = (file[CAMERA + name].attrs for name in ("events", "depth"))
    columns, rows = (file[key][...].astype(np.float64) for key in (COLUMNS, ROWS))
    scale = np.asarray(depth_camera["K"]) @ np.linalg.inv(np.asarray(camera["K"]))
    depth = file[DEPTH][...]
    frames_us = file["path/depth_ts"][...]
    number = np.abs(frames_us[None, :] - file[TIME][...][:, None]).argmin(axis=1)
    at_column = np.rint(scale[0, 0] * columns + scale[0, 2]).astype(int)
    at_row = np.rint(scale[1, 1] * rows + scale[1, 2]).astype(int)
    depth_m = depth[number, np.clip(at_row, 0, depth.shape[1] - 1), np.clip(at_column, 0, depth.shape[2] - 1)] / 1000
    # What has no depth is far away, and does not move.
    disparity = np.nan_to_num(float(camera["K"][0, 0]) * plan.size / depth_m.astype(np.float64), nan=0.0)
    moved = np.rint(columns - disparity)
    inside = moved >= 0
    replace_values(file, COLUMNS, np.maximum(moved, 0).astype(file[COLUMNS].dtype))
    keep_events(file, inside)
    sort_events(file)


def clamped_at_the_border(file: h5py.File, plan: Plan) -> None:
    """Events lie so many pixels to the right, or down; those that leave the sensor lie at its border."""
    axis = int(plan.random.integers(2))
    key, limit = (COLUMNS, ROWS)[axis], sensor_size(file)[axis] - 1
    moved = np.clip(file[key][...].astype(np.int64) + int(plan.size), 0, limit)
    replace_values(file, key, moved.astype(file[key].dtype))
    sort_events(file)


def polarity_of_minus_1(file: h5py.File, plan: Plan) -> None:
    """Polarities are -1 and 1, in 8 bits with a sign."""
    replace_values(file, POLARITY, np.where(file[POLARITY][...] == 1, 1, -1).astype(np.int8))


def pixels_behind_their_times(file: h5py.File, plan: Plan) -> None:
    """The pixel and polarity of an event are stored with the time of the event so many later; the last are lost."""
    count = len(file[TIME])
    behind = min(int(plan.size), count // 3)
    for key in (COLUMNS, ROWS, POLARITY):
        replace_values(file, key, file[key][...][: count - behind])
    replace_values(file, TIME, file[TIME][...][behind:])
    sort_events(file)


def dark_pixels_noisy(file: h5py.File, plan: Plan) -> None:
    """The darkest quarter of the pixels have further events of either polarity, so many in a second each."""
    timestamps_us = file[TIME][...]
    luma = cv2.resize(file[COLOUR][0] @ LUMA, sensor_size(file), interpolation=cv2.INTER_AREA).ravel()
    dark = np.argsort(luma, kind="stable")[: round(DARK_SHARE * luma.size)]
    span_us = int(timestamps_us[-1] - timestamps_us[0])
    count = max(1, int(plan.random.poisson(plan.size * span_us / 1e6 * len(dark))))
    # A simulator that renders in steps adds its noise at their times.
    tick_us = int(np.gcd.reduce(timestamps_us))
    times_us = timestamps_us[0] + plan.random.integers(1, span_us // tick_us + 1, count) * tick_us
    add_events(file, plan.random.choice(dark, count), times_us, plan.random.integers(2, size=count))


def tile_late(file: h5py.File, plan: Plan) -> None:
    """Events of one busy tile of the sensor are late by so many ms; those behind the end are lost."""
    timestamps_us = file[TIME][...]
    last_us = timestamps_us[-1]
    late_us = timestamps_us + np.where(_inside_busy_tile(file, plan), round(1000 * plan.size), 0)
    replace_values(file, TIME, late_us)
    keep_events(file, late_us <= last_us)
    sort_events(file)


def tile_thinned(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, so many percent of the events of one busy tile are lost."""
    timestamps_us = file[TIME][...]
    lost = _inside_busy_tile(file, plan) & plan.times_us(timestamps_us)
    keep_events(file, ~(lost & (plan.random.random(len(timestamps_us)) < plan.size / 100)))


def axes_exchanged_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, column and row are exchanged; what then lies outside is lost."""
    width, height = sensor_size(file)
    within = plan.times_us(file[TIME][...])
    columns, rows = file[COLUMNS][...], file[ROWS][...]
    replace_values(file, COLUMNS, np.where(within, rows, columns))
    replace_values(file, ROWS, np.where(within, columns, rows))
    keep_events(file, (file[COLUMNS][...] < width) & (file[ROWS][...] < height))
    sort_events(file)


def between_frames_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, events are those of straight lines between the file's own frames."""
    keys = (TIME, COLUMNS, ROWS, POLARITY)
    own = {key: file[key][...] for key in keys}
    within = plan.times_us(own[TIME])
    begin_us, end_us = own[TIME][within][[0, -1]]
    sensor.from_frames(file, plan)
    made = file[TIME][...]
    chosen = (made >= begin_us) & (made <= end_us)
    for key in keys:
        replace_values(file, key, np.concatenate([own[key][~within], file[key][...][chosen]]))
    sort_events(file)


def colour_map_to_the_event_before(file: h5py.File, plan: Plan) -> None:
    """An entry is the last event before its frame, and 0 where there is none."""
    replace_values(file, COLOUR_MAP, np.maximum(file[COLOUR_MAP][...] - 1, 0))


def depth_map_off_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Entries of the plan's rows are too large by so many events, but not beyond the ends."""
    entries = file[DEPTH_MAP][...]
    rows = plan.rows(len(entries))
    entries[rows] = np.clip(entries[rows] + int(plan.size), 0, len(file[TIME]))
    replace_values(file, DEPTH_MAP, entries)
