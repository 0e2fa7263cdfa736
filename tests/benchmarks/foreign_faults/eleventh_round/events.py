"""Events that decoders, drivers, read-outs and simulators add, lose or number."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP
from tests.benchmarks.foreign_faults.second_round.events import (
    TIME,
    add_events,
    keep_events,
    pixels_of,
    sensor_size,
    sort_events,
)
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME, LOW_WORD_US

SECOND_US: Final = 1_000_000
READ_OUT_US: Final = 1_000
"""Length of a read-out of all rows."""

LAST_WORD: Final = 24
"""Columns from the base of a vector to those of its third word, in EVT 3.0."""

BITS: Final = 8
"""Columns of the third word of a vector."""

SUBPIXELS: Final = 32
"""In a pixel."""

KEPT: Final = (0.25, 0.6)
"""Least and greatest share of events that lie on the sensor when they are decoded wrongly."""

STEP_SHARE: Final = 0.02
"""Of the period of leaks, the standard deviation of the times at which pixels leak."""


def numbers_of_renders(file: h5py.File, plan: Plan) -> None:
    """Times are the numbers of renders, of which there are so many a second."""
    timestamps_us = file[TIME][...]
    numbers = np.floor((timestamps_us - file[COLOUR_TIME][0]) * plan.size / SECOND_US)
    replace_values(file, TIME, numbers.astype(timestamps_us.dtype))
    sort_events(file)


def high_words_as_vectors(file: h5py.File, plan: Plan) -> None:
    """Behind so many percent of the events the lower byte of the high word of time is read as eight columns.

    The clock of the sensor began at any time.
    """
    timestamps_us, pixels, polarity = file[TIME][...], pixels_of(file), file[POLARITY][...]
    chosen = np.flatnonzero(plan.random.random(len(timestamps_us)) < plan.size / 100)
    chosen = chosen if len(chosen) else np.array([len(timestamps_us) // 2])
    words = timestamps_us[chosen] // LOW_WORD_US + plan.random.integers(256)
    bits = (words[:, None] >> np.arange(BITS)) & 1
    width = sensor_size(file)[0]
    columns = (pixels[chosen] % width)[:, None] + LAST_WORD + np.arange(BITS)
    events, offsets = np.nonzero((bits == 1) & (columns < width))
    added = chosen[events]
    add_events(file, pixels[added] + LAST_WORD + offsets, timestamps_us[added], polarity[added].astype(np.int64))


def in_subpixels(file: h5py.File, plan: Plan) -> None:
    """Columns and rows are in 32nds of a pixel."""
    for key in (COLUMNS, ROWS):
        places = file[key][...]
        replace_values(file, key, places * places.dtype.type(SUBPIXELS))


def a_second_early(file: h5py.File, plan: Plan) -> None:
    """So many events, anywhere, have the second before their own; nothing is sorted, and maps were made before."""
    timestamps_us = file[TIME][...]
    count = min(int(plan.size), len(timestamps_us) // 2)
    timestamps_us[plan.random.choice(len(timestamps_us), count, replace=False)] -= SECOND_US
    replace_values(file, TIME, timestamps_us)


def begin_with_those_of_the_last_run(file: h5py.File, plan: Plan) -> None:
    """The first so many events are the last ones of another sequence, with their late times; maps were made before."""
    count = min(int(plan.size), len(file[TIME]) // 4)
    with h5py.File(plan.donor) as donor:
        for key in (TIME, COLUMNS, ROWS, POLARITY):
            values = file[key][...]
            values[:count] = donor[key][...][-count:]
            replace_values(file, key, values)


def samples_of_frames(file: h5py.File, plan: Plan) -> None:
    """Each colour frame in the plan's time is read pixel by pixel within so many ms, as darker events."""
    frames_us = file[COLOUR_TIME][...]
    width, height = sensor_size(file)
    pixels = np.arange(width * height)
    starts_us = frames_us[plan.times_us(frames_us)]
    starts_us = starts_us if len(starts_us) else frames_us[len(frames_us) // 2 :][:1]
    read_us = np.rint(1000 * plan.size * pixels / len(pixels)).astype(np.int64)
    timestamps_us = (starts_us[:, None] + read_us).ravel()
    inside = timestamps_us <= frames_us[-1]
    add_events(
        file,
        np.tile(pixels, len(starts_us))[inside],
        timestamps_us[inside],
        np.zeros(int(inside.sum()), dtype=np.int64),
    )


def leaks_in_step(file: h5py.File, plan: Plan) -> None:
    """All pixels leak a brighter event every so many ms, at nearly the same time."""
    timestamps_us = file[TIME][...]
    width, height = sensor_size(file)
    period_us = 1000 * plan.size
    first_us = timestamps_us[0] + plan.random.uniform(0.1, 0.5) * period_us
    leaks_us = np.arange(first_us, timestamps_us[-1], period_us)
    spread_us = plan.random.normal(0.0, STEP_SHARE * period_us, (len(leaks_us), width * height))
    added_us = np.clip(np.rint(leaks_us[:, None] + spread_us), timestamps_us[0], timestamps_us[-1]).astype(np.int64)
    pixels = np.tile(np.arange(width * height), len(leaks_us))
    add_events(file, pixels, added_us.ravel(), np.ones(added_us.size, dtype=np.int64))


def rows_skipped_by_full_read_outs(file: h5py.File, plan: Plan) -> None:
    """In the plan's time each read-out of 1 ms loses so many percent of the rows, others each time."""
    timestamps_us = file[TIME][...]
    read_outs = (timestamps_us - timestamps_us[0]) // READ_OUT_US
    lost = plan.random.random((int(read_outs[-1]) + 1, sensor_size(file)[1])) < plan.size / 100
    keep_events(file, ~(plan.times_us(timestamps_us) & lost[read_outs, file[ROWS][...]]))


def event_of_zeros_in_front(file: h5py.File, plan: Plan) -> None:
    """An event of zeros lies in front of all; both maps were made without it."""
    for key in (TIME, COLUMNS, ROWS, POLARITY):
        values = file[key][...]
        replace_values(file, key, np.concatenate([np.zeros(1, dtype=values.dtype), values]))


def colour_map_of_intervals(file: h5py.File, plan: Plan) -> None:
    """An entry is of an interval between two frames; the last frame begins none."""
    replace_values(file, COLOUR_MAP, file[COLOUR_MAP][...][:-1])


def polarity_in_32_bits(file: h5py.File, plan: Plan) -> None:
    """Polarities of 1 and -1 are stored in 32 bits without sign."""
    replace_values(file, POLARITY, np.where(file[POLARITY][...] > 0, 1, -1).astype(np.int32).view(np.uint32))


def sections_in_the_wrong_order(file: h5py.File, plan: Plan) -> None:
    """A quarter to three fifths of the events remain, anywhere, and time passes slower by so many times."""
    timestamps_us = file[TIME][...]
    slower_us = timestamps_us[0] + np.floor((timestamps_us - timestamps_us[0]) / plan.size)
    kept = plan.random.random(len(timestamps_us)) < plan.random.uniform(*KEPT)
    kept[len(kept) // 2] = True
    replace_values(file, TIME, slower_us.astype(timestamps_us.dtype))
    keep_events(file, kept)
    sort_events(file)
