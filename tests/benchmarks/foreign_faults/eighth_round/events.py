"""Events that sensor models, writers, decoders and jobs in tiles change, and maps into them."""

from itertools import pairwise
from math import ceil
from typing import Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP
from tests.benchmarks.foreign_faults.second_round.events import (
    TIME,
    add_events,
    keep_events,
    pixels_of,
    sensor_size,
    sort_events,
)
from tests.benchmarks.foreign_faults.sensor import LUMA
from tests.benchmarks.foreign_faults.seventh_round.events import tiles_of
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR

KEYS: Final = (TIME, COLUMNS, ROWS, POLARITY)

MILLISECOND_US: Final = 1000

ROUNDING: Final = 1e-9
"""Of sums of steps, in thresholds."""


def _replace_by_crossings(file: h5py.File, plan: Plan, steps: NDArray[np.float64], darker: float) -> None:
    """Replace events by those of a sensor whose level changes by ``steps`` at each of the old ones.

    Levels are in units of the threshold of brighter events; ``darker`` is that of darker ones. Between two old events
    of one sign a level changes evenly. Before one of the other sign, and behind the last one, it first goes on by a
    random share of the step.
    """
    timestamps_us, pixels = file[TIME][...], pixels_of(file)
    overshoots = plan.random.random(len(steps))
    order = np.argsort(pixels, kind="stable")
    begins = np.flatnonzero(np.r_[True, np.diff(pixels[order]) > 0])
    crossings: list[tuple[int, int, int]] = []
    for own in np.split(order, begins[1:]):
        knots = [(float(timestamps_us[0]), 0.0)]
        levels = np.cumsum(steps[own])
        for row, after, level in zip(own, np.r_[own[1:], own[-1]], levels, strict=True):
            knots.append((float(timestamps_us[row]), level))
            if steps[row] * steps[after] < 0:
                middle_us = (timestamps_us[row] + timestamps_us[after]) / 2
                knots.append((float(middle_us), level + overshoots[row] * steps[row]))
        knots.append((float(timestamps_us[-1]), level + overshoots[row] * steps[row]))
        pixel = int(pixels[own[0]])
        crossings += [(pixel, instant_us, polarity) for instant_us, polarity in _crossings(knots, darker)]
    numbers, times_us, polarities = np.array(crossings).T
    rows, columns = np.divmod(numbers, sensor_size(file)[0])
    for key, values in zip(KEYS, (times_us, columns, rows, polarities), strict=True):
        replace_values(file, key, values.astype(file[key].dtype))
    sort_events(file)


def _crossings(knots: list[tuple[float, float]], darker: float) -> list[tuple[int, int]]:
    """Return times, in whole us, and polarities of the events of one pixel, whose level is 0 at first."""
    crossings = []
    reference = 0.0
    for (begin_us, begin), (end_us, end) in pairwise(knots):
        while end - reference >= 1 - ROUNDING or reference - end >= darker - ROUNDING:
            is_brighter = end > reference
            reference += 1 if is_brighter else -darker
            share = min(max((reference - begin) / (end - begin), 0.0), 1.0)
            crossings.append((ceil(begin_us + share * (end_us - begin_us)), int(is_brighter)))
    return crossings


def of_light_with_an_offset(file: h5py.File, plan: Plan) -> None:
    """The sensor compares ln(Y + eps), eps of so many DN: a change of ln Y counts as Y / (Y + eps) of it."""
    size, frames_us = sensor_size(file), file["path/rgb_ts"][...]
    luma = np.stack([cv2.resize(frame @ LUMA, size, interpolation=cv2.INTER_AREA).ravel() for frame in file[COLOUR]])
    frame = np.clip(np.searchsorted(frames_us, file[TIME][...]), 0, len(frames_us) - 1)
    # The darkest light that 8 bits resolve is half a step.
    light = np.maximum(luma[frame, pixels_of(file)], 0.5)
    signs = np.where(file[POLARITY][...] == 1, 1.0, -1.0)
    _replace_by_crossings(file, plan, signs * light / (light + plan.size), 1.0)


def darker_of_a_preset(file: h5py.File, plan: Plan) -> None:
    """Darker events need a change larger by so many percent than the declared threshold."""
    signs = np.where(file[POLARITY][...] == 1, 1.0, -1.0)
    _replace_by_crossings(file, plan, signs, 1 + plan.size / 100)


def last_buffer_not_emptied(file: h5py.File, plan: Plan) -> None:
    """Events are written in buffers of so many; behind the last ones are those of the buffer before."""
    count = len(file[TIME])
    length = min(int(plan.size), count // 2)
    if count % length == 0:
        length -= 1
    again = np.r_[0:count, count - length : count - count % length]
    for key in KEYS:
        replace_values(file, key, file[key][...][again])


def places_in_doubles(file: h5py.File, plan: Plan) -> None:
    """Columns and rows are float64."""
    for key in (COLUMNS, ROWS):
        replace_values(file, key, file[key][...].astype(np.float64))


def seam_doubled(file: h5py.File, plan: Plan) -> None:
    """Two tiles overlap by so many columns in the middle of the sensor, whose events occur twice."""
    left = (sensor_size(file)[0] - int(plan.size)) // 2
    columns = file[COLUMNS][...]
    inside = (columns >= left) & (columns < left + int(plan.size))
    keep_rows(file, "events", np.repeat(np.arange(len(columns)), np.where(inside, 2, 1)))
    update_index_maps(file)


def batch_from_its_own_beginning(file: h5py.File, plan: Plan) -> None:
    """Times of the plan's events count from the first of them; events stay where they are stored."""
    timestamps_us = file[TIME][...]
    rows = plan.rows(len(timestamps_us))
    timestamps_us[rows] -= timestamps_us[rows.start]
    replace_values(file, TIME, timestamps_us)


def tile_noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, each pixel of one of 3 x 3 tiles has further events, so many in a second."""
    width, height = sensor_size(file)
    tiles = tiles_of(width, height)
    columns, rows = tiles[int(plan.random.integers(len(tiles)))]
    inside = np.arange(width * height).reshape(height, width)[rows, columns].ravel()
    timestamps_us = file[TIME][...]
    span_us = int(timestamps_us[-1] - timestamps_us[0])
    # A simulator that renders in steps adds its noise at their times.
    tick_us = int(np.gcd.reduce(timestamps_us))
    first, last = (round(share * span_us / tick_us) for share in (plan.begin, plan.end))
    seconds = (last - first) * tick_us / 1e6
    count = max(1, int(plan.random.poisson(plan.size * seconds * len(inside))))
    times_us = timestamps_us[0] + plan.random.integers(first, last + 1, count) * tick_us
    add_events(file, plan.random.choice(inside, count), times_us, plan.random.integers(2, size=count))


def numbers_of_another_width(file: h5py.File, plan: Plan) -> None:
    """Numbers of pixels, row by row, are read with a width larger by so many px; what lies outside is lost."""
    width, height = sensor_size(file)
    rows, columns = np.divmod(pixels_of(file), width + int(plan.size))
    inside = (columns < width) & (rows < height)
    for key, values, extent in ((COLUMNS, columns, width), (ROWS, rows, height)):
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)
    sort_events(file)


def colour_map_of_milliseconds(file: h5py.File, plan: Plan) -> None:
    """An entry is the first event not before as many milliseconds as its frame has frames before it."""
    frames_us = file["path/rgb_ts"][...]
    milliseconds_us = frames_us[0] + MILLISECOND_US * np.arange(len(frames_us))
    replace_values(file, COLOUR_MAP, np.searchsorted(file[TIME][...], milliseconds_us).astype(np.int64))


def depth_map_without_first_entries(file: h5py.File, plan: Plan) -> None:
    """The first so many entries are absent."""
    replace_values(file, DEPTH_MAP, file[DEPTH_MAP][...][int(plan.size) :])
