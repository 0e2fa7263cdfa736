"""Compare what the checks measured with what an honest file gives."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from fedora_qa.checks.protocol import Check, Measured, Observation, Suspect
from fedora_qa.judgement.tolerances import Tolerance, tolerance_for
from fedora_qa.record.types import Finding, Measurement, Outcome, Result


@dataclass(frozen=True, slots=True)
class Alarm:
    """A finding together with the causes that would explain it."""

    finding: Finding
    suspects: tuple[Suspect, ...]


@dataclass(frozen=True, slots=True)
class Judged:
    """A check's result, and the alarms among its findings."""

    result: Result
    alarms: tuple[Alarm, ...] = ()


def judge(
    observations: Mapping[str, Observation], checks: Iterable[Check[Any]], false_alarm_rate: float
) -> tuple[Judged, ...]:
    """Judge all observations of one file together, because they share one false-alarm budget."""
    comparisons = sum(_comparisons(observation) for observation in observations.values())
    tolerance = tolerance_for(comparisons, false_alarm_rate)
    judged: list[Judged] = []
    alarms = 0
    for check in checks:
        if check.name in observations:
            judged.append(_judge_one(check, observations[check.name], tolerance, first_id=alarms + 1))
            alarms += len(judged[-1].result.findings)
    return tuple(judged)


def _comparisons(observation: Observation) -> int:
    return sum(measured.tests for measured in observation.measurements if measured.standard_error > 0)


def _judge_one(check: Check[Any], observation: Observation, tolerance: Tolerance, first_id: int) -> Judged:
    broken = [measured for measured in observation.measurements if out_of_order(measured, tolerance)]
    alarms = tuple(
        Alarm(Finding(f"F{first_id + i}", m.code, m.severity, m.statement, m.where), m.suspects)
        for i, m in enumerate(broken)
    )
    notices = tuple(
        Finding(f"F{first_id + len(broken) + i}", notice.code, "warning", notice.message, notice.where)
        for i, notice in enumerate(observation.notices)
    )
    outcome, reason = _outcome(observation, bool(broken), tolerance)
    return Judged(
        Result(
            check=check.name,
            outcome=outcome,
            question=check.question,
            measurements=tuple(_recorded(measured, tolerance) for measured in observation.measurements),
            coverage=observation.coverage,
            findings=tuple(alarm.finding for alarm in alarms) + notices,
            reason=reason,
        ),
        alarms,
    )


def out_of_order(measured: Measured, tolerance: Tolerance) -> bool:
    """Whether the value lies outside what an honest file gives. A value that is not a number always does."""
    deviation = measured.value - measured.expected
    if measured.side == "both":
        deviation = abs(deviation)
    elif measured.side == "lower":
        deviation = -deviation
    return not deviation <= tolerance.limit(measured.standard_error, measured.allowance)


def _outcome(observation: Observation, broken: bool, tolerance: Tolerance) -> tuple[Outcome, str]:
    if broken:
        return "failed", ""
    if observation.unobservable:
        return "not_observable", observation.unobservable
    blind = [measured for measured in observation.measurements if not _observable(measured, tolerance)]
    if blind and len(blind) == len(observation.measurements):
        return "not_observable", "; ".join(_why_blind(measured, tolerance) for measured in blind[:3])
    if observation.notices:
        return "warned", "; ".join(notice.message for notice in observation.notices[:3])
    return "passed", ""


def _observable(measured: Measured, tolerance: Tolerance) -> bool:
    return measured.matters is None or _least_detectable(measured, tolerance) <= measured.matters


def _why_blind(measured: Measured, tolerance: Tolerance) -> str:
    least = _least_detectable(measured, tolerance)
    return (
        f"{measured.name}: only deviations above {least:.3g} {measured.unit} would be seen, "
        f"and {measured.matters:.3g} {measured.unit} matters"
    )


def _least_detectable(measured: Measured, tolerance: Tolerance) -> float:
    return tolerance.least_detectable(measured.standard_error, measured.allowance, measured.resolution)


def _recorded(measured: Measured, tolerance: Tolerance) -> Measurement:
    return Measurement(
        name=measured.name,
        value=_finite(measured.value),
        unit=measured.unit,
        standard_error=_finite(measured.standard_error),
        expected=_finite(measured.expected),
        limit=_finite(tolerance.limit(measured.standard_error, measured.allowance)),
        least_detectable=_finite(_least_detectable(measured, tolerance)),
        side=measured.side,
        tests=measured.tests,
    )


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
