"""Compare what the checks measured with what an honest file gives."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.judgement.tolerances import Tolerance, tolerance_for
from fedora_qa.record.types import Coverage, Finding, Measurement, Outcome, Result
from fedora_qa.record.wording import with_unit

_TOLD: Final = 3
"""Measurements that a reason names; a fit of the IMU can have twenty."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """A finding together with the statistic that exceeds its limit."""

    finding: Finding
    statistic: Statistic


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
    broken = [measured for measured in observation.measurements if exceeds_limit(measured, tolerance)]
    alarms = tuple(
        Alarm(Finding(f"F{first_id + i}", m.code, m.severity, m.statement, m.where), m) for i, m in enumerate(broken)
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


def exceeds_limit(measured: Statistic, tolerance: Tolerance) -> bool:
    """Whether the value lies outside what an honest file gives. A value that is not a number always does."""
    deviation = measured.value - measured.expected
    if measured.side == "both":
        deviation = abs(deviation)
    elif measured.side == "lower":
        deviation = -deviation
    return not deviation <= tolerance.limit(measured.standard_error, measured.model_error_bound)


def _outcome(observation: Observation, broken: bool, tolerance: Tolerance) -> tuple[Outcome, str]:
    """Return the outcome and its reason.

    A check that sees nothing of what matters is not observable. One that sees a part of it passes, and says what it
    could not see.
    """
    if broken:
        return "failed", ""
    if observation.unobservable:
        return "not_observable", observation.unobservable
    if not observation.coverage.seen and not observation.notices:
        return "not_observable", _nothing_seen(observation.coverage)
    telling = [measured for measured in observation.measurements if measured.material is not None]
    blind = [measured for measured in telling if _is_blind(measured, tolerance)]
    unseen = _unseen(blind, tolerance)
    if blind and len(blind) == len(telling):
        return "not_observable", unseen
    if observation.notices:
        return "warned", "; ".join(filter(None, (*(notice.message for notice in observation.notices[:3]), unseen)))
    return "passed", unseen


def _nothing_seen(coverage: Coverage) -> str:
    return f"none of {coverage.of} {coverage.unit} could be seen" if coverage.of else f"there are no {coverage.unit}"


def _is_blind(measured: Statistic, tolerance: Tolerance) -> bool:
    """Whether a fault that matters could have gone unseen."""
    return measured.material is not None and not _least_detectable(measured, tolerance) <= measured.material


def _unseen(blind: Sequence[Statistic], tolerance: Tolerance) -> str:
    """Say what could not be seen, the first of it with the numbers."""
    if not blind:
        return ""
    more = f"; and {len(blind) - _TOLD} more" if len(blind) > _TOLD else ""
    told = ", ".join(_numbers(measured, tolerance) for measured in blind[:_TOLD])
    return f"could not be seen where it matters: {told}{more}"


def _numbers(measured: Statistic, tolerance: Tolerance) -> str:
    least = _least_detectable(measured, tolerance)
    seen = f"from {with_unit(least, measured.unit)} on" if isfinite(least) else "at no size"
    return f"{measured.name} ({seen}; {with_unit(measured.material, measured.unit)} matters)"


def _least_detectable(measured: Statistic, tolerance: Tolerance) -> float:
    return tolerance.least_detectable(measured.standard_error, measured.model_error_bound, measured.resolution)


def _recorded(measured: Statistic, tolerance: Tolerance) -> Measurement:
    return Measurement(
        name=measured.name,
        value=_finite(measured.value),
        unit=measured.unit,
        standard_error=_finite(measured.standard_error),
        expected=_finite(measured.expected),
        limit=_finite(tolerance.limit(measured.standard_error, measured.model_error_bound)),
        least_detectable=_finite(_least_detectable(measured, tolerance)),
        side=measured.side,
        tests=measured.tests,
    )


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
