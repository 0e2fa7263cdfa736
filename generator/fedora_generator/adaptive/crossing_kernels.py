"""Every crossing of every pixel between the samples of its tile, by rendering the pixel at more times.

Between two samples a pixel is *quiet*, if its signal cannot reach a threshold, or *steep*, if it rises or falls all the
way; else the middle is sampled too, and both halves are examined in turn. The second difference of the samples around
decides, d: a parabola leaves the range of its ends by d / 8 at most, and is steep where its ends differ by
d / 2 or more. ``caution`` times as much is allowed for, as no signal is a parabola. In a steep piece the levels that
lie between its ends are crossed once each, and a bracketed secant finds when.

README.md says why the loops count no references (``UNCOUNTED``) and are inlined in their only caller.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.adaptive.light_kernels import (
    Scratch,
    Sensor,
    Stage,
    sample_block,
    signal_at,
    stage_of,
    thresholds_of,
)
from fedora_generator.surfaces.render_kernels import TILE, tile_origin
from fedora_generator.surfaces.shading_kernels import Surfaces
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.visibility_kernels import FaceFrames
from fedora_generator.threads import UNCOUNTED

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

NOT_FINITE: Final = -1
"""Instead of a tile's number of events: a signal is not finite."""

NO_ROOM: Final = -2
"""Instead of a tile's number of events: there are more than fit, and nothing was changed."""

DEEPEST: Final = 40
"""Most open pieces of a step: one more for every halving."""

FINEST_S: Final = 1e-9
"""Pieces of a nanosecond are not halved: a jump has no slope, and the clock of a file counts microseconds."""

SHORTEST: Final = 1e-15
"""Share of a path between two instants that are one."""

_MOST_SECANTS: Final = 60

_ROUNDING: Final = 1e-10
"""A second difference of L that may be rounding: 1 km from where its waves start, a texture has that of 1e-11."""


class Care(NamedTuple):
    """Factor on the curvature of a parabola, and the largest error of a crossing, s."""

    caution: float
    tolerance_s: float


class Clock(NamedTuple):
    """Start of the path, since that of the recording, its length and the tick of the timestamps, ns; bits of a key."""

    start_ns: int
    span_ns: int
    tick_ns: int
    column_bits: int
    timestamp_shift: int


@njit(cache=True, error_model="numpy", **UNCOUNTED, nogil=True)
def follow_tiles(
    textures: TextureTable,
    surfaces: Surfaces,
    frames: FaceFrames,
    bodies: Integers,
    coefficients: Floats,
    sensor: Sensor,
    care: Care,
    clock: Clock,
    tiles: Integers,
    samples: Integers,
    face_starts: Integers,
    faces: Integers,
    scratch: Scratch,
    keys: Integers,
    counts: Integers,
    thread: int,
    first: int,
    stop: int,
) -> int:
    """Sample tiles and find their events.

    Parameters
    ----------
    textures, surfaces, frames, bodies
        The world, its faces before anything has moved.
    coefficients
        (terms, entries) of the camera path.
    sensor
        State and thresholds of the pixels; reference and signal are left as at the end of the path.
    care
        Allowance for curvature, and tolerance.
    clock
        Time and bits of a key.
    tiles
        (n,) numbers of the tiles to follow.
    samples
        (all tiles,) samples after the first.
    face_starts, faces
        Faces of each tile, as in ``TilePlan``.
    scratch
        Scratch space of the threads.
    keys
        (n, m) keys of each tile, those of a pixel in order of time.
    counts
        (n,) number of keys of each tile, or NOT_FINITE or NO_ROOM.
    thread
        Number of the thread that runs this.
    first, stop
        Its share of ``tiles``.
    """
    rendered = 0
    for index in range(first, stop):
        tile = tiles[index]
        own = faces[face_starts[tile] : face_starts[tile + 1]]
        stage = stage_of(textures, surfaces, frames, bodies, coefficients, clock.span_ns * 1e-9, own, scratch, thread)
        values, stack, before = scratch.values[thread], scratch.stack[thread], scratch.before[thread]
        stage.rendered[0] = 0
        counts[index] = _follow_tile(
            stage, sensor, care, clock, tile, values[: samples[tile] + 1], stack, before, keys[index]
        )
        rendered += stage.rendered[0]
    return rendered


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _follow_tile(
    stage: Stage,
    sensor: Sensor,
    care: Care,
    clock: Clock,
    tile: int,
    values: Floats,
    stack: Floats,
    references: Floats,
    keys: Integers,
) -> int:
    """Events of a tile, sampled at equal steps: how many, or why not."""
    height, width = sensor.signal.shape
    column, row = tile_origin(tile, width)
    rows, columns = min(TILE, height - row), min(TILE, width - column)
    steps = len(values) - 1
    for y in range(rows):
        for x in range(columns):
            values[0, y * columns + x] = sensor.signal[row + y, column + x]
            references[y * columns + x] = sensor.reference[row + y, column + x]
    for sample in range(1, steps + 1):
        sample_block(stage, sensor, column, row, rows, columns, sample / steps, values[sample])
    count = int(np.int64(0))  # a literal is a type of its own, for which Numba would compile the callees once more
    for pixel in range(rows * columns):
        x, y = column + pixel % columns, row + pixel // columns
        if not math.isfinite(values[:, pixel].sum()):
            sensor.signal[y, x] = math.nan
            return NOT_FINITE
        if not _is_quiet(sensor, care, x, y, values[:, pixel]):
            count = _follow_pixel(stage, sensor, care, clock, x, y, values[:, pixel], stack, keys, count)
        if count == NO_ROOM:
            for y in range(rows):
                for x in range(columns):
                    sensor.reference[row + y, column + x] = references[y * columns + x]
        if count < 0:
            return count
    for y in range(rows):
        for x in range(columns):
            sensor.signal[row + y, column + x] = values[steps, y * columns + x]
    return count


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _is_quiet(sensor: Sensor, care: Care, x: int, y: int, values: Floats) -> bool:
    """Whether a pixel is quiet all along its samples (n + 1,): most are, and need no closer look."""
    lowest, highest, bend = values[0], values[0], 0.0
    for sample in range(1, len(values)):
        lowest, highest = min(lowest, values[sample]), max(highest, values[sample])
        if sample + 1 < len(values):
            bend = max(bend, abs(values[sample - 1] - 2 * values[sample] + values[sample + 1]))
    margin = care.caution * bend / 8
    reference = sensor.reference[y, x]
    on, off = thresholds_of(sensor, x, y)
    return bool(lowest - margin > reference - off and highest + margin < reference + on)


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _follow_pixel(
    stage: Stage,
    sensor: Sensor,
    care: Care,
    clock: Clock,
    x: int,
    y: int,
    values: Floats,
    stack: Floats,
    keys: Integers,
    count: int,
) -> int:
    """Events of a pixel from its samples (n + 1,) at equal steps; how many the tile has now, or why not.

    ``stack`` holds the pieces of a step that are still to be looked at, the earliest last: share of the path, signal
    and second difference at the start, then at the stop.
    """
    on, off = thresholds_of(sensor, x, y)
    steps, finest = len(values) - 1, FINEST_S / stage.span_s
    for step in range(steps):
        _put(stack[0], step / steps, values[step], _bend(values, step))
        _put(stack[0, 3:], (step + 1) / steps, values[step + 1], _bend(values, step + 1))
        top = 0
        while top >= 0:
            start, before, bend_before, stop, after, bend_after = stack[top]
            bend = bend_before + bend_after
            margin, reference = care.caution * bend / 16, sensor.reference[y, x]
            if min(before, after) - margin > reference - off and max(before, after) + margin < reference + on:
                top -= 1
            # A signal may turn on its way where its bend is large beside its change; a bend below rounding is none.
            elif (
                abs(after - before) < care.caution * bend / 4
                and bend > _ROUNDING
                and stop - start > finest
                and top + 1 < DEEPEST
            ):
                middle = 0.5 * (start + stop)
                value = signal_at(stage, sensor, x, y, middle)
                # Over half the time a signal bends a quarter as much; at a kink it is half, but that the middle sees.
                bend = abs(before - 2 * value + after)
                _put(stack[top], middle, value, bend)
                _put(stack[top, 3:], stop, after, 0.25 * bend_after)
                top += 1
                _put(stack[top], start, before, 0.25 * bend_before)
                _put(stack[top, 3:], middle, value, bend)
            else:
                count = _fire(stage, sensor, care, clock, x, y, stack[top], keys, count)
                if count < 0:
                    return count
                top -= 1
    return count


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _put(end: Floats, share: float, signal: float, bend: float) -> None:
    end[0], end[1], end[2] = share, signal, bend


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _bend(values: Floats, sample: int) -> float:
    """Largest size of the second differences at a sample and its neighbours."""
    last = len(values) - 1
    if last < 2:
        return 0.0
    largest = 0.0
    for at in range(max(sample - 1, 1), min(sample + 1, last - 1) + 1):
        largest = max(largest, abs(values[at - 1] - 2 * values[at] + values[at + 1]))
    return largest


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _fire(
    stage: Stage,
    sensor: Sensor,
    care: Care,
    clock: Clock,
    x: int,
    y: int,
    piece: Floats,
    keys: Integers,
    count: int,
) -> int:
    """Cross every level that lies between the ends of a steep piece; each becomes the reference."""
    on, off = thresholds_of(sensor, x, y)
    start, before, stop, after = piece[0], piece[1], piece[3], piece[4]
    if not math.isfinite(after - before):
        sensor.signal[y, x] = math.nan
        return NOT_FINITE
    rising = after > before
    direction, threshold = (1.0, on) if rising else (-1.0, -off)
    level = sensor.reference[y, x] + threshold
    while (after - level) * direction >= 0.0:
        if count == len(keys):
            return NO_ROOM
        start = _crossing(stage, sensor, care, x, y, level, start, before, stop, after)
        before = level
        place = y << clock.column_bits | x
        # First tick not before the crossing, which lies after the start of the path: there the level was not reached.
        offset_ns = min(max(math.floor(start * clock.span_ns + 0.5), 1), clock.span_ns)
        timestamp = (clock.start_ns + offset_ns + clock.tick_ns - 1) // clock.tick_ns
        keys[count] = timestamp << clock.timestamp_shift | place << 1 | rising
        count += 1
        sensor.reference[y, x] = level
        level += threshold
    return count


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def _crossing(
    stage: Stage,
    sensor: Sensor,
    care: Care,
    x: int,
    y: int,
    level: float,
    start: float,
    before: float,
    stop: float,
    after: float,
) -> float:
    """Share of the path at which a signal that is steep between two shares reaches a level between.

    Secants with the Illinois correction: the weight of an end that stays twice is halved. Each is rendered, but for the
    last, which is shorter than the tolerance.
    """
    tolerance = care.tolerance_s / stage.span_s
    low, high = before - level, after - level
    stayed = 0
    for _ in range(_MOST_SECANTS):
        share = stop - high * (stop - start) / (high - low)
        if stop - start <= tolerance:
            return share
        off_level = signal_at(stage, sensor, x, y, share) - level
        # At a kink the signal is steep on one side only: the flatter counts.
        slope_before = (level + off_level - before) / max(share - start, SHORTEST)
        slope_after = (after - level - off_level) / max(stop - share, SHORTEST)
        slope = slope_before if abs(slope_before) < abs(slope_after) else slope_after
        if abs(off_level) <= abs(slope) * tolerance:
            return min(max(share - off_level / slope, start), stop) if slope != 0.0 else share
        if (off_level > 0.0) == (after > before):
            stop, after, high = share, level + off_level, off_level
            low, stayed = (0.5 * low if stayed == -1 else low), -1
        else:
            start, before, low = share, level + off_level, off_level
            high, stayed = (0.5 * high if stayed == 1 else high), 1
    return 0.5 * (start + stop)
