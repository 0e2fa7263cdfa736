"""Timestamps that decoders, readouts, augmentation, synchronisation, triggers and exporters change."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, sort_events

COLOUR_TIME: Final = "path/rgb_ts"
DEPTH_TIME: Final = "path/depth_ts"
IMU_TIME: Final = "path/imu/ts"

LOW_WORD_US: Final = 4096
"""Range of the low word of a time in EVT 3.0: 12 bits."""

BETWEEN_CORRECTIONS_US: Final = 250_000
"""Between two messages that correct a clock."""


def high_word_late(file: h5py.File, plan: Plan) -> None:
    """In the first so many percent of each range of the low word, events have the high word before it.

    None comes before the first event; a merge sorts afterwards.
    """
    timestamps_us = file[TIME][...]
    early = timestamps_us % LOW_WORD_US < plan.size / 100 * LOW_WORD_US
    replace_values(file, TIME, np.maximum(timestamps_us - np.where(early, LOW_WORD_US, 0), timestamps_us[0]))
    sort_events(file)


def of_first_request_of_row(file: h5py.File, plan: Plan) -> None:
    """A row's first event starts a group of so many ms, whose events in this row all carry its time."""
    timestamps_us = file[TIME][...]
    rows = file["path/events/y"][...].tolist()
    longest_us = 1000 * plan.size
    begun_us: dict[int, int] = {}
    times_us = np.empty_like(timestamps_us)
    for number, (row, timestamp_us) in enumerate(zip(rows, timestamps_us.tolist(), strict=True)):
        if timestamp_us - begun_us.get(row, -np.inf) >= longest_us:
            begun_us[row] = timestamp_us
        times_us[number] = begun_us[row]
    replace_values(file, TIME, times_us)
    sort_events(file)


def backwards(file: h5py.File, plan: Plan) -> None:
    """The last event comes first, and the first one last; polarities stay."""
    timestamps_us = file[TIME][...]
    replace_values(file, TIME, timestamps_us[0] + timestamps_us[-1] - timestamps_us)
    sort_events(file)


def corrected_at_intervals(file: h5py.File, plan: Plan) -> None:
    """The IMU's clock falls behind by so many ms within each quarter of a second, and is then set right."""
    timestamps_us = file[IMU_TIME][...]
    share = (timestamps_us - timestamps_us[0]) % BETWEEN_CORRECTIONS_US / BETWEEN_CORRECTIONS_US
    replace_values(file, IMU_TIME, timestamps_us - np.rint(1000 * plan.size * share).astype(np.int64))


def every_other_late(file: h5py.File, plan: Plan) -> None:
    """Every other depth frame is late by so many ms."""
    timestamps_us = file[DEPTH_TIME][...]
    timestamps_us[int(plan.random.integers(2)) :: 2] += round(1000 * plan.size)
    replace_values(file, DEPTH_TIME, timestamps_us)
    update_index_maps(file)


def trigger_bounces(file: h5py.File, plan: Plan) -> None:
    """So many percent of the colour frames, at least one and never the last, occur again, 0.7 to 3 ms later."""
    count = len(file[COLOUR_TIME])
    again = np.flatnonzero(plan.random.random(count - 1) < plan.size / 100)
    again = again if len(again) else plan.random.integers(count - 1, size=1)
    keep_rows(file, "rgb", np.sort(np.r_[np.arange(count), again]))
    timestamps_us = file[COLOUR_TIME][...]
    copies = np.flatnonzero(np.diff(timestamps_us) == 0) + 1
    timestamps_us[copies] += plan.random.integers(700, 3001, len(copies))
    replace_values(file, COLOUR_TIME, timestamps_us)
    update_index_maps(file)


def start_and_length(file: h5py.File, plan: Plan) -> None:
    """An interval of flow is given by its start and its length."""
    for key in KEYS:
        intervals_us = file[f"{key}_ts"][...]
        intervals_us[:, 1] -= intervals_us[:, 0]
        replace_values(file, f"{key}_ts", intervals_us)
