"""Which hypotheses each check's alarms give rise to: one function a check, in the module of its subject."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis import imu, pose
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Gives the hypotheses for an alarm of one check, best supported first."""

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType(
    {
        "pose.orientation": pose.propose_orientation,
        "pose.continuity": pose.propose_continuity,
        "pose.noise": pose.propose_noise,
        "imu.rotation": imu.propose_rotation,
        "imu.translation": imu.propose_translation,
        "imu.timing": imu.propose_timing,
        "imu.noise": imu.propose_noise,
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
