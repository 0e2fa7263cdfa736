"""Hypotheses for wrong entries in the index maps from frames and milliseconds to events."""

from collections.abc import Iterator
from typing import Final

from fedora_qa.checks.index_maps.frame_to_event import MapRule, WrongEntries
from fedora_qa.diagnosis.clocks import hypotheses_of_reset
from fedora_qa.diagnosis.features import only_feature
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset

_MOSTLY_ZERO: Final = 0.9
"""Least ratio of wrong entries for a map of zeros that was not only cut short."""


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
            if entries.begins_within and entries.reaches_end and size is not None and abs(size) > 1:
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
