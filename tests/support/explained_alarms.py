"""Alarms with their hypotheses, trials of causes, and the diagnoses that follow from both."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.candidates import CauseCandidate
from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.diagnosis.diagnose import choose_causes, rank_candidates
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis, Finding, Result, Where

Explained = tuple[Alarm, tuple[Hypothesis, ...]]
"""An alarm with its hypotheses."""


def alarm(number: int, *hypotheses: Hypothesis, code: str = "toy.rule", stream: str = "events") -> Explained:
    """An alarm of finding ``F<number>`` with its hypotheses."""
    where = Where(stream=stream)
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, where)
    return Alarm(Finding(f"F{number}", code, "error", "off", where), statistic), hypotheses


def diagnoses_of(
    explained: Sequence[Explained],
    trials: Mapping[tuple[str, str], UndoTrial] = MappingProxyType({}),
    results: Mapping[str, Result] = MappingProxyType({}),
    places: Mapping[str, ClockPlace] = MappingProxyType({}),
) -> tuple[Diagnosis, ...]:
    """The causes that are chosen for alarms with their hypotheses."""
    alarms = [each for each, _ in explained]
    return choose_causes(alarms, {a.finding.id: hypotheses for a, hypotheses in explained}, trials, results, places)


def candidates_of(explained: Sequence[Explained], results: Mapping[str, Result]) -> list[CauseCandidate]:
    """The candidates for alarms with their hypotheses, the first one ranked highest."""
    return rank_candidates([each for each, _ in explained], {a.finding.id: h for a, h in explained}, results)


@dataclass(frozen=True)
class UnplantedFault:
    """A fault of a size that a test states, which is never planted."""

    cause: str
    stream: str
    magnitude: float | None = None


def undo_trial(
    *cleared: str, left: Mapping[str, float] | None = None, caused: Sequence[str] = (), size: float = 2.0
) -> UndoTrial:
    """A trial that clears findings, leaves shares of others and causes findings by their codes."""
    fault: Any = UnplantedFault("a cause", "a stream", size)
    return UndoTrial(fault, "it is undone", frozenset(cleared), left or {}, tuple(caused), 4)


LATE = Hypothesis("time_offset", "events", 0.5, 2.0, "ms", 0.1)
SHIFTED = Hypothesis("spatial_offset", "events", 0.9, 3.0, "px", 0.1)
BOTH = [alarm(1, LATE, SHIFTED), alarm(2, LATE, SHIFTED, code="other.rule")]
IS_LATE, IS_SHIFTED = ("time_offset", "events"), ("spatial_offset", "events")
