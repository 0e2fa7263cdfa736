"""Compare the statistics of the checks with those of a correct file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.judgement.tolerances import Tolerance, tolerance_for
from fedora_qa.record.types import Finding, Measurement, Outcome, Result
from fedora_qa.record.wording import with_unit

_NAMED_IN_REASON: Final = 3
"""Largest number of measurements that a reason names; a fit of the IMU can have twenty."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """A finding together with the statistic that exceeds its limit.

    Attributes
    ----------
    finding
        The finding, as it stands in the record.
    statistic
        The statistic of the check, with its features for diagnosis.
    """

    finding: Finding
    statistic: Statistic


@dataclass(frozen=True, slots=True)
class Judged:
    """The result of a check, and the alarms among its findings.

    Attributes
    ----------
    result
        The result, as it stands in the record.
    alarms
        One for each statistic that exceeds its limit, in the order of the measurements.
    """

    result: Result
    alarms: tuple[Alarm, ...] = ()


def judge(
    observations: Mapping[str, Observation], checks: Iterable[Check[Any]], false_alarm_rate: float
) -> tuple[Judged, ...]:
    """Judge all observations of one file together, because they share one false-alarm rate.

    Parameters
    ----------
    observations
        The observations, by the name of the check.
    checks
        The checks, in the order of the record.
    false_alarm_rate
        Probability that a correct file fails any check, between 0 and 1.

    Returns
    -------
    tuple[Judged, ...]
        One for each check that has an observation, in the order of ``checks``.

    Raises
    ------
    ValueError
        If the rate is not between 0 and 1.
    """
    # A statistic without a standard error does not vary by chance: it takes no share of the false-alarm rate.
    comparisons = sum(
        sum(statistic.tests for statistic in observation.measurements if statistic.standard_error > 0)
        for observation in observations.values()
    )
    tolerance = tolerance_for(comparisons, false_alarm_rate)
    judged: list[Judged] = []
    next_id = 1  # findings are numbered consecutively over all checks of the file
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
    """Return whether the value of a statistic deviates by more than a correct file allows.

    Parameters
    ----------
    statistic
        The value with its nominal value, standard error, model error bound and side.
    tolerance
        Multiple of the standard error that the limit allows.

    Returns
    -------
    bool
        True also where the value is NaN.
    """
    deviation = statistic.value - statistic.expected
    if statistic.side == "both":
        deviation = abs(deviation)
    elif statistic.side == "lower":
        deviation = -deviation
    # Every comparison with NaN is false: with ``not <=`` NaN exceeds the limit, with ``>`` it would pass.
    return not deviation <= tolerance.limit(statistic.standard_error, statistic.model_error_bound)


def _outcome(observation: Observation, failed: bool, tolerance: Tolerance) -> tuple[Outcome, str]:
    """Return the outcome of a check and the reason for it.

    The check is ``not_observable`` if no measurement with a material size could have detected a fault of that size. If
    only some could not, the check passes, and the reason names these.
    """
    if failed:
        return "failed", ""
    if observation.unobservable:
        return "not_observable", observation.unobservable
    coverage = observation.coverage
    if not coverage.seen and not observation.notices:
        none_seen = f"none of {coverage.of} {coverage.unit} could be seen"
        return "not_observable", none_seen if coverage.of else f"there are no {coverage.unit}"
    # Insensitive measurements: the detection limit exceeds the material size, so that a material fault can be
    # undetected. ``not <=``: a detection limit of NaN counts as insensitive.
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
