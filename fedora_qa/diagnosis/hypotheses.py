"""Which hypotheses each check's alarms give rise to: one function a check, in the module of its subject."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis.event_response.model import propose_model
from fedora_qa.diagnosis.event_response.threshold import propose_threshold
from fedora_qa.diagnosis.event_response.timing import propose_timing
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.images_colours import propose_channels, propose_transfer
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Gives the hypotheses for an alarm of one check, best supported first."""

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType(
    {
        "event_response.model": propose_model,
        "event_response.threshold": propose_threshold,
        "event_response.timing": propose_timing,
        "images.channels": propose_channels,
        "images.transfer": propose_transfer,
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
