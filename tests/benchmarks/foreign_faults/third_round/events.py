"""Events that simulators, decoders, masks and mountings add, remove, move or turn."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import (
    TIME,
    add_events,
    keep_events,
    pixels_of,
    sensor_size,
    sort_events,
)

COLUMNS, ROWS, POLARITY = (f"path/events/{name}" for name in "xyp")

GAMMA = 2.2
"""Of encoded frames: the logarithm of their values is that of light over this number."""

VECTOR_COLUMNS = 32
"""Columns that the words after a base of EVT 3.0 cover."""

PACKET_US = 1_000


def pixel_by_pixel(file: h5py.File, plan: Plan) -> None:
    """Rows are sorted by pixel, and by time within a pixel."""
    keep_rows(file, "events", np.lexsort([file[TIME][...], pixels_of(file)]))


def inverted_in_a_part(file: h5py.File, plan: Plan) -> None:
    """In so many percent of the columns, at one side, 1 stands for darker."""
    width = sensor_size(file)[0]
    edge = round(width * plan.size / 100)
    columns, polarity = file[COLUMNS][...], file[POLARITY][...]
    inside = columns < edge if plan.random.random() < 0.5 else columns >= width - edge
    replace_values(file, POLARITY, np.where(inside, 1 - polarity, polarity).astype(polarity.dtype))


def mirrored_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time columns count from the right."""
    columns = file[COLUMNS][...]
    within = plan.times_us(file[TIME][...])
    replace_values(file, COLUMNS, np.where(within, sensor_size(file)[0] - 1 - columns, columns).astype(columns.dtype))


def of_encoded_frames(file: h5py.File, plan: Plan) -> None:
    """Frames were not decoded before the sensor model, so that an event needs so many times the change of light.

    A pixel's level is known at each of its events, in thresholds; between two of them it follows a straight line.
    """
    timestamps_us, signs = file[TIME][...], np.where(file[POLARITY][...] == 1, 1, -1)
    count = int(np.prod(sensor_size(file)))
    level, latest_us, reference = np.zeros(count), np.zeros(count), np.zeros(count)
    kept = np.zeros(len(signs), dtype=bool)
    crossed_us = timestamps_us.copy()
    for row, pixel in enumerate(pixels_of(file).tolist()):
        wanted = reference[pixel] + signs[row] * GAMMA
        before, level[pixel] = level[pixel], level[pixel] + signs[row]
        if (level[pixel] - wanted) * signs[row] >= 0:
            kept[row] = True
            share = (wanted - before) * signs[row]
            crossed_us[row] = np.ceil(latest_us[pixel] + share * (timestamps_us[row] - latest_us[pixel]))
            reference[pixel] = wanted
        latest_us[pixel] = timestamps_us[row]
    replace_values(file, TIME, crossed_us)
    keep_events(file, kept)
    sort_events(file)


def columns_fire(file: h5py.File, plan: Plan) -> None:
    """All pixels of one to three columns fire by themselves, so many times a second, with one polarity a column."""
    width, height = sensor_size(file)
    first_us, last_us = (int(timestamp_us) for timestamp_us in file[TIME][[0, -1]])
    columns = plan.random.choice(width, int(plan.random.integers(1, 4)), replace=False)
    counts = plan.random.poisson(plan.size * height * (last_us - first_us) / 1e6, len(columns))
    total = int(counts.sum())
    pixels = np.repeat(columns, counts) + width * plan.random.integers(height, size=total)
    signs = np.repeat(plan.random.integers(2, size=len(columns)), counts)
    add_events(file, pixels, plan.random.integers(first_us + 1, last_us, total), signs)


def mask_moves(file: h5py.File, plan: Plan) -> None:
    """A square, with a side of so many percent of the width, gives no events, and moves from one side to the other."""
    width, height = sensor_size(file)
    side = plan.size / 100 * width
    timestamps_us = file[TIME][...]
    share = (timestamps_us - timestamps_us[0]) / float(timestamps_us[-1] - timestamps_us[0])
    left = (width - side) * (share if plan.random.random() < 0.5 else 1 - share)
    top = max(0.0, height - side) * plan.random.uniform(0.2, 0.8)
    dx, dy = file[COLUMNS][...] - left, file[ROWS][...] - top
    keep_events(file, (dx < 0) | (dx >= side) | (dy < 0) | (dy >= side))


def quiet_packets_lost(file: h5py.File, plan: Plan) -> None:
    """Of the packets with events, so many percent, those with the fewest, are not sent."""
    packets = (file[TIME][...] - file[TIME][0]) // PACKET_US
    counts = np.bincount(packets)
    keep_events(file, counts[packets] > np.quantile(counts[counts > 0], plan.size / 100))


def turned(file: h5py.File, plan: Plan) -> None:
    """The image is turned about its middle by so many degrees; what leaves the sensor is lost."""
    width, height = sensor_size(file)
    dx, dy = file[COLUMNS][...] - (width - 1) / 2, file[ROWS][...] - (height - 1) / 2
    cos, sin = np.cos(np.deg2rad(plan.size)), np.sin(np.deg2rad(plan.size))
    columns = np.rint((width - 1) / 2 + cos * dx - sin * dy)
    rows = np.rint((height - 1) / 2 + sin * dx + cos * dy)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    for key, values, extent in ((COLUMNS, columns, width), (ROWS, rows, height)):
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)


def darker_moved(file: h5py.File, plan: Plan) -> None:
    """Columns of darker events are too large by so many pixels; what leaves the sensor is lost."""
    width = sensor_size(file)[0]
    columns = file[COLUMNS][...]
    moved = columns.astype(np.int64) + np.where(file[POLARITY][...] == 0, int(plan.size), 0)
    replace_values(file, COLUMNS, np.clip(moved, 0, width - 1).astype(columns.dtype))
    keep_events(file, (moved >= 0) & (moved < width))


def halves_exchanged(file: h5py.File, plan: Plan) -> None:
    """Columns of the left half are stored as those of the right one, and the reverse."""
    columns = file[COLUMNS][...]
    width = sensor_size(file)[0]
    replace_values(file, COLUMNS, ((columns.astype(np.int64) + width // 2) % width).astype(columns.dtype))


def bases_of_vectors_lost(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time columns lie in the vector of the first of these events; what leaves the sensor is lost."""
    columns = file[COLUMNS][...].astype(np.int64)
    within = plan.times_us(file[TIME][...])
    base = columns[np.argmax(within)] // VECTOR_COLUMNS * VECTOR_COLUMNS
    columns = np.where(within, base + columns % VECTOR_COLUMNS, columns)
    width = sensor_size(file)[0]
    replace_values(file, COLUMNS, np.minimum(columns, width - 1).astype(file[COLUMNS].dtype))
    keep_events(file, columns < width)


def minus_one_as_byte(file: h5py.File, plan: Plan) -> None:
    """Polarities -1 and 1 became bytes: -1 is 255."""
    polarity = file[POLARITY][...]
    replace_values(file, POLARITY, np.where(polarity == 1, 1, -1).astype(np.int8).view(polarity.dtype))
