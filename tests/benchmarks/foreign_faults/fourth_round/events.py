"""Events that bias circuits, bit errors, decoders and rectification add, lose, move or turn."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
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

WINDOW_SHARE = 0.55
"""Of the sensor's width and height, the side of a window."""

ROUNDING = 1e-9
"""Of a threshold: sums of floating-point numbers miss whole numbers by less."""


def _simulate_again(file: h5py.File, factors: NDArray[np.float64]) -> None:
    """Simulate events with thresholds that are so many times the old ones; each event has a factor, at least 1.

    A pixel's level is known at each of its events, in old thresholds; between two of them it follows a straight line.
    """
    timestamps_us, signs = file[TIME][...], np.where(file[POLARITY][...] == 1, 1, -1)
    count = int(np.prod(sensor_size(file)))
    level, reference, latest_us = np.zeros(count), np.zeros(count), np.full(count, float(timestamps_us[0]))
    sources: list[int] = []
    fired: list[tuple[float, int]] = []
    for row, pixel in enumerate(pixels_of(file).tolist()):
        before, sign = level[pixel], signs[row]
        level[pixel] += sign
        while abs(level[pixel] - reference[pixel]) >= factors[row] - ROUNDING:
            polarity = 1 if level[pixel] > reference[pixel] else -1
            reference[pixel] += polarity * factors[row]
            share = float(np.clip((reference[pixel] - before) * sign, 0, 1))
            sources.append(row)
            fired.append((latest_us[pixel] + share * (timestamps_us[row] - latest_us[pixel]), polarity))
        latest_us[pixel] = timestamps_us[row]
    times_us, polarities = np.array(fired).T
    for key, values in {
        TIME: np.ceil(times_us),
        POLARITY: polarities > 0,
        COLUMNS: file[COLUMNS][...][sources],
        ROWS: file[ROWS][...][sources],
    }.items():
        replace_values(file, key, values.astype(file[key].dtype))
    sort_events(file)


def threshold_grows_across(file: h5py.File, plan: Plan) -> None:
    """Thresholds grow along a row, from what is declared at one side to so many percent more at the other."""
    share = file[COLUMNS][...] / (sensor_size(file)[0] - 1)
    share = share if plan.random.random() < 0.5 else 1 - share
    _simulate_again(file, 1 + plan.size / 100 * share)


def window_with_other_biases(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, thresholds in a window are so many times what is declared."""
    inside = plan.times_us(file[TIME][...])
    for key, extent in zip((COLUMNS, ROWS), sensor_size(file), strict=True):
        side = WINDOW_SHARE * extent
        begin = plan.random.uniform(0.2, 0.8) * (extent - side)
        inside &= (file[key][...] >= begin) & (file[key][...] < begin + side)
    _simulate_again(file, np.where(inside, plan.size, 1.0))


def of_two_recorders(file: h5py.File, plan: Plan) -> None:
    """Each event occurs a second time, so many us later."""
    timestamps_us = file[TIME][...]
    late_us = np.minimum(timestamps_us + round(plan.size), timestamps_us[-1])
    add_events(file, pixels_of(file), late_us, file[POLARITY][...].astype(np.int64))


def crosstalk(file: h5py.File, plan: Plan) -> None:
    """After so many percent of the events, a pixel beside theirs fires with their polarity 3 to 40 us later."""
    width, height = sensor_size(file)
    timestamps_us = file[TIME][...]
    rows = np.flatnonzero(plan.random.random(len(timestamps_us)) < plan.size / 100)
    steps = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])[plan.random.integers(4, size=len(rows))]
    x, y = (file[key][...][rows].astype(np.int64) + steps[:, axis] for axis, key in enumerate((COLUMNS, ROWS)))
    times_us = np.minimum(timestamps_us[rows] + plan.random.integers(3, 41, len(rows)), timestamps_us[-1])
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    polarity = file[POLARITY][...][rows].astype(np.int64)
    add_events(file, (y * width + x)[inside], times_us[inside], polarity[inside])


def enlarged(file: h5py.File, plan: Plan) -> None:
    """Places are so many percent farther from the middle, in whole pixels; what leaves the sensor is lost."""
    inside = np.ones(len(file[TIME]), dtype=bool)
    for key, extent in zip((COLUMNS, ROWS), sensor_size(file), strict=True):
        middle = (extent - 1) / 2
        places = np.rint(middle + (1 + plan.size / 100) * (file[key][...] - middle))
        inside &= (places >= 0) & (places < extent)
        replace_values(file, key, np.clip(places, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)


def rows_exchanged_in_pairs(file: h5py.File, plan: Plan) -> None:
    """The lowest bit of the row is inverted; what leaves the sensor is lost."""
    height = sensor_size(file)[1]
    rows = file[ROWS][...] ^ 1
    replace_values(file, ROWS, np.minimum(rows, height - 1).astype(file[ROWS].dtype))
    keep_events(file, rows < height)


def bits_of_polarity_flip(file: h5py.File, plan: Plan) -> None:
    """So many percent of the events of the plan's time, anywhere, have the other polarity."""
    polarity = file[POLARITY][...]
    flipped = plan.times_us(file[TIME][...]) & (plan.random.random(len(polarity)) < plan.size / 100)
    replace_values(file, POLARITY, np.where(flipped, 1 - polarity, polarity).astype(polarity.dtype))
