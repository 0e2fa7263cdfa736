"""Compiled loops over events.

Events come as columns in the order of time: ``x``, ``y`` (px), ``t`` (int64, ns) and ``p`` (1 brighter, 0 darker), all
of them inside the sensor. An event stamped at a frame's own time belongs before the frame: its stamp is the first tick
not before the crossing.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]
Signs = NDArray[np.int8]

_T2, _T1, _T0, _SIGN2, _SIGN1, _ON, _OFF, _BEFORE = range(8)
_FRAME, _LEVEL_ON, _LEVEL_OFF, _SLOPE, _GAP, _MORE_ON, _MORE_OFF = range(8, 15)
"""What is remembered of a pixel: the times of its last three events, the signs of the last two, its counts so far and
the frame before its last event; of its last sample the frame, levels, slope and gap, and what a straight line between
the events would add to the levels."""


@njit(cache=True)
def sample_levels(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    usable: Bool,
    longest_gap: int,
    least_gap: int,
    off_over_on: float,
    places: Int32,
    regressors: Float64,
) -> int:
    """Write a row for each two successive level samples of a pixel; return how many.

    A sample is a frame time t1 <= t < t2 between two events of one polarity at most ``longest_gap`` ns apart, at a
    pixel whose frame is ``usable`` (n, h, w), with an event before and one after them at a third to three times their
    gap: a cubic through less even events swings.
    Events closer than ``least_gap`` ns break the chain of a pixel: between them events may be lost.

    ``off_over_on`` is the ratio of the thresholds, good to first order. ``places`` (m, 3) receives pixel, earlier and
    later frame; ``regressors`` (m, 7) the brighter and darker events between the samples, fractions included (darker
    ones count negative), the change of their rates, 1/s, the longer of the two gaps, s, and what straight lines would
    add to the first two.
    """
    width = usable.shape[2]
    pixels = np.full((usable.shape[1] * width, 15), -np.inf)
    pixels[:, _ON : _OFF + 1] = 0.0
    pixels[:, _BEFORE : _FRAME + 1] = -1.0
    frame, rows = 0, 0
    for i in range(len(t)):
        while frame < len(frame_times) and frame_times[frame] < t[i]:
            frame += 1
        at = y[i] * width + x[i]
        now, sign = (t[i] - frame_times[0]) * 1e-9, (1.0 if p[i] == 1 else -1.0)
        sample = int(pixels[at, _BEFORE])
        if now - pixels[at, _T2] < least_gap * 1e-9:
            pixels[at, _FRAME] = -1.0
        elif sample >= 0 and pixels[at, _SIGN1] == pixels[at, _SIGN2] and usable[sample, y[i], x[i]]:
            at_frame = (frame_times[sample] - frame_times[0]) * 1e-9
            gap = pixels[at, _T2] - pixels[at, _T1]
            if (
                pixels[at, _T1] <= at_frame
                and 0.0 < gap <= longest_gap * 1e-9
                and gap <= 3.0 * (pixels[at, _T1] - pixels[at, _T0]) <= 9.0 * gap
                and gap <= 3.0 * (now - pixels[at, _T2]) <= 9.0 * gap
            ):
                brighter = pixels[at, _SIGN2] > 0.0
                step = 1.0 if sign == pixels[at, _SIGN2] else -(off_over_on if brighter else 1.0 / off_over_on)
                share, rate = _between(pixels[at, _T0], pixels[at, _T1], pixels[at, _T2], now, step, at_frame)
                # The last event has been counted; the sample lies before it.
                level_on = pixels[at, _ON] + (share - 1.0 if brighter else 0.0)
                level_off = pixels[at, _OFF] + (0.0 if brighter else share - 1.0)
                slope = rate if brighter else -rate
                straight = (at_frame - pixels[at, _T1]) / gap - share
                more_on, more_off = (straight, 0.0) if brighter else (0.0, straight)
                if pixels[at, _FRAME] >= 0.0:
                    places[rows, 0], places[rows, 1], places[rows, 2] = at, int(pixels[at, _FRAME]), sample
                    regressors[rows, 0] = level_on - pixels[at, _LEVEL_ON]
                    regressors[rows, 1] = pixels[at, _LEVEL_OFF] - level_off
                    regressors[rows, 2] = max(slope, 0.0) - max(pixels[at, _SLOPE], 0.0)
                    regressors[rows, 3] = min(slope, 0.0) - min(pixels[at, _SLOPE], 0.0)
                    regressors[rows, 4] = max(gap, pixels[at, _GAP])
                    regressors[rows, 5] = more_on - pixels[at, _MORE_ON]
                    regressors[rows, 6] = pixels[at, _MORE_OFF] - more_off
                    rows += 1
                pixels[at, _FRAME], pixels[at, _GAP] = sample, gap
                pixels[at, _MORE_ON], pixels[at, _MORE_OFF] = more_on, more_off
                pixels[at, _LEVEL_ON], pixels[at, _LEVEL_OFF], pixels[at, _SLOPE] = level_on, level_off, slope
        pixels[at, _T0], pixels[at, _T1], pixels[at, _T2] = pixels[at, _T1], pixels[at, _T2], now
        pixels[at, _SIGN1], pixels[at, _SIGN2] = pixels[at, _SIGN2], sign
        pixels[at, _BEFORE] = frame - 1
        pixels[at, _ON if sign > 0.0 else _OFF] += 1.0
    return rows


@njit(cache=True)
def _between(t0: float, t1: float, t2: float, t3: float, step: float, t: float) -> tuple[float, float]:
    """Return the level at t, and its rate, of the cubic through (t0, -1), (t1, 0), (t2, 1), (t3, 1 + step).

    Newton's divided differences. The level before t1 is one event lower whatever the event at t0 was.
    """
    first, second, third = 1.0 / (t1 - t0), 1.0 / (t2 - t1), step / (t3 - t2)
    earlier, later = (second - first) / (t2 - t0), (third - second) / (t3 - t1)
    bend = (later - earlier) / (t3 - t0)
    a, b, c = t - t1, t - t2, t - t0
    level = a * second + a * b * (earlier + bend * c)
    rate = second + (a + b) * earlier + (a * b + (a + b) * c) * bend
    return level, rate


@njit(cache=True)
def count_between_frames(
    x: Columns,
    y: Columns,
    t: Int64,
    p: Polarities,
    frame_times: Int64,
    counts: Int32,
) -> None:
    """Count the events in (frame i, frame i+1] into ``counts`` (n - 1, 2, h, w): darker first, then brighter."""
    interval = -1
    for i in range(len(t)):
        while interval + 1 < len(frame_times) and frame_times[interval + 1] < t[i]:
            interval += 1
        if interval < 0:
            continue
        if interval >= len(counts):
            break
        counts[interval, p[i], y[i], x[i]] += 1


@njit(cache=True)
def follow_polarities(
    x: Columns, y: Columns, p: Polarities, events: Int64, runs: Int64, first: Signs, last: Signs
) -> None:
    """Add events to ``events``, and sequences of one polarity to ``runs``, (h, w) each.

    ``first`` and ``last`` (h, w) hold the polarity of each pixel's first and last event, negative where there is none.
    """
    for i in range(len(x)):
        row, column = y[i], x[i]
        events[row, column] += 1
        if last[row, column] != p[i]:
            runs[row, column] += 1
        if first[row, column] < 0:
            first[row, column] = p[i]
        last[row, column] = p[i]


@njit(cache=True)
def find_repeats(x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return how many events share pixel and stamp with one before, the first such event, and doubled ticks.

    A tick is doubled when each pixel that fires in it does so an even number of times with each polarity, at least
    eight events in all: a packet written twice. The last value is the event at which the first doubled tick begins.
    """
    last = np.full(shape, np.iinfo(np.int64).min)
    odd = np.zeros((2, *shape), np.bool_)
    repeats, first, doubled, first_doubled = 0, -1, 0, -1
    begin, unpaired = 0, 0
    for i in range(len(t)):
        if last[y[i], x[i]] == t[i]:
            repeats += 1
            first = i if first < 0 else first
        last[y[i], x[i]] = t[i]
        odd[p[i], y[i], x[i]] ^= True
        unpaired += 1 if odd[p[i], y[i], x[i]] else -1
        if i + 1 == len(t) or t[i + 1] != t[i]:
            if unpaired == 0 and i + 1 - begin >= 8:
                doubled += 1
                first_doubled = begin if first_doubled < 0 else first_doubled
            for j in range(begin, i + 1):
                odd[p[j], y[j], x[j]] = False
            begin, unpaired = i + 1, 0
    return repeats, first, doubled, first_doubled


@njit(cache=True)
def mark_bursts(x: Columns, y: Columns, t: Int64, least_gap: int, marked: Bool) -> None:
    """Mark in ``marked`` (h, w) the pixels with two events less than ``least_gap`` ns apart."""
    last = np.full(marked.shape, np.iinfo(np.int64).min // 2)
    for i in range(len(t)):
        if t[i] - last[y[i], x[i]] < least_gap:
            marked[y[i], x[i]] = True
        last[y[i], x[i]] = t[i]


@njit(cache=True)
def bound_excursions(
    lower: Float64,
    upper: Float64,
    counts: Int32,
    units: float,
    step_on: int,
    step_off: int,
    drift: Int64,
    frames: Int64,
    highest: Int64,
    lowest: Int64,
) -> Int64:
    """Follow signal minus events of every pixel over the frames; return what the events sum to, (h, w).

    ``lower`` and ``upper`` (n, h, w) bound the signal, which counts ``units`` times; ``counts`` (n - 1, 2, h, w) holds
    darker and brighter events between the frames, ``drift`` (n - 1,) what the signal gains besides, ``frames`` (n,)
    their numbers. ``highest`` (2, h, w) receives the largest lower bound of the difference and its frame; ``lowest``
    the smallest upper bound. Bounds that are not finite tell nothing.
    """
    total = np.zeros(lower.shape[1:], np.int64)
    for frame in range(len(lower)):
        for row in range(lower.shape[1]):
            for column in range(lower.shape[2]):
                if frame > 0:
                    on, off = counts[frame - 1, 1, row, column], counts[frame - 1, 0, row, column]
                    total[row, column] += on * step_on - off * step_off - drift[frame - 1]
                low, high = lower[frame, row, column], upper[frame, row, column]
                if not (np.isfinite(low) and np.isfinite(high)):
                    continue
                least = int(np.floor(low * units)) - total[row, column]
                most = int(np.ceil(high * units)) - total[row, column]
                if least > highest[0, row, column]:
                    highest[0, row, column], highest[1, row, column] = least, frames[frame]
                if most < lowest[0, row, column]:
                    lowest[0, row, column], lowest[1, row, column] = most, frames[frame]
    return total
