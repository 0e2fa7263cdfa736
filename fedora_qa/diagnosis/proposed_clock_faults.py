"""The faults of clocks, and of frames in the place of others, that a trial undoes, with sizes from the timestamps."""

from math import copysign, isclose
from typing import Final

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.clocks.span import StreamEnds
from fedora_qa.checks.depth.consistency import PairsOff
from fedora_qa.checks.event_response.timing import DelayedSegment
from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.flow_geometry.interval_timestamps import TimestampPattern
from fedora_qa.checks.images.order import OutOfOrderIntervals
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.diagnosis.clock_units import factors_of_span, unit_by_factor, units_of_brief_events
from fedora_qa.diagnosis.clocks import contradict_timestamps, delay_of, merged_clock_of
from fedora_qa.diagnosis.depth import frames_between
from fedora_qa.diagnosis.fitted_cause import Faults, FittedCause
from fedora_qa.diagnosis.image_parts import fewest_fields_off, part_of_time
from fedora_qa.diagnosis.measured_sizes import frames_lost_before
from fedora_qa.estimators.clocks.regular_clock import (
    DisplacedSegment,
    SlewedSegment,
    clock_steps,
    displaced_part,
    slewed_part,
)
from fedora_qa.faults import clocks, name_order, row_order, sorted_clock
from fedora_qa.faults.fault import RowRange
from fedora_qa.sequence.facts import StrayEvents

_ROUNDINGS: Final = 2
"""Largest change of the difference of two timestamps by rounding, in units of the timestamps: half a unit for each
timestamp, and the rounding of the period."""

_WHOLE_FRAMES: Final = 0.05
"""Largest relative difference of a fitted offset from whole frames at which these are tried. The value is not derived;
a trial more costs little."""


def _displaced_part(fit: FittedCause) -> DisplacedSegment | None:
    """Return the part of an otherwise exact clock whose timestamps were displaced; None without one."""
    clock = fit.facts.clocks.get(fit.stream)
    if clock is None or _slewed_part(fit) is not None:
        return None
    return displaced_part(clock.times_ns, resolution_ns=NS_PER_US)


def _slewed_part(fit: FittedCause) -> SlewedSegment | None:
    """Return the part in which an otherwise exact clock was slewed; None without one."""
    clock = fit.facts.clocks.get(fit.stream)
    return None if clock is None else slewed_part(clock.times_ns, resolution_ns=NS_PER_US)


def parts_of_depth(fit: FittedCause) -> list[RowRange]:
    """Return the frames in which depth may have a fault for a while: those between the pairs of frames that deviate.

    Under noise of the poses that hides the pairs they are those at which fields of flow begin that deviate.
    """
    clock = fit.facts.clocks.get("depth")
    count = 0 if clock is None else len(clock.times_ns)
    # No pair shows whether a fault ends with the last frame, or which of two first frames has it.
    of_pairs = dict.fromkeys(part for alarm in fit.alarms if (part := frames_between(alarm)))
    parts = [(0 if first == 1 else first, None if last == count - 1 else last) for first, last in of_pairs]
    while_ns = None if parts else part_of_time(fit.alarms, "depth", fit.facts)
    if clock is not None and while_ns is not None:
        first, last = (int(np.searchsorted(clock.times_ns, time_ns)) for time_ns in while_ns)
        # No field begins at the last frame.
        parts = [(first, None if last >= count - 2 else last + 1)]
    return [part for part in parts if part != (0, None)]


def _displaced_frames(fit: FittedCause) -> list[RowRange]:
    """Return the colour frames that follow each other in the place of others."""
    runs = (feature.displaced for alarm in fit.alarms for feature in alarm.statistic.features
             if isinstance(feature, OutOfOrderIntervals))  # fmt: skip
    return list(dict.fromkeys((each.first, each.stop) for each in runs if each is not None))


def _parts_of_frames(fit: FittedCause) -> list[RowRange]:
    """Return the frames of depth or colour that may have a fault for a while."""
    match fit.stream:
        case "depth":
            return parts_of_depth(fit)
        case "rgb":
            return _displaced_frames(fit)
        case _:
            return []


def _delayed_frames(fit: FittedCause) -> Faults:
    """Yield frames that hold the values of others, where the offset is one of whole frames."""
    parts, clock = _parts_of_frames(fit), fit.facts.clocks.get(fit.stream)
    if clock is None or not parts:
        return
    steps_ns = np.diff(clock.times_ns[clock.advancing])
    if not len(steps_ns):
        return
    period_ms = float(np.median(steps_ns)) / NS_PER_MS
    frames = round(fit.size / period_ms)
    if frames and isclose(frames * period_ms, fit.size, rel_tol=_WHOLE_FRAMES):
        for part in parts:
            if frames < 0 and part[1] is None:
                # Frames were lost before the part, and the timestamps of those that follow are too early.
                yield clocks.ClockShift(fit.stream, frames * period_ms * NS_PER_MS, part)
            yield row_order.DelayedFrames(frames, frames * period_ms, part, fit.stream)


def _are_mostly_off(fit: FittedCause) -> bool:
    """Whether most fields, or pairs of depth frames, deviate, as they do of frames in another order.

    Events contradict frames for many reasons: those of colour have displacements that are out of order, too.
    """
    if fit.stream == "rgb":
        return any(alarm.finding.code.startswith("images.order.") for alarm in fit.alarms)
    features = [feature for alarm in fit.alarms for feature in alarm.statistic.features]
    of_pairs = any(isinstance(each, PairsOff) and 2 * each.off > each.compared for each in features)
    return of_pairs or any(isinstance(each, FieldsOff) and 2 * each.affected_share > 1 for each in features)


def exchanged_frames(fit: FittedCause) -> Faults:
    """Yield the frames at both ends of what is out of order as exchanged, then those of a ring, then all.

    A ring that is read from another frame than the oldest moves its frames by the fitted distance, in either direction.
    Frames that were listed by names without leading zeros are in the order of text, and two makers of frames that take
    turns exchange neighbours.
    """
    streams = fit.facts.flow_streams if fit.stream == "flow" else (fit.stream,)
    clock = max(
        (fit.facts.clocks[s] for s in streams if s in fit.facts.clocks), key=lambda c: len(c.times_ns), default=None
    )
    if clock is None:
        return
    count, pairs = len(clock.times_ns), list[tuple[int, int]]()
    for place in (a.finding.where for a in fit.alarms if a.finding.code == "images.order.share"):
        if fit.stream == "rgb" and place.start_us is not None and place.stop_us is not None:
            first, last = (fit.facts.from_file_us(us) for us in (place.start_us, place.stop_us))
            pairs.append((int(np.searchsorted(clock.times_ns, first)), int(np.searchsorted(clock.times_ns, last))))
    while_ns = None if fit.stream in ("rgb", "flow") else part_of_time(fit.alarms, fit.stream, fit.facts)
    if while_ns is not None:
        first, last = while_ns
        pairs.append((int(np.searchsorted(clock.times_ns, first)), int(np.searchsorted(clock.times_ns, last))))
    for first, last in dict.fromkeys(pairs):
        if first < last < count:
            yield row_order.SwappedFrames(fit.stream, ((first, last),))
    distance = round(abs(fit.size))
    for start, stop in _parts_of_frames(fit):
        if 0 < distance < (count if stop is None else stop) - start:
            yield row_order.RotatedFrames(fit.stream, (start, stop), -distance)
            yield row_order.RotatedFrames(fit.stream, (start, stop), distance)
    if _are_mostly_off(fit):
        for first_number in (0, 1):
            by_names = name_order.FramesInOrderOfNames(fit.stream, first_number)
            if np.any(np.diff(by_names.order(count)) < 0):
                yield by_names
    # Two makers of frames that take turns, and were collected in the other order.
    yield row_order.SwappedFrames(fit.stream, tuple((row, row + 1) for row in range(0, count - 1, 2)))
    if 2 * fewest_fields_off(fit.alarms, fit.stream) > count:
        yield row_order.SwappedFrames(fit.stream, tuple((row, row + 1) for row in range(1, count - 1, 2)))


def clock_shift(fit: FittedCause) -> Faults:
    """Yield offsets: of frames that hold others, of a part of the clock, from a step on, and of the whole clock."""
    if any(isinstance(feature, StrayEvents) for alarm in fit.alarms for feature in alarm.statistic.features):
        return  # which time single events had is unknown, and all others have theirs
    if (merged := merged_clock_of(fit.stream, fit.facts)) is not None:
        yield sorted_clock.ClockSetBackAndSorted(fit.stream, merged.offset_ns, len(merged.before))
    yield from _delayed_frames(fit)
    yield from _event_clock_steps(fit)
    steps = list(_clock_steps(fit))
    yield from steps
    part = None if steps else _displaced_part(fit)
    if part is not None and not part.drift and abs(part.offset_ns) > _ROUNDINGS * NS_PER_US:
        # An offset of the whole clock would displace the timestamps that are correct. One of two roundings is as well a
        # drift of the part.
        yield clocks.ClockShift(fit.stream, part.offset_ns, (part.first, part.last + 1))
    if fit.stream == "rgb":
        for frame, lost in (frames_lost_before(alarm, fit.facts) for alarm in fit.alarms):
            period_ns = float(np.median(np.diff(fit.facts.clocks["rgb"].times_ns))) if lost else 0.0
            for count in lost:
                yield clocks.ClockShift("rgb", -count * period_ns, (frame, None))
    yield from _varying_shift(fit)
    offset_ns = fit.size * NS_PER_MS
    yield clocks.ClockShift(fit.stream, offset_ns)
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    depth = fit.facts.clocks.get("depth")
    if depth is not None and any(isinstance(feature, TimestampPattern) for feature in features):
        # The offset from the nearest frame is known up to the step of the frames.
        steps_ns = np.diff(depth.times_ns[depth.advancing])
        if len(steps_ns):
            yield clocks.ClockShift(fit.stream, offset_ns - copysign(float(np.median(steps_ns)), offset_ns))


def _clock_steps(fit: FittedCause) -> Faults:
    """Yield the steps of a sampled clock: rows behind one are late, or those before it are early.

    A step of whole periods is the gap that lost samples leave. It is a step of the clock only if a finding beside the
    gap contradicts the timestamps, because nothing else contradicts those beside lost samples.
    """
    clock = fit.facts.clocks.get(fit.stream)
    if clock is None or _slewed_part(fit) is not None:
        return
    steps = clock_steps(clock.times_ns, resolution_ns=NS_PER_US)
    codes = {alarm.finding.code for alarm in fit.alarms}
    if not steps or ("clocks.gaps.jump" not in codes and not contradict_timestamps(codes, fit.family)):
        return
    first, *others = steps
    if not others:
        yield clocks.ClockShift(fit.stream, first.offset_ns, (first.row, None))
        yield clocks.ClockShift(fit.stream, -first.offset_ns, (0, first.row))
    elif abs(first.offset_ns + others[0].offset_ns) <= 2 * _ROUNDINGS * NS_PER_US:
        # Set, and set back.
        yield clocks.ClockShift(fit.stream, first.offset_ns, (first.row, others[0].row))


def _event_clock_steps(fit: FittedCause) -> Faults:
    """Yield the steps of the clock of the events: by an interval without events, then as the delay over time has them.

    Lost events leave such an interval as well, and no delay.
    """
    codes = {alarm.finding.code for alarm in fit.alarms}
    if fit.stream != "events" or not contradict_timestamps(codes, "events"):
        return
    for alarm in fit.alarms:
        place = alarm.finding.where
        if alarm.finding.code == "event_stream.gaps.silence" and None not in (place.start_us, place.stop_us):
            last_ns, next_ns = (fit.facts.from_file_us(us or 0.0) for us in (place.start_us, place.stop_us))
            length_ns = round(alarm.statistic.value * NS_PER_MS)
            # Events behind are late, so that the next one belongs where the silence began; or those before are early.
            yield clocks.ClockShift("events", length_ns, while_ns=(next_ns - length_ns, None))
            yield clocks.ClockShift("events", -length_ns, while_ns=(None, last_ns + length_ns + 1))
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for part in dict.fromkeys(feature for feature in features if isinstance(feature, DelayedSegment)):
        yield clocks.ClockShift("events", part.offset_ms * NS_PER_MS, while_ns=(part.begin_ns, part.end_ns))


def _varying_shift(fit: FittedCause) -> Faults:
    """Yield the regular clock of a stream whose timestamps are late by times of their own, as those of a recorder."""
    if (delay := delay_of(fit.stream, fit.facts)) is not None:
        yield clocks.ClockShift(fit.stream, delay.offset_ns, regular_ns=(delay.start_ns, delay.period_ns))


def clock_rate(fit: FittedCause) -> Faults:
    """Yield rates: of a part that was slewed or displaced, and of the whole clock about its begin or its middle."""
    slewed = _slewed_part(fit)
    if slewed is not None:
        # Undone in the whole file, the rate would displace the timestamps before and after.
        yield clocks.ClockRate(fit.stream, 1e6 * slewed.drift, slewed.start_ns, duration_ns=slewed.duration_ns)
    part = _displaced_part(fit)
    if part is not None and part.drift:
        times_ns = fit.facts.clocks[fit.stream].times_ns
        # The clock leaves its line before rounding shows it: where the line through the offsets of the part is 0.
        beginning_ns = times_ns[(part.first + part.last) // 2] - part.offset_ns / part.drift
        start_ns = round(float(np.clip(beginning_ns, times_ns[0], times_ns[part.first])))
        rows = int(np.searchsorted(times_ns[: part.first], start_ns)), part.last + 1
        yield clocks.ClockRate(fit.stream, 1e6 * part.drift, start_ns, rows)
    clock = fit.facts.clocks.get(fit.stream)
    first_ns = last_ns = 0
    if fit.stream == "events" and fit.facts.events is not None:
        first_ns, last_ns = fit.facts.events.first_ns, fit.facts.events.last_ns
    elif clock is not None and len(clock.times_ns):
        first_ns, last_ns = int(clock.times_ns[0]), int(clock.times_ns[-1])
    # A clock is set at its first timestamp, or its mean error is taken out.
    yield clocks.ClockRate(fit.stream, fit.size, first_ns)
    yield clocks.ClockRate(fit.stream, fit.size, (first_ns + last_ns) // 2)


def time_units(fit: FittedCause) -> Faults:
    """Yield units of time: the fitted one first, then those by which a span is longer or shorter than the others."""
    factors: dict[float, clocks.TimeUnit] = {}
    for alarm in fit.alarms:
        stream = alarm.finding.where.stream or ""
        for ends in (feature for feature in alarm.statistic.features if isinstance(feature, StreamEnds)):
            if stream in (fit.stream, *fit.facts.flow_streams) and stream_family(stream) == fit.family:
                for factor in factors_of_span(stream, ends, fit.facts):
                    own = unit_by_factor(stream, factor, ends, fit.facts)
                    factors.setdefault(factor, own if stream == fit.stream else clocks.TimeUnit(fit.stream, factor))
    units = units_of_brief_events(fit.facts) if fit.stream == "events" else ()
    if units and units[0].factor == fit.size:
        yield from units
        return
    yield factors.pop(fit.size, clocks.TimeUnit(fit.stream, fit.size))
    yield from factors.values()
