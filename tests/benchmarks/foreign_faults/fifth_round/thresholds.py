"""Events of a sensor whose thresholds are not those of all pixels, or not those of all times."""

from collections.abc import Callable

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.second_round.events import TIME, pixels_of, sensor_size, sort_events

LEAST_FACTOR = 0.4
"""Of a pixel's threshold, relative to the declared one."""

ROUNDING = 1e-9
"""Of a threshold: sums of floating-point numbers miss whole numbers by less."""

TAIL_US = 10_000
"""From a pixel's last event to the end of its course."""

Factors = Callable[[NDArray[np.int64], NDArray[np.float64]], NDArray[np.float64]]
"""Return thresholds (N,), in old ones, by pixel (N,) and time (N,), us."""


def _courses(
    file: h5py.File, random: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return pixel, time, us, and level, in old thresholds, of points between which light follows straight lines.

    The points are the events, one between each two of different polarity, and one behind the last of a pixel: there
    the level has turned, or ends, before it reached a further threshold, at a share of it that is drawn at random.
    """
    pixels, signs = pixels_of(file), np.where(file[POLARITY][...] == 1, 1, -1)
    order = np.argsort(pixels, kind="stable")
    pixels, signs, times_us = pixels[order], signs[order], file[TIME][...][order].astype(np.float64)
    total = np.cumsum(signs)
    is_first = np.r_[True, np.diff(pixels) > 0]
    before = (total - signs)[is_first]
    levels = (total - before[np.cumsum(is_first) - 1]).astype(np.float64)
    is_last = np.r_[is_first[1:], True]
    turns = np.flatnonzero(is_last | np.r_[np.diff(signs) != 0, True])
    ends_us = np.minimum(times_us + TAIL_US, file[TIME][-1])
    next_us = np.where(is_last, ends_us, (times_us + np.r_[times_us[1:], 0]) / 2)
    peaks = levels[turns] + signs[turns] * random.random(len(turns))
    place = np.argsort(np.r_[np.arange(len(pixels)), turns + 0.5], kind="stable")
    return np.r_[pixels, pixels[turns]][place], np.r_[times_us, next_us[turns]][place], np.r_[levels, peaks][place]


def _simulate_again(file: h5py.File, factors: Factors, random: np.random.Generator) -> None:
    """Replace events by those of other thresholds."""
    pixels, times_us, levels = _courses(file, random)
    thresholds = factors(pixels, times_us)
    first_us = float(file[TIME][0])
    fired: list[tuple[int, float, int]] = []
    pixel, latest_us, latest, reference = -1, first_us, 0.0, 0.0
    points = zip(pixels.tolist(), times_us.tolist(), levels.tolist(), thresholds.tolist(), strict=True)
    for number, time_us, level, threshold in points:
        if number != pixel:
            pixel, latest_us, latest, reference = number, first_us, 0.0, 0.0
        while abs(level - reference) >= threshold - ROUNDING:
            sign = 1 if level > reference else -1
            reference += sign * threshold
            share = float(np.clip((reference - latest) / (level - latest), 0, 1)) if level != latest else 1.0
            fired.append((pixel, latest_us + share * (time_us - latest_us), sign))
        latest_us, latest = time_us, level
    fired_pixels, fired_us, polarities = np.array(fired).T
    width = sensor_size(file)[0]
    for key, values in {
        TIME: np.ceil(fired_us),
        POLARITY: polarities > 0,
        COLUMNS: fired_pixels % width,
        ROWS: fired_pixels // width,
    }.items():
        replace_values(file, key, values.astype(file[key].dtype))
    sort_events(file)


def differ_by_pixel(file: h5py.File, plan: Plan) -> None:
    """Each pixel has a threshold of its own, with a standard deviation of so many percent."""
    scatter = plan.size / 100 * plan.random.normal(size=int(np.prod(sensor_size(file))))
    of_pixel = np.maximum(1 + scatter, LEAST_FACTOR)
    _simulate_again(file, lambda pixels, times_us: of_pixel[pixels], plan.random)


def grow_in_time(file: h5py.File, plan: Plan) -> None:
    """Thresholds are the declared ones at first, and so many percent larger at the end."""
    first_us, last_us = (float(timestamp_us) for timestamp_us in file[TIME][[0, -1]])
    growth = plan.size / 100 / (last_us - first_us)
    _simulate_again(file, lambda pixels, times_us: 1 + growth * (times_us - first_us), plan.random)
