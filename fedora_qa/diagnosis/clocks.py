"""Hypotheses for alarms of the checks of clocks and of index maps, whose entries follow the timestamps."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import sqrt
from typing import Final

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.clocks.gaps import ClockJump, DisorderedTimestamps
from fedora_qa.checks.clocks.order import CounterWrap, RoundedRepeats
from fedora_qa.checks.clocks.rate import RoundedClock, SegmentRate
from fedora_qa.checks.clocks.resolution import PartialGrid
from fedora_qa.checks.clocks.span import CutOfSeveralRates, FewSamples, StreamEnds
from fedora_qa.checks.clocks.streams import ClockSetBack, PartInOtherUnit, durations_ns, reference_duration_ns
from fedora_qa.checks.index_maps.frame_to_event import MapRule, WrongEntries
from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.diagnosis.clock_units import factors_of_span, is_tick_factor
from fedora_qa.diagnosis.hypothesis import Hypothesis, only_feature, support
from fedora_qa.estimators.clocks.merged_clock import MergedClock, merged_clock
from fedora_qa.estimators.clocks.regular_clock import FEWEST_TIMESTAMPS, VaryingDelay, clock_steps, varying_delay
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import FRAMES_OF_MAP
from fedora_qa.sequence.facts import Facts, StrayEvents
from fedora_qa.views.clock_resets import ClockReset, tick_factor, unit_factor

_NOMINAL: Final = 1e-4
"""Largest relative error of the rate of a clock that has a whole number of Hz: quartz keeps its rate to 1e-4."""

_SAME_STRETCH: Final = 0.02
"""Largest relative difference of a period from a stretched nominal one. A stream ends up to a period of its own and one
of the others before the recording, which is 2% of a second at 100 Hz. The value is not derived."""

_ROUNDINGS: Final = 2
"""Largest difference of the offsets of both ends by rounding, us: each is the difference of two timestamps."""

_MOSTLY_ZERO: Final = 0.9
"""Least ratio of wrong entries for a map of zeros that was not only cut short."""


_SAMPLED_ALONE: Final = frozenset({"imu", "pose", "rgb", "depth"})
"""Streams whose samples have timestamps of their own, and hold what other streams hold at these times."""

_FEWEST_OTHERS: Final = 2
"""Streams that show when a regular clock began: of two, none is the clock itself."""


def delay_of(stream: str, facts: Facts) -> VaryingDelay | None:
    """Return the delay of a sampled stream that varies, as that of a recorder does, where the others began together."""
    clock = facts.clocks.get(stream)
    family = stream_family(stream)
    others = [o.times_ns for name, o in facts.clocks.items() if stream_family(name) != family and o.usable]
    if clock is None or clock.ends_ns is not None or len(others) < _FEWEST_OTHERS or not clock.advancing.all():
        return None
    start_ns = float(np.median([times_ns[0] for times_ns in others if len(times_ns)]))
    return varying_delay(clock.times_ns, start_ns, resolution_ns=NS_PER_US)


def merged_clock_of(stream: str, facts: Facts) -> MergedClock | None:
    """Return the parts of the clock of IMU or poses that was set back, and whose samples were sorted; else None."""
    clock = facts.clocks.get(stream) if stream in ("imu", "pose") else None
    return None if clock is None else merged_clock(clock.times_ns, resolution_ns=NS_PER_US)


def contradict_timestamps(codes: Iterable[str], family: str) -> bool:
    """Whether findings, by their codes, compare what samples of a stream hold with other streams."""
    checks = {
        "imu": ("imu.",),
        "pose": ("imu.", "flow_geometry.", "depth."),
        "depth": ("depth.", "flow_geometry."),
        "flow": ("flow_geometry.", "flow_photometric."),
    }.get(family, ("event_response.", "flow_photometric."))
    return any(code.startswith(checks) for code in codes)


def of_varying_delays(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the offset of clocks that leave their regular times for a while, where content contradicts timestamps.

    Correct clocks do not: what such samples hold is late by as much, whatever else explains it. Nor do those that were
    set back, of which samples before and behind that have taken turns since they were sorted.
    """
    hypotheses = []
    for stream in facts.clocks:
        if contradict_timestamps((alarm.finding.code,), stream_family(stream)):
            delay = delay_of(stream, facts)
            if delay is not None and delay.returns:
                late_ms = delay.offset_ns / NS_PER_MS
                hypotheses.append(Hypothesis("time_offset", stream, support("clocks.late_for_a_while"), late_ms, "ms"))
            if (merged := merged_clock_of(stream, facts)) is not None:
                back_ms = merged.offset_ns / NS_PER_MS
                hypotheses.append(
                    Hypothesis("time_offset", stream, support("clocks.set_back_and_sorted"), back_ms, "ms")
                )
    return tuple(hypotheses)


def hypotheses_of_reset(reset: ClockReset) -> tuple[Hypothesis, ...]:
    """Return the causes of a clock reset of the events: another unit, an offset, or another rate."""
    if reset.unit_factor != 1.0:
        return (Hypothesis("time_unit", "events", support("clocks.reset_by_unit"), reset.unit_factor, "1"),)
    # Without a step forwards neither size is measured, and none has a unit.
    sized = reset.forwards is not None
    offset = Hypothesis(
        "time_offset",
        "events",
        reset.offset_agreement,
        reset.offset_ms,
        "ms" if sized else "",
        reset.offset_error_ms,
    )
    drift = Hypothesis("clock_rate", "events", reset.drift_agreement, reset.drift_ppm, "ppm" if sized else "")
    # Best supported first, as for every proposal.
    return (drift, offset) if reset.drift_agreement >= reset.offset_agreement else (offset, drift)


def propose_order(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of timestamps that are before, or equal to, their predecessors."""
    statistic, stream = alarm.statistic, alarm.finding.where.stream or ""
    if alarm.finding.code == "clocks.order.repeated_stamps":
        twice = Hypothesis("duplicated_samples", stream, support("clocks.repeats"), statistic.value, "samples")
        # A grid coarser than the period gives neighbouring samples one timestamp, without a sample written twice.
        rounded = tuple(
            Hypothesis("quantised_time", stream, support("clocks.rounded_repeats"), feature.grid_ms, "ms")
            for feature in statistic.features
            if isinstance(feature, RoundedRepeats)
        )
        return *rounded, twice
    hypotheses: list[Hypothesis] = []
    if stream == "events":
        unsorted = support("clocks.event_steps_back")
        for feature in statistic.features:
            if isinstance(feature, CounterWrap):
                hypotheses.append(Hypothesis("time_unit", stream, support("clocks.event_counter_wrap")))
            elif isinstance(feature, ClockReset):
                hypotheses += hypotheses_of_reset(feature)
                # The reset explains the step back, so an exchange of events is less probable.
                unsorted = support("clocks.event_steps_back_of_reset")
        return (
            *hypotheses,
            Hypothesis("unsorted", stream, unsorted, statistic.value, "events"),
            Hypothesis("quantised_time", stream, support("clocks.event_steps_back_of_rounding")),
        )
    for feature in statistic.features:
        if isinstance(feature, PartInOtherUnit):
            hypotheses.append(_of_part(stream, feature))
        elif isinstance(feature, CounterWrap):
            hypotheses.append(Hypothesis("time_unit", stream, support("clocks.counter_wrap")))
        elif isinstance(feature, ClockSetBack):
            hypotheses += (_of_set_back(stream, feature), *_of_overlap(stream, facts))
    return *hypotheses, Hypothesis("unsorted", stream, support("clocks.steps_back"), statistic.value, "samples")


def propose_unit(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return another unit as the cause of wrong timestamps of a stream or of a part of it, or another rate."""
    stream = alarm.finding.where.stream or ""
    if alarm.finding.code == "clocks.unit.factor":
        durations = durations_ns(facts)
        median_ns = reference_duration_ns(facts, durations)
        if median_ns is not None and stream in durations:
            ends = StreamEnds(0.0, median_ns - durations[stream], median_ns)
            stretched = _of_stretched_clock(stream, ends, facts)
            if stretched is not None and not _is_stretched_by(alarm.statistic.value, ends):
                return (stretched,)
    return (Hypothesis("time_unit", stream, support("clocks.unit_factor"), alarm.statistic.value, "1"),)


def propose_rate(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a wrong fitted period: another rate, or rounding."""
    statistic, stream = alarm.statistic, alarm.finding.where.stream or ""
    delay = delay_of(stream, facts)
    if delay is not None and abs(delay.offset_ns) > delay.range_ns:
        late, late_ms = support("clocks.late_by_varying_times"), delay.offset_ns / NS_PER_MS
        trend = Hypothesis("clock_rate", stream, support("clocks.rate_of_a_late_clock"), statistic.value, "ppm")
        return Hypothesis("time_offset", stream, late, late_ms, "ms"), trend
    for feature in statistic.features:
        if isinstance(feature, SegmentRate):
            supported = support("clocks.rate_of_a_part")
            return (Hypothesis("clock_rate", stream, supported, feature.rate_ppm, "ppm", feature.rounding_ppm),)
    rounded = (
        Hypothesis("quantised_time", stream, support("clocks.rounded_period"), feature.grid_ms, "ms")
        for feature in statistic.features
        if isinstance(feature, RoundedClock)
    )
    return Hypothesis("clock_rate", stream, support("clocks.rate"), statistic.value, "ppm"), *rounded


def propose_gaps(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of gaps and irregular steps: lost samples, samples in wrong order, or a clock reset."""
    statistic, stream = alarm.statistic, alarm.finding.where.stream or ""
    for feature in statistic.features:
        if isinstance(feature, ClockJump):
            supported = support("clocks.jump")
            return (Hypothesis("time_offset", stream, supported, feature.offset_ms, "ms", feature.rounding_ms),)
    lost = Hypothesis("dropped_samples", stream, support("clocks.gap"), statistic.value, "samples")
    for feature in statistic.features:
        if isinstance(feature, ClockSetBack):
            unsorted = Hypothesis("unsorted", stream, support("clocks.gap_by_order_of_reset"))
            return _of_set_back(stream, feature), unsorted, lost
    if any(isinstance(feature, DisorderedTimestamps) for feature in statistic.features):
        return (
            Hypothesis("unsorted", stream, support("clocks.gap_by_order")),
            Hypothesis("time_offset", stream, support("clocks.gap_by_offset")),
            lost,
        )
    clock = facts.clocks.get(stream)
    steps = () if clock is None else clock_steps(clock.times_ns, resolution_ns=NS_PER_US)
    if len(steps) == 1:
        # A clock that was set by whole periods leaves the gap of lost samples. Other checks distinguish them.
        set_ms = steps[0].offset_ns / NS_PER_MS
        return lost, Hypothesis("time_offset", stream, support("clocks.gap_of_step"), set_ms, "ms")
    return (lost,)


def propose_resolution(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of timestamps on a grid: rounding, or another unit of a part."""
    statistic, stream = alarm.statistic, alarm.finding.where.stream or ""
    grids = [feature for feature in statistic.features if isinstance(feature, PartialGrid)]
    if not grids:
        # The statistic is in us, the cause in ms.
        grid_ms = statistic.value / 1e3
        return (Hypothesis("quantised_time", stream, support("clocks.grid"), grid_ms, "ms"),)
    grid = grids[0]
    # Whole ticks of another unit are multiples in the right one: a comb of exactly the factor follows from the unit.
    of_reset = (
        hypothesis
        for feature in statistic.features
        if isinstance(feature, ClockReset) and feature.unit_factor != 1.0
        for hypothesis in hypotheses_of_reset(feature)
        if hypothesis.magnitude == grid.step_us / grid.tick_us
    )
    return *of_reset, Hypothesis("quantised_time", stream, support("clocks.grid"), grid.step_us / 1e3, "ms")


def propose_span(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a wrong start or end of a stream: an offset, another unit, or a cut."""
    statistic, stream = alarm.statistic, alarm.finding.where.stream or ""
    hypotheses: list[Hypothesis] = []
    for feature in statistic.features:
        if isinstance(feature, PartInOtherUnit):
            hypotheses.append(_of_part(stream, feature))
        if isinstance(feature, StrayEvents):
            stray = support("clocks.stray_events")
            hypotheses.append(Hypothesis("time_offset", stream, stray, feature.distance_ns / NS_PER_MS, "ms"))
        if isinstance(feature, FewSamples):
            lost = support("clocks.few_samples")
            if not feature.samples:
                hypotheses.append(Hypothesis("missing_stream", stream, lost))
            elif feature.uncovered_ratio > 1 / 2:
                hypotheses.append(Hypothesis("truncated", stream, lost, 100 * feature.uncovered_ratio, "percent"))
            else:
                hypotheses.append(Hypothesis("dropped_samples", stream, lost, statistic.value, "samples"))
    for feature in statistic.features:
        if isinstance(feature, StreamEnds):
            has_unit = any(hypothesis.cause == "time_unit" for hypothesis in hypotheses)
            hypotheses.extend(_of_ends(stream, feature, facts, has_unit=has_unit))
    if any(isinstance(feature, CutOfSeveralRates) for feature in statistic.features):
        return tuple(replace(hypothesis, stream=stream_family(hypothesis.stream)) for hypothesis in hypotheses)
    return tuple(hypotheses)


def _of_ends(stream: str, ends: StreamEnds, facts: Facts, *, has_unit: bool) -> tuple[Hypothesis, ...]:
    """Return the causes of a stream that begins or ends elsewhere than the others, of which a part may have a unit."""
    if ends.is_shift:
        shifted, offset_ms = support("clocks.shifted_span"), ends.shift_ns / NS_PER_MS
        return (Hypothesis("time_offset", stream, shifted, offset_ms, "ms", _error_of_shift_ms(ends)),)
    hypotheses: list[Hypothesis] = []
    # Streams of one sample each have a median duration of 0 ns.
    duration_ns = max(ends.median_duration_ns, 1.0)
    # Ratio of the duration to the median duration of the streams: near the factor of a unit the cause is the unit,
    # not a cut.
    ratio = 1 - ends.missing_ns / duration_ns
    is_longer = ends.missing_ns < 0
    stretched = _of_stretched_clock(stream, ends, facts) if is_longer else None
    may_be_fast = not is_longer and ends.median_duration_ns > 0
    for factor, row in ((unit_factor(ratio), "span_in_other_unit"), (tick_factor(ratio), "span_in_ticks")):
        if factor != 1.0 and (stretched is None or _is_stretched_by(factor, ends)):
            hypotheses.append(Hypothesis("time_unit", stream, support(f"clocks.{row}"), factor, "1"))
    is_of_unit = has_unit or bool(hypotheses)
    factors = () if is_of_unit else factors_of_span(stream, ends, facts)
    # A stretched clock of a nominal rate has another rate, unless the factor is that of a unit or a counter.
    if stretched is not None and not is_of_unit and not (factors and is_tick_factor(factors[0])):
        hypotheses.append(stretched)
        factors = ()
    cut_percent = 100 * ends.missing_ns / duration_ns
    hypotheses.append(Hypothesis("truncated", stream, support("clocks.cut_span"), cut_percent, "percent"))
    if factors and not is_tick_factor(factors[0]) and _has_whole_hz(stream, facts):
        # No counter has such ticks, and other ticks leave no whole rate: the samples were counted at another rate.
        rate_ppm = 1e6 * (factors[0] - 1)
        hypotheses.append(Hypothesis("clock_rate", stream, support("clocks.span_by_rate"), rate_ppm, "ppm"))
    elif factors:
        hypotheses.append(Hypothesis("time_unit", stream, support("clocks.span_by_factor"), factors[0], "1"))
    elif stream in _SAMPLED_ALONE and facts.clocks[stream].usable and may_be_fast and not is_of_unit:
        # Samples that were counted by another clock, or lost and numbered anew: what they hold decides.
        rate_ppm = -1e6 * ends.missing_ns / duration_ns
        hypotheses.append(Hypothesis("clock_rate", stream, support("clocks.span_by_rate"), rate_ppm, "ppm"))
    return tuple(hypotheses)


def _error_of_shift_ms(ends: StreamEnds) -> float | None:
    """Return the standard error of an offset by both ends, ms; None where these differ by more than rounding.

    Streams that begin and end together are moved by the same at both ends. Others begin and end up to a period apart.
    """
    # Of each end two timestamps are rounded to a microsecond, and the mean of both ends is taken.
    rounded_ns = NS_PER_US / sqrt(12.0)
    return rounded_ns / NS_PER_MS if abs(ends.missing_ns) <= _ROUNDINGS * NS_PER_US else None


def _of_stretched_clock(stream: str, ends: StreamEnds, facts: Facts) -> Hypothesis | None:
    """Return the rate of a clock that stretches a nominal period by as much as it stretches the span; None without."""
    clock = facts.clocks.get(stream)
    if clock is None or len(clock.times_ns) < FEWEST_TIMESTAMPS or ends.median_duration_ns <= 0:
        return None
    period_ns = float(np.median(np.diff(clock.times_ns)))
    ratio = 1 - ends.missing_ns / ends.median_duration_ns
    if period_ns <= 0 or abs(period_ns / _whole_hz_ns(period_ns) - 1) <= _NOMINAL:
        # A stream that went on longer than the others has its own rate.
        return None
    nominal_ns = _whole_hz_ns(period_ns / ratio)
    if abs(period_ns / ratio / nominal_ns - 1) > _SAME_STRETCH:
        return None
    steps = len(clock.times_ns) - 1
    mean_ns = float(clock.times_ns[-1] - clock.times_ns[0]) / steps
    error_ppm = 1e6 * NS_PER_US / sqrt(6.0) / (steps * nominal_ns)
    rate_ppm = 1e6 * (mean_ns / nominal_ns - 1)
    return Hypothesis("clock_rate", stream, support("clocks.stretched_span"), rate_ppm, "ppm", error_ppm)


def _has_whole_hz(stream: str, facts: Facts) -> bool:
    """Whether the timestamps of a stream come at a whole rate in Hz, to the rounding of both ends to a microsecond."""
    times_ns = facts.clocks[stream].times_ns
    span_ns = float(times_ns[-1] - times_ns[0])
    period_ns = span_ns / (len(times_ns) - 1)
    return abs(period_ns / _whole_hz_ns(period_ns) - 1) <= NS_PER_US / span_ns


def _is_stretched_by(factor: float, ends: StreamEnds) -> bool:
    """Whether the span of a stream is that of the others times a factor, as nearly as streams begin and end together.

    A factor of units is assigned from afar, since streams may end early: a clock that is stretched by as much as its
    span ends with the others, so that the factor is known.
    """
    ratio = 1 - ends.missing_ns / max(ends.median_duration_ns, 1.0)
    return abs(ratio / factor - 1) <= _SAME_STRETCH


def _whole_hz_ns(period_ns: float) -> float:
    """Return the period, ns, of the nearest whole number of Hz."""
    return NS_PER_S / max(round(NS_PER_S / period_ns), 1)


def _of_part(stream: str, part: PartInOtherUnit) -> Hypothesis:
    return Hypothesis("time_unit", stream, support("clocks.part_in_other_unit"), part.factor, "1")


def _of_overlap(stream: str, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return samples that were written twice where timestamps step back once, and then recur without an exception.

    A clock that was set back by whole periods has the same timestamps, but not the same values: the trial, which drops
    samples of equal values alone, decides.
    """
    times_ns = facts.clocks[stream].times_ns
    backward = np.flatnonzero(np.diff(times_ns) < 0)
    if len(backward) != 1:
        return ()
    before_ns, behind_ns = np.split(times_ns, backward + 1)
    again_ns = behind_ns[behind_ns <= before_ns[-1]]
    if not np.all(np.isin(again_ns, before_ns)):
        return ()
    return (Hypothesis("duplicated_samples", stream, support("clocks.overlap"), float(len(again_ns)), "samples"),)


def _of_set_back(stream: str, set_back: ClockSetBack) -> Hypothesis:
    return Hypothesis("time_offset", stream, support("clocks.set_back"), set_back.offset_ms, "ms")


def propose_frame_to_event(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of the rule that wrong entries follow; a clock reset of the events comes first."""
    features = alarm.statistic.features
    entries = only_feature(features, WrongEntries)
    rule = only_feature(features, MapRule)
    resets = (feature for feature in features if isinstance(feature, ClockReset))
    hypotheses = [hypothesis for reset in resets for hypothesis in hypotheses_of_reset(reset)]
    stream, frames, size, error = alarm.finding.where.stream or "", entries.frames, rule.size, rule.standard_error
    match rule.rule:
        case "behind_equal_timestamps":
            # An entry is the number of events before its frame: events at the frame's own timestamp do not count.
            hypotheses.append(Hypothesis("index_side", stream, support("index_maps.right_side")))
        case "zero":
            # Zero from some frame to the end: writing ended early. Zero throughout: it was never written.
            if entries.reaches_end and entries.ratio < _MOSTLY_ZERO:
                supported = support("index_maps.not_written_to_end")
                hypotheses.append(Hypothesis("truncated", stream, supported, 100 * entries.ratio, "percent"))
            hypotheses.append(Hypothesis("missing_stream", stream, support("index_maps.not_written")))
        case "last_event":
            # The index of the last event before a frame is one less than the number of events before it.
            hypotheses.append(
                Hypothesis("index_off_by_one", stream, support("index_maps.stops_at_last_event"), -1.0, "events")
            )
        case "nearest_event":
            hypotheses.append(
                Hypothesis("index_off_by_one", stream, support("index_maps.nearest_event"), -1.0, "events")
            )
        case "shifted":
            hypotheses.append(
                Hypothesis("index_off_by_one", stream, support("index_maps.constant_shift"), size, "events", error)
            )
            # A shift begins at a frame: events were lost or doubled there after the map was made.
            lasts = entries.begins_within and entries.reaches_end and not is_right_elsewhere(stream, entries, facts)
            if lasts and size is not None and abs(size) > 1:
                # Entries that are too large count events that the stream no longer has.
                cause = "dropped_samples" if size > 0 else "duplicated_samples"
                hypotheses.append(Hypothesis(cause, "events", support("index_maps.events_lost_or_doubled")))
        case "other_camera":
            hypotheses += _of_changed_timestamps(entries)
            hypotheses.append(Hypothesis("index_off_by_one", stream, support("index_maps.of_other_camera")))
        case "neighbouring_frame":
            hypotheses.append(Hypothesis("time_offset", frames, support("index_maps.neighbouring_frame"), size, "ms"))
        case "delayed_events":
            hypotheses.append(Hypothesis("time_offset", "events", support("index_maps.late_events"), size, "ms", error))
            early = None if size is None else -size
            hypotheses.append(Hypothesis("time_offset", frames, support("index_maps.early_frames"), early, "ms", error))
        case "drifting_events":
            hypotheses.append(Hypothesis("clock_rate", "events", support("index_maps.fast_events"), size, "ppm", error))
            slow = None if size is None else -size
            hypotheses.append(Hypothesis("clock_rate", frames, support("index_maps.slow_frames"), slow, "ppm", error))
        case "none":
            # Causes of timestamps, or events, that were changed after the map was made.
            hypotheses += _of_changed_timestamps(entries)
            for cause in ("unsorted", "dropped_samples", "duplicated_samples"):
                hypotheses.append(Hypothesis(cause, "events", support("index_maps.changed_events")))
            hypotheses.append(Hypothesis("index_off_by_one", stream, support("index_maps.no_rule")))
    return tuple(hypotheses)


def is_right_elsewhere(stream: str, entries: WrongEntries, facts: Facts) -> bool:
    """Whether another map is right where the entries of this one are wrong: its events were not changed, then."""
    start_ns = facts.clocks[entries.frames].times_ns[entries.rows[0]] if entries.frames in facts.clocks else 0
    for other, index_map in facts.index_maps.items():
        clock = facts.clocks.get(FRAMES_OF_MAP[other])
        if other == stream or clock is None:
            continue
        length = min(len(index_map.stored), len(index_map.expected_left), len(clock.times_ns))
        after = clock.times_ns[:length] >= start_ns
        is_right = index_map.stored[:length] == index_map.expected_left[:length]
        if np.any(after) and np.all(is_right[after]):
            return True
    return False


def propose_milliseconds(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a constant shift, and of events whose timestamps changed after the map; else none.

    The milliseconds are no stream, so that nothing but events can be late or fast.
    """
    hypotheses = propose_frame_to_event(alarm, facts)
    match only_feature(alarm.statistic.features, MapRule).rule:
        case "shifted":
            return hypotheses
        case "delayed_events" | "drifting_events":
            return hypotheses[:1]
    return ()


def _of_changed_timestamps(entries: WrongEntries) -> Iterator[Hypothesis]:
    """Yield the causes of timestamps of frames, or of events, that were changed after the map was made."""
    if entries.all_at_one_event:
        yield Hypothesis("time_unit", entries.frames, support("index_maps.unit_of_frames"))
        yield Hypothesis("time_unit", "events", support("index_maps.unit_of_events"))
    for cause in ("time_unit", "unsorted", "time_offset", "clock_rate", "quantised_time"):
        yield Hypothesis(cause, entries.frames, support("index_maps.changed_timestamps"))
