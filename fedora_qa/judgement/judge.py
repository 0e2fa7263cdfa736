"""Compare what the checks measured with what a correct file gives."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.judgement.tolerances import Tolerance, tolerance_for
from fedora_qa.record.types import Coverage, Finding, Measurement, Outcome, Result
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
    alarms = 0
    for check in checks:
        if check.name in observations:
            judged.append(_judge_check(check, observations[check.name], tolerance, first_id=alarms + 1))
            alarms += len(judged[-1].result.findings)
    return tuple(judged)


def _judge_check(check: Check[Any], observation: Observation, tolerance: Tolerance, first_id: int) -> Judged:
    exceeding = [statistic for statistic in observation.measurements if exceeds_limit(statistic, tolerance)]
    alarms = tuple(
        Alarm(Finding(f"F{first_id + i}", s.code, s.severity, s.statement, s.where), s) for i, s in enumerate(exceeding)
    )
    notices = tuple(
        Finding(f"F{first_id + len(exceeding) + i}", notice.code, "warning", notice.message, notice.where)
        for i, notice in enumerate(observation.notices)
    )
    outcome, reason = _outcome(observation, bool(exceeding), tolerance)
    return Judged(
        Result(
            check=check.name,
            outcome=outcome,
            question=check.question,
            measurements=tuple(_measurement_of(statistic, tolerance) for statistic in observation.measurements),
            coverage=observation.coverage,
            findings=tuple(alarm.finding for alarm in alarms) + notices,
            reason=reason,
        ),
        alarms,
    )


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
    if not observation.coverage.seen and not observation.notices:
        return "not_observable", _reason_of_no_coverage(observation.coverage)
    # Measurements whose detection limit exceeds the material size: a material fault could have gone undetected.
    with_material_size = [statistic for statistic in observation.measurements if statistic.material is not None]
    insensitive = [statistic for statistic in with_material_size if _is_insensitive(statistic, tolerance)]
    reason = _reason_of_insensitivity(insensitive, tolerance)
    if insensitive and len(insensitive) == len(with_material_size):
        return "not_observable", reason
    if observation.notices:
        return "warned", "; ".join(filter(None, (*(notice.message for notice in observation.notices[:3]), reason)))
    return "passed", reason


def _reason_of_no_coverage(coverage: Coverage) -> str:
    return f"none of {coverage.of} {coverage.unit} could be seen" if coverage.of else f"there are no {coverage.unit}"


def _is_insensitive(statistic: Statistic, tolerance: Tolerance) -> bool:
    """Whether a material fault could have stayed within the limit."""
    # ``not <=`` again: a limit that is not a number shows no fault.
    return statistic.material is not None and not _least_detectable(statistic, tolerance) <= statistic.material


def _reason_of_insensitivity(insensitive: Sequence[Statistic], tolerance: Tolerance) -> str:
    """Name the measurements that could not show a material fault, the first of them with their numbers."""
    if not insensitive:
        return ""
    more = f"; and {len(insensitive) - _NAMED_IN_REASON} more" if len(insensitive) > _NAMED_IN_REASON else ""
    listed = ", ".join(_detection_limit(statistic, tolerance) for statistic in insensitive[:_NAMED_IN_REASON])
    return f"could not be seen where it matters: {listed}{more}"


def _detection_limit(statistic: Statistic, tolerance: Tolerance) -> str:
    least = _least_detectable(statistic, tolerance)
    sizes = f"from {with_unit(least, statistic.unit)} on" if isfinite(least) else "at no size"
    return f"{statistic.name} ({sizes}; {with_unit(statistic.material, statistic.unit)} matters)"


def _least_detectable(statistic: Statistic, tolerance: Tolerance) -> float:
    return tolerance.least_detectable(statistic.standard_error, statistic.model_error_bound, statistic.resolution)


def _measurement_of(statistic: Statistic, tolerance: Tolerance) -> Measurement:
    return Measurement(
        name=statistic.name,
        value=_finite(statistic.value),
        unit=statistic.unit,
        standard_error=_finite(statistic.standard_error),
        expected=_finite(statistic.expected),
        limit=_finite(tolerance.limit(statistic.standard_error, statistic.model_error_bound)),
        least_detectable=_finite(_least_detectable(statistic, tolerance)),
        side=statistic.side,
        tests=statistic.tests,
    )


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
