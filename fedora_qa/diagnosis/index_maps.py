"""Causes of wrong entries in the maps from frames to events."""

from collections.abc import Iterator
from typing import Final

from fedora_qa.checks.index_maps.frame_to_event import MapRule, WrongEntries
from fedora_qa.diagnosis.clocks import hypotheses_of_reset
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset

_MOSTLY_ZERO: Final = 0.9
"""Ratio of wrong entries from which on a map of zeros was not merely cut short."""


def propose_frame_to_event(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return what makes a map follow the rule of its wrong entries; first a clock of the events that was set."""
    features = alarm.statistic.features
    entries = next(feature for feature in features if isinstance(feature, WrongEntries))
    rule = next(feature for feature in features if isinstance(feature, MapRule))
    of_reset = (h for feature in features if isinstance(feature, ClockReset) for h in hypotheses_of_reset(feature))
    return *of_reset, *_of_rule(alarm.finding.where.stream or "", rule, entries)


def _of_rule(stream: str, rule: MapRule, entries: WrongEntries) -> Iterator[Hypothesis]:
    frames, size, error = entries.frames, rule.size, rule.standard_error
    match rule.rule:
        case "behind_equal_timestamps":
            # An entry is the number of events before its frame: events at the frame's own timestamp do not count.
            yield Hypothesis("index_side", stream, support("index_maps.right_side"))
        case "zero":
            # Zero from some frame to the end: writing ended early. Zero throughout: it was never written.
            if entries.reaches_end and entries.ratio < _MOSTLY_ZERO:
                supported = support("index_maps.not_written_to_end")
                yield Hypothesis("truncated", stream, supported, 100 * entries.ratio, "percent")
            yield Hypothesis("missing_stream", stream, support("index_maps.not_written"))
        case "last_event":
            # The index of the last event before a frame is one less than the number of events before it.
            yield Hypothesis("index_off_by_one", stream, support("index_maps.stops_at_last_event"), -1.0, "events")
        case "nearest_event":
            yield Hypothesis("index_off_by_one", stream, support("index_maps.nearest_event"), -1.0, "events")
        case "shifted":
            yield Hypothesis("index_off_by_one", stream, support("index_maps.constant_shift"), size, "events", error)
            # A shift that begins at some frame: events were lost or doubled there after the map was made.
            if entries.begins_within and entries.reaches_end and size is not None and abs(size) > 1:
                # Entries that are too large count events that the stream no longer has.
                cause = "dropped_samples" if size > 0 else "duplicated_samples"
                yield Hypothesis(cause, "events", support("index_maps.events_lost_or_doubled"))
        case "other_camera":
            yield from _of_changed_timestamps(entries)
            yield Hypothesis("index_off_by_one", stream, support("index_maps.of_other_camera"))
        case "neighbouring_frame":
            yield Hypothesis("time_offset", frames, support("index_maps.neighbouring_frame"), size, "ms")
        case "delayed_events":
            yield Hypothesis("time_offset", "events", support("index_maps.late_events"), size, "ms", error)
            early = None if size is None else -size
            yield Hypothesis("time_offset", frames, support("index_maps.early_frames"), early, "ms", error)
        case "drifting_events":
            yield Hypothesis("clock_rate", "events", support("index_maps.fast_events"), size, "ppm", error)
            slow = None if size is None else -size
            yield Hypothesis("clock_rate", frames, support("index_maps.slow_frames"), slow, "ppm", error)
        case "none":
            # Whatever changed the timestamps, or the events, after the map was made.
            yield from _of_changed_timestamps(entries)
            for cause in ("unsorted", "dropped_samples", "duplicated_samples"):
                yield Hypothesis(cause, "events", support("index_maps.changed_events"))
            yield Hypothesis("index_off_by_one", stream, support("index_maps.no_rule"))


def _of_changed_timestamps(entries: WrongEntries) -> Iterator[Hypothesis]:
    """Yield what changes the timestamps of the frames, or of events, after the map was made."""
    if entries.all_at_one_event:
        yield Hypothesis("time_unit", entries.frames, support("index_maps.unit_of_frames"))
        yield Hypothesis("time_unit", "events", support("index_maps.unit_of_events"))
    for cause in ("time_unit", "unsorted", "time_offset", "clock_rate", "quantised_time"):
        yield Hypothesis(cause, entries.frames, support("index_maps.changed_timestamps"))
