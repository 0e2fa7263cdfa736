"""Hypotheses for a frame interval whose change is not what its events sum to."""

from fedora_qa.checks.event_response.frames import ChangeAnomalies
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts


def propose_frames(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.frames``, best supported first."""
    (anomalies,) = (feature for feature in alarm.statistic.features if isinstance(feature, ChangeAnomalies))
    # A repeated frame leaves an interval without any change; exchanged frames change against their events.
    frozen = "frames.unchanged" if anomalies.unchanged else "frames.no_unchanged"
    swapped = "frames.reversed" if anomalies.reversed and not anomalies.unchanged else "frames.no_reversed"
    return (
        Hypothesis("frozen_frames", "rgb", support(f"event_response.{frozen}"), _count(anomalies.unchanged), "samples"),
        Hypothesis(
            "swapped_frames", "rgb", support(f"event_response.{swapped}"), _count(anomalies.reversed), "samples"
        ),
        Hypothesis("duplicated_samples", "events", support("event_response.frames.duplicated_events")),
        Hypothesis("dropped_samples", "events", support("event_response.frames.dropped_events")),
    )


def _count(intervals: int) -> float:
    """Return the size of the fault: there is at least one wrong frame, as its interval caused the alarm."""
    return float(max(intervals, 1))
