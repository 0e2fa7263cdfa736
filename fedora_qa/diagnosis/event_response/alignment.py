"""Hypotheses for events that are shifted against the frames."""

from fedora_qa.checks.event_response.alignment import ShiftAxis
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts


def propose_alignment(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.alignment``, best supported first."""
    statistic = alarm.statistic
    (axis,) = (feature.axis for feature in statistic.features if isinstance(feature, ShiftAxis))
    # The size of a spatial offset is that along the columns; of a shift down only the direction is not given.
    right_px = statistic.value if axis == "right" else None
    error_px = statistic.standard_error
    if alarm.finding.code == "event_response.alignment.shift":
        return (
            Hypothesis("spatial_offset", "events", _support("events_offset"), right_px, "px",
                       None if right_px is None else error_px),
            Hypothesis("spatial_offset", "rgb", _support("frames_offset"), None if right_px is None else -right_px,
                       "px"),
            Hypothesis("time_offset", "events", _support("events_time_offset")),
            Hypothesis("time_offset", "rgb", _support("frames_time_offset")),
            Hypothesis("clock_rate", "events", _support("clock_rate")),
            Hypothesis("event_model_misdeclared", "events", _support("event_model")),
            Hypothesis("intrinsics_centre", "metadata", _support("intrinsics_centre")),
        )  # fmt: skip
    of_frames: tuple[Hypothesis, ...] = ()
    if alarm.finding.code == "event_response.alignment.stretch":
        # A region of events cannot come from frames; a segment of time can.
        of_frames = (
            Hypothesis("spatial_offset", "rgb", _support("part_frames_offset")),
            Hypothesis("swapped_frames", "rgb", _support("part_swapped_frames")),
            Hypothesis("frozen_frames", "rgb", _support("part_frozen_frames")),
        )
    return (
        Hypothesis("spatial_offset", "events", _support("part_events_offset"), right_px, "px", error_px),
        *of_frames,
        Hypothesis("event_model_misdeclared", "events", _support("part_event_model")),
        Hypothesis("time_offset", "events", _support("part_events_time_offset")),
        Hypothesis("clock_rate", "events", _support("part_clock_rate")),
    )


def _support(row: str) -> float:
    return support(f"event_response.alignment.{row}")
