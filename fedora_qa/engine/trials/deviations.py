"""How the deviations of measurements change from one run to another."""

from collections.abc import Sequence
from math import inf, isfinite, nan

from fedora_qa.diagnosis.conclusion import DeviationChange
from fedora_qa.judgement.judge import Alarm, Judged
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.record.types import Measurement, Result


def check_of(alarm: Alarm) -> str:
    """Return the name of the check of a finding, whose code is ``<subject>.<property>.<rule>``."""
    return alarm.finding.code.rpartition(".")[0]


def exceeding(result: Result) -> list[Measurement]:
    """Return the measurements that exceed their limits."""
    return [measurement for measurement in result.measurements if measurement.exceeds_limit]


def rule_of(measurement: Measurement) -> tuple[str, str]:
    """Return the code of a measurement, and its rate of flow: each rate keeps the rule, or breaks it, by itself."""
    rate = measurement.name.partition(" ")[0]
    return measurement.code, rate if is_flow_stream(rate) else ""


def would_hide(result: Result | None, again: Measurement) -> bool:
    """Whether a result of the plain run could not have shown a deviation of this size."""
    if result is None or result.outcome == "not_observable":
        return True
    before = next((m for m in result.measurements if (m.name, m.code) == (again.name, again.code)), None)
    return before is not None and before.limit is not None and abs(deviation_of(again)) <= before.limit


def measurement_of(result: Result, alarm: Alarm) -> Measurement | None:
    """Return the measurement of a finding in another result of its check; None where it is not stated."""
    name = alarm.statistic.name
    return next((m for m in result.measurements if (m.name, m.code) == (name, alarm.statistic.code)), None)


def change_of(alarm: Alarm, before: Measurement, after: Measurement | None) -> DeviationChange:
    """Return deviation and limit of a finding before and after undoing a fault; NaN for what is not stated."""
    return DeviationChange(
        check_of(alarm),
        before.name,
        before.unit,
        before=counted(before),
        limit_before=nan if before.limit is None else before.limit,
        after=nan if after is None else counted(after),
        limit_after=nan if after is None or after.limit is None else after.limit,
    )


def results_by_check(judged: Sequence[Judged]) -> dict[str, Result]:
    """Return the results by the name of their check."""
    return {each.result.check: each.result for each in judged}


def deviation_of(measurement: Measurement) -> float:
    """Return value less expected value; infinite where one is not finite."""
    if measurement.value is None or measurement.expected is None:
        return inf
    return measurement.value - measurement.expected


def counted(measurement: Measurement) -> float:
    """Return the deviation, 0 on a side that does not count."""
    deviation = deviation_of(measurement)
    signed = {"both": abs(deviation), "upper": deviation, "lower": -deviation}
    return deviation if signed[measurement.side] > 0 else 0.0


def ratio_left(after: Measurement, before: Measurement) -> float:
    """Return which part of a deviation is left, negative where its sign has changed."""
    left, was = deviation_of(after), deviation_of(before)
    return left / was if isfinite(left) and isfinite(was) and was else inf


def ratio_to_limit(result: Result | None, alarm: Alarm) -> float:
    """Return the size of a deviation over its limit."""
    if result is None or result.outcome in ("crashed", "not_observable"):
        return nan
    measurement = measurement_of(result, alarm)
    if measurement is None:
        return 0.0 if result.outcome == "passed" else nan
    return abs(counted(measurement)) / measurement.limit if measurement.limit else nan
