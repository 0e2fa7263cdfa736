"""Events that filters, tables, clocks, lenses and simulators change, and maps into them."""

from typing import Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.eighth_round.events import darker_of_a_preset
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP
from tests.benchmarks.foreign_faults.second_round.events import (
    TIME,
    add_events,
    keep_events,
    pixels_of,
    sensor_size,
)
from tests.benchmarks.foreign_faults.sensor import LUMA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR

LIGHTEST_LEAK: Final = 0.5
"""Of the mean rate of leaks, the least and, inverted, the greatest factor of a pixel."""


def thresholds_exchanged(file: h5py.File, plan: Plan) -> None:
    """Darker events need so many percent more than brighter ones, and each declaration is that of the other."""
    darker_of_a_preset(file, plan)
    attributes = file["metadata/events"].attrs
    attributes["threshold_on"] = np.float64(attributes["threshold_on"] * (1 + plan.size / 100))


def steps_of_time_floored(file: h5py.File, plan: Plan) -> None:
    """Times are sums of steps from event to event, each of which loses what lies below so many us."""
    timestamps_us = file[TIME][...]
    steps_us = np.diff(timestamps_us)
    steps_us -= steps_us % int(plan.size)
    replace_values(file, TIME, timestamps_us[0] + np.r_[0, np.cumsum(steps_us)])
    update_index_maps(file)


def in_slow_motion(file: h5py.File, plan: Plan) -> None:
    """Times since the first event are so many times too long."""
    timestamps_us = file[TIME][...]
    elapsed_us = np.rint((timestamps_us - timestamps_us[0]) * plan.size).astype(np.int64)
    replace_values(file, TIME, timestamps_us[0] + elapsed_us)
    update_index_maps(file)


def of_a_clock_that_loses_ticks(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time the clock is slow by so many ppm; it stays behind."""
    timestamps_us = file[TIME][...]
    first_us, span_us = timestamps_us[0], timestamps_us[-1] - timestamps_us[0]
    elapsed_us = np.clip(timestamps_us - first_us - plan.begin * span_us, 0, (plan.end - plan.begin) * span_us)
    replace_values(file, TIME, timestamps_us - np.rint(plan.size / 1e6 * elapsed_us).astype(np.int64))
    update_index_maps(file)


def second_of_each_burst_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's time an event is kept if its pixel had one of the same polarity just before.

    "Just before" is at most so many ms.
    """
    timestamps_us, pixels, polarities = file[TIME][...], pixels_of(file), file[POLARITY][...]
    order = np.lexsort([timestamps_us, pixels])
    follows = (
        (np.diff(pixels[order]) == 0)
        & (np.diff(polarities[order].astype(np.int64)) == 0)
        & (np.diff(timestamps_us[order]) <= 1000 * plan.size)
    )
    kept = ~plan.times_us(timestamps_us)
    kept[order[1:][follows]] = True
    keep_events(file, kept)


def first_of_each_tick(file: h5py.File, plan: Plan) -> None:
    """Of all events within a tick of so many us, the first alone is kept, with its own time."""
    ticks = file[TIME][...] // int(plan.size)
    keep_events(file, np.r_[True, np.diff(ticks) > 0])


def begin_late(file: h5py.File, plan: Plan) -> None:
    """The first so many percent of the time have no events."""
    timestamps_us = file[TIME][...]
    keep_events(file, timestamps_us - timestamps_us[0] >= plan.size / 100 * (timestamps_us[-1] - timestamps_us[0]))


def enlarged_to_whole_pixels(file: h5py.File, plan: Plan) -> None:
    """Coordinates are enlarged from the centre by so many percent, and rounded; K follows.

    Where two neighbouring pixels lead two pixels apart, the one between has no events.
    """
    width, height = sensor_size(file)
    attributes = file[CAMERA + "events"].attrs
    K = np.array(attributes["K"])
    factor = 1 + plan.size / 100
    columns = np.rint(K[0, 2] + factor * (file[COLUMNS][...] - K[0, 2])).astype(np.int64)
    rows = np.rint(K[1, 2] + factor * (file[ROWS][...] - K[1, 2])).astype(np.int64)
    K[[0, 1], [0, 1]] *= factor
    attributes["K"] = K
    _move(file, columns, rows, width, height)


def _move(file: h5py.File, columns: NDArray[np.int64], rows: NDArray[np.int64], width: int, height: int) -> None:
    """Give events other coordinates; what leaves the sensor is lost."""
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    for key, values, extent in ((COLUMNS, columns, width), (ROWS, rows, height)):
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)


def pixels_of_random_telegraph(file: h5py.File, plan: Plan) -> None:
    """So many pixels step up and down between two levels, after random times; each has a rate of its own."""
    timestamps_us = file[TIME][...]
    pixels, times, polarities = [], [], []
    for pixel in plan.random.choice(int(np.prod(sensor_size(file))), int(plan.size), replace=False):
        rate_hz = np.exp(plan.random.uniform(np.log(90), np.log(700)))
        count = 2 + int(2 * rate_hz * (timestamps_us[-1] - timestamps_us[0]) / 1e6)
        instants_us = timestamps_us[0] + np.ceil(np.cumsum(plan.random.exponential(1e6 / rate_hz, count)))
        instants_us = instants_us[instants_us < timestamps_us[-1]].astype(np.int64)
        pixels.append(np.full(len(instants_us), pixel))
        times.append(instants_us)
        polarities.append((np.arange(len(instants_us)) + plan.random.integers(2)) % 2)
    add_events(file, np.concatenate(pixels), np.concatenate(times), np.concatenate(polarities))


def sun_on_the_junctions(file: h5py.File, plan: Plan) -> None:
    """In the plan's time each pixel leaks brighter events in even intervals, so many a second in the mean."""
    timestamps_us = file[TIME][...]
    first_us, span_us = timestamps_us[0], timestamps_us[-1] - timestamps_us[0]
    begin_us, end_us = (first_us + share * span_us for share in (plan.begin, plan.end))
    count = int(np.prod(sensor_size(file)))
    factors = np.exp(plan.random.uniform(np.log(LIGHTEST_LEAK), -np.log(LIGHTEST_LEAK), count))
    periods_us = 1e6 / (plan.size * factors)
    numbers = np.arange(1 + int((end_us - begin_us) / periods_us.min()))
    instants_us = begin_us + (plan.random.random(count)[:, None] + numbers) * periods_us[:, None]
    inside = instants_us < end_us
    pixels = np.broadcast_to(np.arange(count)[:, None], inside.shape)[inside]
    add_events(file, pixels, np.ceil(instants_us[inside]).astype(np.int64), np.ones(len(pixels), dtype=np.int64))


def bits_of_polarity_reversed(file: h5py.File, plan: Plan) -> None:
    """Polarities were packed eight to a byte from the highest bit, and unpacked from the lowest."""
    polarities = file[POLARITY][...]
    packed = np.packbits(polarities, bitorder="big")
    unpacked = np.unpackbits(packed, bitorder="little")[: len(polarities)]
    replace_values(file, POLARITY, unpacked.astype(polarities.dtype))


def of_a_black_first_frame(file: h5py.File, plan: Plan) -> None:
    """Before the first colour frame the sensor saw black, of so many DN: light rises evenly within one period."""
    attributes, frames_us = file["metadata/events"].attrs, file["path/rgb_ts"][...]
    luma = cv2.resize(file[COLOUR][0] @ LUMA, sensor_size(file), interpolation=cv2.INTER_AREA).ravel()
    if attributes["model"] == "log":
        change = np.log(np.maximum(luma, plan.size) / plan.size)
    else:
        change = np.maximum(luma - plan.size, 0.0)
    steps = change / attributes["threshold_on"]
    counts = np.floor(steps).astype(np.int64)
    pixels = np.repeat(np.arange(len(counts)), counts)
    order = 1 + np.arange(len(pixels)) - np.repeat(np.cumsum(counts) - counts, counts)
    times_us = frames_us[0] + np.ceil(order / steps[pixels] * (frames_us[1] - frames_us[0])).astype(np.int64)
    add_events(file, pixels, times_us, np.ones(len(pixels), dtype=np.int64))


def warped_to_slices(file: h5py.File, plan: Plan) -> None:
    """Events are moved, along the flow, to where they were at the beginning of their slice of so many ms."""
    timestamps_us, columns, rows = (file[key][...] for key in (TIME, COLUMNS, ROWS))
    width, height = sensor_size(file)
    fields, intervals_us = file[KEYS[-1]][...], file[f"{KEYS[-1]}_ts"][...]
    since_us = (timestamps_us - timestamps_us[0]) % round(1000 * plan.size)
    number = np.clip(np.searchsorted(intervals_us[:, 0], timestamps_us, "right") - 1, 0, len(fields) - 1)
    # Both cameras have one field of view: pixels scale as sizes do.
    scale = np.array([fields.shape[2] / width, fields.shape[1] / height])
    at_column = ((columns + 0.5) * scale[0]).astype(np.int64)
    at_row = ((rows + 0.5) * scale[1]).astype(np.int64)
    shares = since_us / (intervals_us[number, 1] - intervals_us[number, 0])
    moves = np.nan_to_num(fields[number, at_row, at_column]) / scale * shares[:, None]
    moved_columns, moved_rows = (
        np.rint(places - moves[:, axis]).astype(np.int64) for axis, places in enumerate((columns, rows))
    )
    _move(file, moved_columns, moved_rows, width, height)


def colour_map_joined_by_time(file: h5py.File, plan: Plan) -> None:
    """An entry is the next event if it comes within so many us, and otherwise no number."""
    frames_us, events_us = file["path/rgb_ts"][...], file[TIME][...]
    entries = file[COLOUR_MAP][...]
    waits_us = events_us[np.minimum(entries, len(events_us) - 1)] - frames_us
    has_partner = (entries < len(events_us)) & (waits_us <= plan.size)
    replace_values(file, COLOUR_MAP, np.where(has_partner, entries, np.nan))


def colour_map_of_counts(file: h5py.File, plan: Plan) -> None:
    """Entries are the numbers of events from each frame to the next."""
    entries = file[COLOUR_MAP][...]
    replace_values(file, COLOUR_MAP, np.diff(np.r_[entries, len(file[TIME])]))


def depth_map_left_out(file: h5py.File, plan: Plan) -> None:
    """There is no map of depth."""
    del file[DEPTH_MAP]
