"""Events that links, dies, comparators, flashes, masks, filters and renderers add, lose, move or turn."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, add_events, keep_events, pixels_of, sensor_size

FLASH_US = 300
"""Length of a flash: pixels get brighter within so many us, and darker within as many after it."""


def nothing_far_away(file: h5py.File, plan: Plan) -> None:
    """Pixels give no events while what they see is farther than so many metres, or has no depth."""
    x, y = file[COLUMNS][...].astype(np.float64), file[ROWS][...].astype(np.float64)
    K_events, K_depth = (np.array(file[f"metadata/cameras/{name}"].attrs["K"]) for name in ("events", "depth"))
    columns, rows, _ = K_depth @ np.linalg.inv(K_events) @ np.stack([x, y, np.ones_like(x)])
    depth_mm, depth_us = file["path/depth"][...], file["path/depth_ts"][...]
    height, width = depth_mm.shape[1:]
    after = np.clip(np.searchsorted(depth_us, file[TIME][...]), 1, len(depth_us) - 1)
    is_earlier_nearer = file[TIME][...] - depth_us[after - 1] < depth_us[after] - file[TIME][...]
    at = tuple(
        np.clip(np.rint(values), 0, extent - 1).astype(np.int64)
        for values, extent in ((rows, height), (columns, width))
    )
    keep_events(file, depth_mm[(after - is_earlier_nearer, *at)] <= 1000 * plan.size)


def halves_apart(file: h5py.File, plan: Plan) -> None:
    """Columns of the right half are too large by so many pixels; what leaves the sensor is lost."""
    width = sensor_size(file)[0]
    columns = file[COLUMNS][...].astype(np.int64)
    moved = columns + np.where(columns >= width // 2, int(plan.size), 0)
    replace_values(file, COLUMNS, np.minimum(moved, width - 1).astype(file[COLUMNS].dtype))
    keep_events(file, moved < width)


def comparators_kick_back(file: h5py.File, plan: Plan) -> None:
    """After so many percent of the events, their pixel fires with the other polarity 20 to 200 us later."""
    timestamps_us, polarity = file[TIME][...], file[POLARITY][...].astype(np.int64)
    rows = np.flatnonzero(plan.random.random(len(timestamps_us)) < plan.size / 100)
    times_us = np.minimum(timestamps_us[rows] + plan.random.integers(20, 201, len(rows)), timestamps_us[-1])
    add_events(file, pixels_of(file)[rows], times_us, 1 - polarity[rows])


def flashes_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, so many percent of the pixels see each flash of 100 to 250 Hz: brighter, then darker."""
    first_us, last_us = (int(timestamp_us) for timestamp_us in file[TIME][[0, -1]])
    begin_us, end_us = (first_us + share * (last_us - first_us) for share in (plan.begin, plan.end))
    starts_us = np.arange(begin_us, end_us - 2 * FLASH_US, 1e6 / plan.random.uniform(100, 250))
    count = int(np.prod(sensor_size(file)))
    sees = plan.random.random((len(starts_us), count)) < plan.size / 100
    flashes, pixels = np.nonzero(sees)
    brighter_us, darker_us = (
        starts_us[flashes] + begin + plan.random.uniform(0, FLASH_US, len(pixels)) for begin in (0, FLASH_US)
    )
    times_us = np.ceil(np.concatenate([brighter_us, darker_us])).astype(np.int64)
    add_events(file, np.tile(pixels, 2), times_us, np.repeat([1, 0], len(pixels)))


def scattered_pixels_masked(file: h5py.File, plan: Plan) -> None:
    """So many percent of the pixels, anywhere, give no events."""
    masked = plan.random.random(int(np.prod(sensor_size(file)))) < plan.size / 100
    keep_events(file, ~masked[pixels_of(file)])


def trails_removed(file: h5py.File, plan: Plan) -> None:
    """Events are absent whose pixel had one of the same polarity less than so many ms before, kept or not."""
    timestamps_us = file[TIME][...]
    group = 2 * pixels_of(file) + file[POLARITY][...]
    order = np.argsort(group, kind="stable")
    follows = np.zeros(len(group), dtype=bool)
    is_near = np.diff(timestamps_us[order]) < 1000 * plan.size
    follows[order[1:]] = (np.diff(group[order]) == 0) & is_near
    keep_events(file, ~follows)


def bits_of_columns_flip_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In so many percent of the events of the plan's time one bit of the column is wrong; what lies outside is lost."""
    width = sensor_size(file)[0]
    columns = file[COLUMNS][...].astype(np.int64)
    flipped = plan.times_us(file[TIME][...]) & (plan.random.random(len(columns)) < plan.size / 100)
    bits = 1 << plan.random.integers(int(width - 1).bit_length(), size=len(columns))
    columns = np.where(flipped, columns ^ bits, columns)
    replace_values(file, COLUMNS, np.minimum(columns, width - 1).astype(file[COLUMNS].dtype))
    keep_events(file, columns < width)


def bit_of_polarity_stuck_for_a_while(file: h5py.File, plan: Plan) -> None:
    """All events of the plan's time have one polarity."""
    polarity = file[POLARITY][...]
    within: NDArray[np.bool_] = plan.times_us(file[TIME][...])
    replace_values(file, POLARITY, np.where(within, plan.random.integers(2), polarity).astype(polarity.dtype))
