"""Which hypotheses each check's alarms give rise to: one function a check, in the module of its subject."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis.event_response.alignment import propose_alignment
from fedora_qa.diagnosis.event_response.conservation import propose_conservation
from fedora_qa.diagnosis.event_response.frames import propose_frames
from fedora_qa.diagnosis.event_response.orientation import propose_orientation
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Gives the hypotheses for an alarm of one check, best supported first."""

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType(
    {
        "event_response.orientation": propose_orientation,
        "event_response.alignment": propose_alignment,
        "event_response.frames": propose_frames,
        "event_response.conservation": propose_conservation,
    }
)
"""By the name of the check."""


def propose(alarms: Sequence[Alarm], facts: Facts) -> dict[str, tuple[Hypothesis, ...]]:
    """Return the hypotheses for each alarm of one file, by the id of its finding."""
    return {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}


def hypotheses_of(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm, best supported first; none where its check proposes none."""
    check = alarm.finding.code.rpartition(".")[0]
    if check in PROPOSALS:
        return PROPOSALS[check](alarm, facts)
    return tuple(
        Hypothesis(s.cause, s.stream, s.weight, s.magnitude, s.unit, s.standard_error) for s in alarm.statistic.suspects
    )
