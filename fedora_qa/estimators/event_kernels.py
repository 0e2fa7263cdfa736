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

_LAST, _POLARITY, _ON, _OFF, _FRAME, _LEVEL_ON, _LEVEL_OFF, _SLOPE = range(8)
"""What is remembered of a pixel, one cache line: its last event's time and polarity, its counts so far, and the frame,
levels and slope of its last sample."""


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
    places: Int32,
    regressors: Float64,
) -> int:
    """Write a row for each two successive level samples of a pixel; return how many.

    A sample is a frame time between two events of one polarity at most ``longest_gap`` ns apart, at a pixel whose
    frame is ``usable`` (n, h, w). There the level is known to a fraction of the threshold. Events closer than
    ``least_gap`` ns break the chain of a pixel: between them events may be lost.

    ``places`` (m, 3) receives pixel, earlier and later frame; ``regressors`` (m, 4) the brighter and darker events
    between the samples, fractions included (darker ones count negative), and the change of their rates, 1/s.
    """
    width = usable.shape[2]
    pixels = np.full((usable.shape[1] * width, 8), -1.0)
    pixels[:, _ON] = 0.0
    pixels[:, _OFF] = 0.0
    frame, rows = 0, 0
    for i in range(len(t)):
        while frame < len(frame_times) and frame_times[frame] < t[i]:
            frame += 1
        at = y[i] * width + x[i]
        pixel = pixels[at]
        now, brighter = float(t[i] - frame_times[0]), float(p[i])
        gap = now - pixel[_LAST]
        known = pixel[_POLARITY] >= 0.0
        if known and gap < least_gap:
            pixel[_FRAME] = -1.0
        elif (
            known
            and frame > 0
            and pixel[_POLARITY] == brighter
            and gap <= longest_gap
            and pixel[_LAST] <= frame_times[frame - 1] - frame_times[0]
            and usable[frame - 1, y[i], x[i]]
        ):
            share = (frame_times[frame - 1] - frame_times[0] - pixel[_LAST]) / gap
            level_on = pixel[_ON] + (share if brighter == 1.0 else 0.0)
            level_off = pixel[_OFF] + (share if brighter == 0.0 else 0.0)
            slope = (1.0 if brighter == 1.0 else -1.0) / (gap * 1e-9)
            if pixel[_FRAME] >= 0.0:
                places[rows, 0] = at
                places[rows, 1] = int(pixel[_FRAME])
                places[rows, 2] = frame - 1
                regressors[rows, 0] = level_on - pixel[_LEVEL_ON]
                regressors[rows, 1] = pixel[_LEVEL_OFF] - level_off
                regressors[rows, 2] = max(slope, 0.0) - max(pixel[_SLOPE], 0.0)
                regressors[rows, 3] = min(slope, 0.0) - min(pixel[_SLOPE], 0.0)
                rows += 1
            pixel[_FRAME] = frame - 1
            pixel[_LEVEL_ON], pixel[_LEVEL_OFF], pixel[_SLOPE] = level_on, level_off, slope
        pixel[_LAST], pixel[_POLARITY] = now, brighter
        if brighter == 1.0:
            pixel[_ON] += 1.0
        else:
            pixel[_OFF] += 1.0
    return rows


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
def count_by_pixel(x: Columns, y: Columns, p: Polarities, counts: Int64) -> None:
    """Add events to ``counts`` (2, h, w): darker first, then brighter."""
    for i in range(len(x)):
        counts[p[i], y[i], x[i]] += 1


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
