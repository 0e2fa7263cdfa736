"""Compare the statistics of the checks with those of a correct file: limit, detection limit, outcome.

All comparisons of one file share one false-alarm rate alpha. With n comparisons each gets the rate alpha / n
(Bonferroni), which holds for any dependence between the comparisons. The limit is two-sided::

    limit = bound + z s,      z = Phi^-1(1 - alpha / (2 n))

A correct Gaussian value with standard error s and a model error of at most ``bound`` exceeds the limit with a
probability of at most alpha / n. A value that is the worst of m counts as m of the n comparisons: by the union bound it
exceeds the limit with a probability of at most m alpha / n. Where only one side counts, the probability is at most half
of that.

A fault of size d gives the value d + b + s e, with e standard normal and an unknown model error b, |b| <= bound. A
model error can imitate a fault or compensate one. The worst case is b = -bound. For every b the value exceeds the limit
with a probability of at least ``power`` if::

    d - bound >= limit + z_power s,      least = 2 bound + (z + z_power) s,      z_power = Phi^-1(power)

A value that changes in steps (a count) must also change by at least one whole step to exceed the limit.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, Final

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.estimators.fitting.tails import normal_beyond
from fedora_qa.judgement.materiality import Materiality, materiality_row
from fedora_qa.record.types import IMMATERIAL, Finding, Measurement, Outcome, Result
from fedora_qa.record.wording import with_unit

# Probability with which a deviation of the size of the detection limit is detected.
DEFAULT_POWER = 0.95

_NAMED_IN_REASON: Final = 3
"""Largest number of measurements that a reason names; a fit of the IMU can have twenty."""

_SPREAD: Final = 2.0
"""Ratio of the highest to the lowest detection limit from which they are stated as a range."""

STRICT: Final = Materiality("strict")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Multiples of the standard error that limits and detection limits consist of.

    Attributes
    ----------
    z_limit
        Largest deviation of a correct value without model error, in standard errors.
    z_power
        Distance from the limit at which a deviation is detected with the stated power, in standard errors.
    """

    z_limit: float
    z_power: float

    def limit(self, standard_error: float, model_error_bound: float) -> float:
        """Return the largest deviation of a correct value.

        Parameters
        ----------
        standard_error
            Of the value, in its unit, under the noise model of a correct file.
        model_error_bound
            Bound on the systematic error of the method, in the unit of the value.

        Returns
        -------
        float
            In the unit of the value.
        """
        # limit = bound + z s
        return model_error_bound + self.z_limit * standard_error

    def least_detectable(self, standard_error: float, model_error_bound: float, resolution: float) -> float:
        """Return the least fault that would have been detected with the stated power, for any model error.

        Parameters
        ----------
        standard_error
            Of the value, in its unit, under the noise model of a correct file.
        model_error_bound
            Bound on the systematic error of the method, in the unit of the value.
        resolution
            Least step by which the value can change, in its unit: 1 for a count, 0 where it is continuous.

        Returns
        -------
        float
            In the unit of the value.
        """
        return (  # least = 2 bound + (z + z_power) s, beyond the limit by at least one step
            self.limit(standard_error, model_error_bound)
            + model_error_bound
            + max(self.z_power * standard_error, resolution)
        )


def tolerance_for(comparisons: int, false_alarm_rate: float) -> Tolerance:
    """Return the tolerance of each comparison where comparisons share the false-alarm rate of a file.

    Parameters
    ----------
    comparisons
        Number of comparisons that share the rate; 0 counts as 1.
    false_alarm_rate
        Probability that a correct file fails, between 0 and 1.

    Returns
    -------
    Tolerance
        The same for all comparisons.

    Raises
    ------
    ValueError
        If the rate is not between 0 and 1.
    """
    if not 0 < false_alarm_rate < 1:
        raise ValueError(f"Expected a rate between 0 and 1, got {false_alarm_rate}")
    rate_of_comparison = false_alarm_rate / max(comparisons, 1)  # Bonferroni
    # z = Phi^-1(1 - alpha / (2 n)): two-sided, half of the rate in each tail. z_power = Phi^-1(power): a fault changes
    # the value in one direction.
    return Tolerance(z_limit=normal_beyond(rate_of_comparison / 2), z_power=normal_beyond(1 - DEFAULT_POWER))


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
        One for each statistic whose deviation is material, in the order of the measurements.
    """

    result: Result
    alarms: tuple[Alarm, ...] = ()


def judge(
    observations: Mapping[str, Observation],
    checks: Iterable[Check[Any]],
    false_alarm_rate: float,
    materiality: Materiality = STRICT,
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
    materiality
        From which size a deviation beyond its limit matters.

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
        immaterial: list[Finding] = []
        measurements: list[Measurement] = []
        for s in observation.measurements:
            size = materiality.size(s.code, s.unit, s.expected, s.effect_px)
            if exceeds_limit(s, tolerance, size):
                finding = Finding(f"F{next_id}", s.code, s.severity, s.statement, s.where)
                alarms.append(Alarm(finding, s))
                next_id += 1
            elif exceeds_limit(s, tolerance):
                immaterial.append(_immaterial(check.name, s, tolerance, size))
            measurements.append(
                Measurement(
                    name=s.name,
                    value=_finite(s.value),
                    unit=s.unit,
                    standard_error=_finite(s.standard_error),
                    expected=_finite(s.expected),
                    limit=_finite(tolerance.limit(s.standard_error, s.model_error_bound)),
                    # A fault of this size is detected, and exceeds its limit by the material size.
                    least_detectable=_finite(_least_detectable(s, tolerance) + size),
                    side=s.side,
                    tests=s.tests,
                    material=size,
                    code=s.code,
                    effect_px=s.effect_px,
                    least_detectable_range=_least_detectable_range(s, tolerance, size),
                )
            )
        findings = [alarm.finding for alarm in alarms]
        for finding in immaterial:
            findings.append(replace(finding, id=f"F{next_id}"))
            next_id += 1
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


def exceeds_limit(statistic: Statistic, tolerance: Tolerance, size: float = 0.0) -> bool:
    """Return whether the value of a statistic deviates by more than a correct file allows, and by more than a size.

    Parameters
    ----------
    statistic
        The value with its nominal value, standard error, model error bound and side.
    tolerance
        Multiple of the standard error that the limit allows.
    size
        Least excess over the limit that counts, in the unit of the statistic.

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
    return not deviation - size <= tolerance.limit(statistic.standard_error, statistic.model_error_bound)


def _immaterial(check: str, statistic: Statistic, tolerance: Tolerance, size: float) -> Finding:
    """Return the finding, still without an identifier, of a deviation that is measurable and not material."""
    limit = tolerance.limit(statistic.standard_error, statistic.model_error_bound)
    deviation = abs(statistic.value - statistic.expected)
    message = (
        f"Measurable, not material: {statistic.name} deviates by {with_unit(deviation, statistic.unit)}; the "
        f"limit is {with_unit(limit, statistic.unit)}, and {with_unit(size, statistic.unit)} more would be material."
    )
    return Finding("", f"{check}.{IMMATERIAL}", "info", message, statistic.where)


def _outcome(observation: Observation, failed: bool, tolerance: Tolerance) -> tuple[Outcome, str]:
    """Return the outcome of a check and the reason for it.

    The check is ``not_observable`` if each measurement that has a largest useful detection limit exceeds it. If
    only some do, the check passes, and the reason names these.
    """
    if failed:
        return "failed", ""
    if observation.unobservable:
        return "not_observable", observation.unobservable
    coverage = observation.coverage
    if not coverage.seen and not observation.notices:
        none_seen = f"none of {coverage.of} {coverage.unit} could be measured"
        return "not_observable", none_seen if coverage.of else f"there are no {coverage.unit}"
    # Insensitive measurements: the detection limit exceeds the size from which they are of use, so that a fault of that
    # size can be undetected. ``not <=``: a detection limit of NaN counts as insensitive.
    with_use = [(s, use) for s in observation.measurements if (use := _blind_from(s)) is not None]
    insensitive = [(s, use) for s, use in with_use if not _least_detectable(s, tolerance) <= use]
    reason = ""
    if insensitive:
        named: list[str] = []
        for statistic, use in insensitive[:_NAMED_IN_REASON]:
            least = _least_detectable(statistic, tolerance)
            limit = with_unit(least, statistic.unit) if isfinite(least) else "infinite"
            named.append(f"{statistic.name} ({limit}; at most {with_unit(use, statistic.unit)} is of use)")
        more = f"; and {len(insensitive) - _NAMED_IN_REASON} more" if len(insensitive) > _NAMED_IN_REASON else ""
        reason = f"detection limit too large: {', '.join(named)}{more}"
    if insensitive and len(insensitive) == len(with_use):
        return "not_observable", reason
    if observation.notices:
        return "warned", "; ".join(filter(None, (*(notice.message for notice in observation.notices[:3]), reason)))
    return "passed", reason


def _blind_from(statistic: Statistic) -> float | None:
    """Return the detection limit above which a measurement is of no use; None where there is none."""
    row = materiality_row(statistic.code, statistic.unit)
    return statistic.blind_from if statistic.blind_from is not None or row is None else row.blind_from


def _least_detectable(statistic: Statistic, tolerance: Tolerance) -> float:
    return tolerance.least_detectable(statistic.standard_error, statistic.model_error_bound, statistic.resolution)


def _least_detectable_range(statistic: Statistic, tolerance: Tolerance, size: float) -> tuple[float, float] | None:
    """Return the detection limits at the most and at the least sensitive place; None where they hardly differ."""
    if statistic.sensitivity is None:
        return None
    lowest, highest = (
        tolerance.least_detectable(error, bound, statistic.resolution) + size for error, bound in statistic.sensitivity
    )
    return (lowest, highest) if highest >= _SPREAD * lowest else None


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
