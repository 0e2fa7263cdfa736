"""Hypotheses for events that do not correlate with the frames as declared."""

from fedora_qa.checks.event_response.orientation import EventSymmetry
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts


def propose_orientation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.orientation``, best supported first."""
    if alarm.finding.code in ("event_response.orientation.unrelated", "event_response.orientation.other"):
        if facts.events is None or not facts.events.count:
            return (Hypothesis("dropped_samples", "events", support("event_response.orientation.no_events")),)
        if not alarm.statistic.features:
            # No orientation correlates; ``event_response.timing`` searches for an offset.
            return (
                Hypothesis("other_sequence", "events", support("event_response.orientation.other_events")),
                Hypothesis("other_sequence", "rgb", support("event_response.orientation.other_frames")),
                Hypothesis("time_offset", "events", support("event_response.orientation.events_offset")),
                Hypothesis("time_offset", "rgb", support("event_response.orientation.frames_offset")),
                Hypothesis("time_unit", "events", support("event_response.orientation.time_unit")),
            )
    (symmetry,) = (feature for feature in alarm.statistic.features if isinstance(feature, EventSymmetry))
    return hypotheses_of_symmetry(symmetry)


def hypotheses_of_symmetry(symmetry: EventSymmetry) -> tuple[Hypothesis, ...]:
    """Return the causes that make events agree with the frames under a symmetry."""
    mirrored = symmetry.mirrored_columns or symmetry.mirrored_rows
    causes = (
        ("polarity_inverted", symmetry.inverted),
        ("axes_swapped", symmetry.swapped_axes),
        ("mirrored", mirrored),
    )
    weight = support("event_response.orientation.symmetry")
    of_events = tuple(Hypothesis(cause, "events", weight) for cause, applies in causes if applies)
    if not mirrored or symmetry.swapped_axes:
        return of_events
    # Mirrored frames have the effect of mirrored events; axes of frames are not exchanged, as both sides differ.
    return (*of_events, Hypothesis("mirrored", "rgb", support("event_response.orientation.mirrored_frames")))
