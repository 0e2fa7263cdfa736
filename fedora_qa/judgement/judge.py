"""Compare what the checks measured with what a correct file gives."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.judgement.tolerances import Tolerance, tolerance_for
from fedora_qa.record.types import Finding, Measurement, Outcome, Result
from fedora_qa.record.wording import with_unit

_NAMED_IN_REASON: Final = 3
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
    """Judge all observations of one file together, because they share one false-alarm budget.

    Parameters
    ----------
    observations
        By the name of the check.
    checks
        In the order of the record.
    false_alarm_rate
        Probability, 0 to 1, that a correct file fails any check.

    Returns
    -------
    tuple[Judged, ...]
        One for each check that has an observation.

    Raises
    ------
    ValueError
        The rate is not between 0 and 1.
    """
    # Without a standard error nothing is left to chance: such statistics take no part of the false-alarm budget.
    comparisons = sum(
        sum(statistic.tests for statistic in observation.measurements if statistic.standard_error > 0)
        for observation in observations.values()
    )
    tolerance = tolerance_for(comparisons, false_alarm_rate)
    judged: list[Judged] = []
    next_id = 1  # findings are numbered through all checks of the file
    for check in checks:
        if check.name not in observations:
            continue
        observation = observations[check.name]
        alarms: list[Alarm] = []
        measurements: list[Measurement] = []
        for s in observation.measurements:
            if exceeds_limit(s, tolerance):
                finding = Finding(f"F{next_id}", s.code, s.severity, s.statement, s.where)
                alarms.append(Alarm(finding, s))
                next_id += 1
            measurements.append(
                Measurement(
                    name=s.name,
                    value=_finite(s.value),
                    unit=s.unit,
                    standard_error=_finite(s.standard_error),
                    expected=_finite(s.expected),
                    limit=_finite(tolerance.limit(s.standard_error, s.model_error_bound)),
                    least_detectable=_finite(_least_detectable(s, tolerance)),
                    side=s.side,
                    tests=s.tests,
                )
            )
        findings = [alarm.finding for alarm in alarms]
        for notice in observation.notices:
            findings.append(Finding(f"F{next_id}", notice.code, "warning", notice.message, notice.where))
            next_id += 1
        outcome, reason = _outcome(observation, bool(alarms), tolerance)
        result = Result(
            check=check.name,
            outcome=outcome,
            question=check.question,
            measurements=tuple(measurements),
            coverage=observation.coverage,
            findings=tuple(findings),
            reason=reason,
        )
        judged.append(Judged(result, tuple(alarms)))
    return tuple(judged)


def exceeds_limit(statistic: Statistic, tolerance: Tolerance) -> bool:
    """Whether the value lies outside what a correct file gives. A value that is not a number always does."""
    deviation = statistic.value - statistic.expected
    if statistic.side == "both":
        deviation = abs(deviation)
    elif statistic.side == "lower":
        deviation = -deviation
    # Every comparison with NaN is false: ``not <=`` makes it exceed the limit, ``>`` would let it pass.
    return not deviation <= tolerance.limit(statistic.standard_error, statistic.model_error_bound)


def _outcome(observation: Observation, failed: bool, tolerance: Tolerance) -> tuple[Outcome, str]:
    """Return the outcome and its reason.

    A check none of whose measurements could show a material fault is not observable. Where some could, it passes, and
    the reason names the rest.
    """
    if failed:
        return "failed", ""
    if observation.unobservable:
        return "not_observable", observation.unobservable
    coverage = observation.coverage
    if not coverage.seen and not observation.notices:
        none_seen = f"none of {coverage.of} {coverage.unit} could be seen"
        return "not_observable", none_seen if coverage.of else f"there are no {coverage.unit}"
    # Measurements whose detection limit exceeds the material size: a material fault could have gone undetected.
    # ``not <=`` again: a limit that is not a number shows no fault.
    materials = [statistic.material for statistic in observation.measurements if statistic.material is not None]
    insensitive = [
        statistic
        for statistic in observation.measurements
        if statistic.material is not None and not _least_detectable(statistic, tolerance) <= statistic.material
    ]
    reason = ""
    if insensitive:
        named: list[str] = []
        for statistic in insensitive[:_NAMED_IN_REASON]:
            least = _least_detectable(statistic, tolerance)
            sizes = f"from {with_unit(least, statistic.unit)} on" if isfinite(least) else "at no size"
            named.append(f"{statistic.name} ({sizes}; {with_unit(statistic.material, statistic.unit)} matters)")
        more = f"; and {len(insensitive) - _NAMED_IN_REASON} more" if len(insensitive) > _NAMED_IN_REASON else ""
        reason = f"could not be seen where it matters: {', '.join(named)}{more}"
    if insensitive and len(insensitive) == len(materials):
        return "not_observable", reason
    if observation.notices:
        return "warned", "; ".join(filter(None, (*(notice.message for notice in observation.notices[:3]), reason)))
    return "passed", reason


def _least_detectable(statistic: Statistic, tolerance: Tolerance) -> float:
    return tolerance.least_detectable(statistic.standard_error, statistic.model_error_bound, statistic.resolution)


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
