"""The intervals of flow against the timestamps of the frames at their start and end.

Timestamps may differ from the frames by a constant, by a drift, or by a grid. Each pattern is fitted to the offsets of
the timestamps from their nearest frames; the share of the offset that it removes is a feature.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Statistic
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, Facts, has_place

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

_NEXT_FRAME: Final = 0.75
"""Largest distance from a timestamp's own frame, in frame steps: distances from the nearest of all frames are at most
half a step."""

_ROUNDING_NS: Final = 1_000
"""Timestamps are whole microseconds: a difference of two rounded ones has an error of at most one."""

_FEWEST_ON_A_GRID: Final = 3
"""Least number of instants for a common divisor of their steps."""

_UNITS: Final = (1e-6, 1e-3, 1e3, 1e6)
_SAME_UNIT: Final = 0.02

_FEWEST_PAUSES: Final = 2
"""Least number of pauses between fields that can be usual. A single one is a gap."""

_ROUNDED: Final = 0.01
"""Difference from whole intervals by which a usual pause may deviate: lengths that are rounded to a microsecond do so
by 1e-4 at 50 Hz."""


@dataclass(frozen=True, slots=True)
class FlowRatesCounted(Feature):
    """Rates with intervals that a statistic counts.

    Attributes
    ----------
    counted
        Whether each rate has such intervals.
    """

    counted: Mapping[str, bool]


@dataclass(frozen=True, slots=True)
class IntervalsOffFrames(Feature):
    """Relation of the deviating intervals to the frames.

    Attributes
    ----------
    beyond_all_frames
        Whether all of them begin before the first depth frame or end after the last.
    at_missing_frame
        Whether their ends are so far from the nearest depth frame that their own frame is missing.
    on_colour_frames
        Whether all of their ends are timestamps of colour frames.
    """

    beyond_all_frames: bool
    at_missing_frame: bool = False
    on_colour_frames: bool = False


@dataclass(frozen=True, slots=True)
class TimestampPattern(Feature):
    """A pattern of the differences of timestamps from frames.

    Attributes
    ----------
    pattern
        ``constant``, ``drift``, ``grid`` or ``unit``.
    magnitude
        Offset in ms, rate in ppm, grid in ms, factor of the unit; positive where the timestamps are too late.
    removed_share
        Share of the rms offset that the pattern removes, 0 to 1.
    stream
        The stream whose timestamps deviate.
    """

    pattern: str
    magnitude: float
    removed_share: float
    stream: str = ""


@dataclass(frozen=True, slots=True)
class IntervalOrder(Feature):
    """Order of the intervals of one rate.

    Attributes
    ----------
    gaps, overlaps
        Numbers of gaps and of overlaps between sorted intervals.
    moved
        Number of rows that sorting moves.
    """

    gaps: int
    overlaps: int
    moved: int


@dataclass(frozen=True, slots=True)
class IntervalLengths(Feature):
    """Lengths of intervals that differ from the length in the stream's name.

    Attributes
    ----------
    median_ns
        Their median, ns.
    """

    median_ns: float


def timestamp_statistics(facts: Facts) -> list[Statistic]:
    """Count, for each rate, intervals that lie on no depth frames, gaps, and intervals of wrong length."""
    statistics: list[Statistic] = []
    instants_ns = _frame_instants(facts)
    for stream in facts.flow_streams:
        clock, frames = facts.clocks[stream], facts.clocks["depth"]
        if clock.ends_ns is None or not len(clock.times_ns):
            continue
        # Timestamps without a place in time are counted by integrity.finite.
        placed = has_place(clock.times_ns) & has_place(clock.ends_ns)
        on_frames = np.isin(clock.times_ns, instants_ns) & np.isin(clock.ends_ns, instants_ns)
        off_frames = np.flatnonzero(~on_frames & placed)
        if not has_place(frames.times_ns).all():
            off_frames = off_frames[~_is_at_lost_frame(frames, clock.times_ns[off_frames], clock.ends_ns[off_frames])]
        lengths_ns = clock.ends_ns - clock.times_ns
        # Intervals of one rate abut (format.md, Instants): compared as integers, without a tolerance.
        pauses_ns = clock.times_ns[1:] - clock.ends_ns[:-1]
        gaps = np.flatnonzero(pauses_ns != 0) + 1
        if _is_sparse(pauses_ns, lengths_ns):
            # Pauses end on frames: one that is not the usual one differs by a whole frame step.
            gaps = np.flatnonzero(np.abs(pauses_ns - np.median(pauses_ns)) > _frame_step_ns(frames) / 2) + 1
        gaps = gaps[placed[gaps - 1] & placed[gaps]]
        nominal_ns = NS_PER_S / flow_rate_hz(stream)
        # Intervals end on frames: a wrong length is wrong by a whole frame step.
        wrong_length = np.flatnonzero((np.abs(lengths_ns - nominal_ns) > _frame_step_ns(frames) / 2) & placed)

        of_frames = _features_off_frames(facts, stream, clock, clock.ends_ns, off_frames)
        of_gaps = of_frames
        # Steps of less than half an interval are timestamps that left their frames; larger ones are missing intervals,
        # doubled ones, or another order, which sorting separates.
        if len(gaps) and 2 * np.abs(clock.times_ns[gaps] - clock.ends_ns[gaps - 1]).max() >= np.median(lengths_ns):
            order = np.argsort(clock.times_ns, kind="stable")
            steps_ns = clock.times_ns[order][1:] - clock.ends_ns[order][:-1]
            of_gaps = (
                IntervalOrder(
                    gaps=int(np.count_nonzero(steps_ns > 0)),
                    overlaps=int(np.count_nonzero(steps_ns < 0)),
                    moved=int(np.count_nonzero(order != np.arange(len(order)))),
                ),
                *of_frames,
            )
        of_lengths = of_frames
        if len(wrong_length):
            of_lengths = (IntervalLengths(float(np.median(lengths_ns[wrong_length]))), *of_frames)
        duration = f"do not last {nominal_ns / NS_PER_MS:g} ms"
        statistics += [
            _count(facts, stream, "off_frames", off_frames, "start or end on no depth frame", of_frames),
            _count(facts, stream, "not_abutting", gaps, "do not begin where the one before them ends", of_gaps),
            _count(facts, stream, "wrong_length", wrong_length, duration, of_lengths),
        ]
    counted = {
        code: FlowRatesCounted({str(s.where.stream): s.value > 0 for s in statistics if s.code == code})
        for code in {statistic.code for statistic in statistics}
    }
    return [replace(s, features=(counted[s.code], *s.features)) if s.features else s for s in statistics]


def _count(facts: Facts, stream: str, rule: str, rows: Rows, text: str, features: Sequence[Feature]) -> Statistic:
    clock = facts.clocks[stream]
    where = Where(stream=stream)
    if len(rows):
        first, last = int(rows[0]), int(rows[-1])
        start_us, stop_us = (facts.to_file_us(float(clock.times_ns[row])) for row in (first, last))
        where = Where(stream, start_us, stop_us, index_start=first, index_stop=last + 1)
    return Statistic(
        name=f"{stream} intervals_{rule}",
        value=float(len(rows)),
        unit="intervals",
        standard_error=0.0,
        resolution=1.0,
        side="upper",
        statement=f"{len(rows)} of {len(clock.times_ns)} intervals of {stream} {text}.",
        code=f"flow_geometry.validity.{rule}",
        where=where,
        features=tuple(features) if len(rows) else (),
    )


def _is_sparse(pauses_ns: Int64, lengths_ns: Int64) -> bool:
    """Whether flow is given for each second or third interval alone, so that most pauses last whole intervals."""
    if len(pauses_ns) < _FEWEST_PAUSES:
        return False
    intervals = float(np.median(pauses_ns)) / max(float(np.median(lengths_ns)), 1.0)
    return intervals > _ROUNDED and abs(intervals - round(intervals)) <= _ROUNDED


def _frame_instants(facts: Facts) -> Int64:
    """Return the instants at which flow may start and end, ns: depth frames, and colour frames where depth is sparse.

    Depth is sparse where all of its frames are colour frames, or ends of flow where there is no colour: it then has a
    lower rate, begins later or ends earlier. Depth frames that are no colour frames do
    not make flow on other timestamps correct.
    """
    depth_ns, rgb = facts.clocks["depth"].times_ns, facts.clocks.get("rgb")
    depth_ns = depth_ns[has_place(depth_ns)]
    others_ns = np.empty(0, np.int64) if rgb is None else rgb.times_ns
    if not len(others_ns):
        clocks = [facts.clocks[stream] for stream in facts.flow_streams]
        ends_ns = [clock.ends_ns for clock in clocks if clock.ends_ns is not None]
        others_ns = np.concatenate([*(clock.times_ns for clock in clocks), *ends_ns])
    is_sparse = bool(np.isin(depth_ns, others_ns).all())
    return np.union1d(depth_ns, others_ns) if is_sparse else depth_ns


def _is_at_lost_frame(frames: Clock, *instants_ns: Int64) -> Mask:
    """Return the intervals (n,) that start or end farther from all frames than from one that has no place in time."""
    placed_ns, reach_ns = frames.times_ns[has_place(frames.times_ns)], _NEXT_FRAME * _frame_step_ns(frames)
    if not len(placed_ns):
        return np.ones(len(instants_ns[0]), np.bool_)
    is_far: Mask = np.zeros(len(instants_ns[0]), np.bool_)
    for ends_ns in instants_ns:
        is_far |= np.abs(offsets_from_nearest(placed_ns, ends_ns)) > reach_ns
    return is_far


def _on(frames: Clock, times_ns: Int64) -> Mask:
    return np.isin(times_ns, frames.times_ns)


def _frame_step_ns(frames: Clock) -> float:
    steps_ns = np.diff(frames.times_ns[frames.advancing])
    return float(np.median(steps_ns)) if len(steps_ns) else float(NS_PER_S)


def _features_off_frames(facts: Facts, stream: str, clock: Clock, ends_ns: Int64, off: Rows) -> tuple[Feature, ...]:
    """Return the pattern by which timestamps differ from depth frames, and whether they lie on colour frames."""
    if not len(off):
        return ()
    depth = facts.clocks["depth"]
    if len(depth.times_ns):
        before, after = clock.times_ns[off] < depth.times_ns.min(), ends_ns[off] > depth.times_ns.max()
        if np.all(before | after):
            return (IntervalsOffFrames(beyond_all_frames=True),)
    frames_ns = depth.times_ns[depth.advancing]
    # Each instant once: where intervals abut, the end of one is the start of the next.
    instants_ns = np.unique(np.concatenate((clock.times_ns[off], ends_ns[off])))
    of_flow = _patterns_of(stream, instants_ns, frames_ns)
    far_ns = np.abs(offsets_from_nearest(frames_ns, instants_ns[~_on(depth, instants_ns)]))
    if np.median(far_ns) > _NEXT_FRAME * _frame_step_ns(depth):
        return (IntervalsOffFrames(beyond_all_frames=False, at_missing_frame=True), *of_flow)
    rgb = facts.clocks.get("rgb")
    if rgb is not None and _on(rgb, instants_ns).all():
        # Flow lies on the colour frames: the depth frames that do not are the ones with wrong timestamps.
        without_colour = np.flatnonzero(~_on(rgb, frames_ns))
        of_depth: tuple[Feature, ...] = ()
        if len(without_colour):
            left_ns = frames_ns[without_colour[0] : without_colour[-1] + 1]
            of_depth = _patterns_of("depth", left_ns, rgb.times_ns[rgb.advancing])
        return (IntervalsOffFrames(beyond_all_frames=False, on_colour_frames=True), *of_depth, *of_flow)
    return (IntervalsOffFrames(beyond_all_frames=False), *of_flow, *_patterns_of("depth", frames_ns, instants_ns))


def _patterns_of(stream: str, instants_ns: Int64, frames_ns: Int64) -> tuple[Feature, ...]:
    return tuple(replace(pattern, stream=stream) for pattern in timestamp_patterns(instants_ns, frames_ns))


def timestamp_patterns(instants_ns: Int64, frames_ns: Int64) -> tuple[TimestampPattern, ...]:
    """Fit each pattern to the offsets of instants from their frames.

    Offsets are modulo the frame step. Where several patterns remove all but the rounding of timestamps, the one
    with the fewest numbers comes first.

    Parameters
    ----------
    instants_ns
        (n,) ns from the file's origin, n at least 1.
    frames_ns
        (m,) ns from the file's origin, m at least 1.

    Returns
    -------
    tuple
        Best first; only another unit, or nothing, where the instants lie beyond all frames.
    """
    offsets_ns = offsets_from_nearest(frames_ns, instants_ns)
    steps_ns = np.diff(np.sort(frames_ns))
    step_ns = float(np.median(steps_ns)) if len(steps_ns) else np.inf
    instant_steps_ns = np.diff(np.unique(instants_ns))
    if np.median(np.abs(offsets_ns)) > step_ns:
        # At such distances no offset is measured; steps that differ by a factor of 1000 or 1e6 are in another unit.
        ratio = float(np.median(instant_steps_ns)) / step_ns if len(instant_steps_ns) else 0.0
        unit = next((unit for unit in _UNITS if abs(ratio / unit - 1) < _SAME_UNIT), None)
        return () if unit is None else (TimestampPattern("unit", unit, 1.0),)
    # The few instants whose nearest frame is not their own do not change a median.
    middle_ns = float(np.median(offsets_ns))
    constant = ("constant", middle_ns / NS_PER_MS, offsets_ns - middle_ns)
    # A line through the offsets: its slope is the median of steps, so that a step across a frame does not count.
    order = np.argsort(instants_ns, kind="stable")
    runs_ns, rises_ns = np.diff(instants_ns[order]), np.diff(offsets_ns[order])
    advancing = runs_ns > 0
    slope = float(np.median(rises_ns[advancing] / runs_ns[advancing])) if advancing.any() else 0.0
    detrended_ns = offsets_ns - slope * (instants_ns - instants_ns.min())
    drift = ("drift", 1e6 * slope, detrended_ns - np.median(detrended_ns))
    # A grid of the instants explains offsets of up to half of it.
    grid_ns = int(np.gcd.reduce(instant_steps_ns)) if len(instant_steps_ns) >= _FEWEST_ON_A_GRID - 1 else 0
    # A grid of up to two roundings is the unit of the timestamps. Instants whole frame steps apart keep the distances
    # of their frames, which no rounding has moved against each other. Neither explains anything.
    explains = grid_ns > 2 * _ROUNDING_NS and not (np.isfinite(step_ns) and _is_multiple(grid_ns, step_ns))
    grid = ("grid", grid_ns / NS_PER_MS, np.maximum(np.abs(offsets_ns) - grid_ns / 2, 0.0))

    rms_ns = _rms(offsets_ns)
    patterns = []
    # A drift of 0 is that of a constant offset.
    for name, magnitude, residual_ns in (constant, *((drift,) if slope else ()), *((grid,) if explains else ())):
        remaining_ns = np.abs(residual_ns)
        # Offsets are known modulo the frame step: what remains is the distance to its nearest multiple.
        if np.isfinite(step_ns):
            remaining_ns = np.minimum(remaining_ns % step_ns, -remaining_ns % step_ns)
        remaining = _rms(np.maximum(remaining_ns - _ROUNDING_NS, 0.0))
        removed_share = max(1.0 - remaining / rms_ns, 0.0) if rms_ns > 0 else 0.0
        patterns.append(TimestampPattern(name, magnitude, removed_share))
    # A stable sort of shares rounded to 0.01: of equal ones the pattern with fewer numbers stays first.
    return tuple(sorted(patterns, key=lambda pattern: -round(pattern.removed_share, 2)))


def offsets_from_nearest(frames_ns: Int64, instants_ns: Int64) -> Float64:
    """Return the difference of each instant from the nearest frame.

    Parameters
    ----------
    frames_ns
        (m,) ns from the file's origin, in any order, m at least 1.
    instants_ns
        (n,) ns from the file's origin, in any order.

    Returns
    -------
    ndarray of float64
        (n,) ns; positive where the instant is later.
    """
    ordered = np.sort(frames_ns)
    after = np.clip(np.searchsorted(ordered, instants_ns), 1, max(len(ordered) - 1, 1))
    neighbours_ns = np.stack((ordered[after - 1], ordered[np.minimum(after, len(ordered) - 1)]))
    offsets = (instants_ns - neighbours_ns).astype(np.float64)
    nearest: Float64 = np.where(np.abs(offsets[0]) <= np.abs(offsets[1]), offsets[0], offsets[1])
    return nearest


def _is_multiple(grid_ns: int, step_ns: float) -> bool:
    """Whether a grid is a whole number of frame steps, which are known to a rounding."""
    return abs(grid_ns - round(grid_ns / step_ns) * step_ns) <= _ROUNDING_NS


def _rms(values_ns: Float64) -> float:
    return float(np.sqrt(np.mean(values_ns**2)))
