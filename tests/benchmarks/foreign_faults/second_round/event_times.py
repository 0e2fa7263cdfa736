"""Times and order of events that converters, clocks and decoders change."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, pixels_of, sensor_size, sort_events
from tests.benchmarks.foreign_faults.sensor import LUMA


def in_floating_seconds(file: h5py.File, plan: Plan) -> None:
    """Times are float64 seconds; the index maps were made in microseconds."""
    replace_values(file, TIME, file[TIME][...] / 1e6)


def at_even_times_between_frames(file: h5py.File, plan: Plan) -> None:
    """Between two colour frames, the k-th event of a pixel comes at k/n of the time; n is the largest number."""
    stamps_us, frames_us = file[TIME][...], file["path/rgb_ts"][...]
    interval = np.clip(np.searchsorted(frames_us, stamps_us, "left") - 1, 0, len(frames_us) - 2)
    group = interval * int(np.prod(sensor_size(file))) + pixels_of(file)
    order = np.argsort(group, kind="stable")
    place = np.empty(len(group), dtype=np.int64)
    place[order] = np.arange(len(group)) - np.searchsorted(group[order], group[order], "left") + 1
    largest = np.zeros(len(frames_us), dtype=np.int64)
    np.maximum.at(largest, interval, place)
    share = place / largest[interval]
    replace_values(
        file,
        TIME,
        frames_us[interval] + np.ceil(share * (frames_us[interval + 1] - frames_us[interval])).astype(np.int64),
    )
    sort_events(file)


def brighter_first(file: h5py.File, plan: Plan) -> None:
    """All brighter events stand before all darker ones, each in the order of time."""
    keep_rows(file, "events", np.argsort(1 - file["path/events/p"][...].astype(np.int64), kind="stable"))


def buffers_from_a_stack(file: h5py.File, plan: Plan) -> None:
    """Within the plan's rows, events of each buffer of so many stand from the last to the first."""
    order = np.arange(len(file[TIME]))
    rows = plan.rows(len(order))
    for begin in range(rows.start, rows.stop, int(plan.size)):
        buffer = slice(begin, min(begin + int(plan.size), rows.stop))
        order[buffer] = order[buffer][::-1]
    keep_rows(file, "events", order)


def clock_warms_up(file: h5py.File, plan: Plan) -> None:
    """The clock is right at the start, and gains so many ppm at the end."""
    stamps_us = file[TIME][...]
    elapsed_us = stamps_us - stamps_us[0]
    gained_us = plan.size / 1e6 * elapsed_us.astype(np.float64) ** 2 / (2 * float(elapsed_us[-1]))
    replace_values(file, TIME, stamps_us + np.rint(gained_us).astype(np.int64))
    update_index_maps(file)


def dark_pixels_late(file: h5py.File, plan: Plan) -> None:
    """An event is late by so many ms times the median luma over its own: slow photoreceptors, at most ten times."""
    stamps_us, frames_us = file[TIME][...], file["path/rgb_ts"][...]
    frames = file["path/rgb"][...]
    scale = np.array(frames.shape[2:0:-1]) / sensor_size(file)
    column, row = ((file[f"path/events/{axis}"][...] + 0.5) * scale[number] for number, axis in enumerate("xy"))
    frame = np.clip(np.searchsorted(frames_us, stamps_us), 0, len(frames) - 1)
    luma = frames[frame, row.astype(int), column.astype(int)] @ LUMA
    late_us = 1000 * plan.size * np.minimum(np.median(luma) / np.maximum(luma, 1.0), 10)
    replace_values(file, TIME, np.minimum(stamps_us + np.rint(late_us).astype(np.int64), stamps_us[-1]))
    sort_events(file)


def high_words_lost(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time the high word of the time, from 4096 us upwards, stays what it was."""
    stamps_us = file[TIME][...]
    within = plan.times_us(stamps_us)
    first_us = stamps_us[np.argmax(within)]
    replace_values(file, TIME, np.where(within, first_us - first_us % 4096 + stamps_us % 4096, stamps_us))


def polarity_of_the_event_before(file: h5py.File, plan: Plan) -> None:
    """Each event has the polarity of the row before it."""
    polarity = file["path/events/p"][...]
    replace_values(file, "path/events/p", np.concatenate([polarity[:1], polarity[:-1]]))
