"""Two versions of a file: new, gone and changed findings, and measured values and statistics that moved."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import erfc, hypot, isfinite, sqrt
from typing import Final

from fedora_qa.comparison.types import FindingChange, MeasurementChange, OutcomeChange, StatisticChange
from fedora_qa.record.types import FileRecord, Finding, Measurement, Scalar

Key = tuple[str, str, str, int]
"""Check, rule, stream, and how many-th of the same: what makes a finding the same in two versions."""

Statistics = Mapping[str, Mapping[str, Scalar]]

_ERROR: Final = "_standard_error"


@dataclass(frozen=True, slots=True)
class RecordChanges:
    """What changed between two records of one file."""

    findings: tuple[FindingChange, ...]
    unchanged: int
    outcomes: tuple[OutcomeChange, ...]
    measurements: tuple[MeasurementChange, ...]


def record_changes(file: str, before: FileRecord, after: FileRecord) -> RecordChanges:
    """Compare two records of one file."""
    moved: list[MeasurementChange] = []
    measurements, later_measurements = _measurements(before), _measurements(after)
    for (check, name), measured in later_measurements.items():
        earlier = measurements.get((check, name))
        allowed = allowed_shift(earlier, measured) if earlier and earlier.unit == measured.unit else None
        if earlier is None or allowed is None or earlier.value is None or measured.value is None:
            continue
        # A value that moves on the side without a limit has not changed.
        if abs(_limited_value(measured) - _limited_value(earlier)) > allowed:
            moved.append(MeasurementChange(file, check, name, measured.unit, earlier.value, measured.value, allowed))

    outcomes: list[OutcomeChange] = []
    first, other = ({result.check: result.outcome for result in side.results} for side in (before, after))
    for check in {**first, **other}:
        if first.get(check) != other.get(check):
            outcomes.append(OutcomeChange(file, check, first.get(check), other.get(check)))

    findings: list[FindingChange] = []
    checks_of_moved = {change.check for change in moved}
    sides = _findings(before), _findings(after)
    keys = {**sides[0], **sides[1]}
    for key in keys:
        former, latter = (side.get(key) for side in sides)
        # A finding is the same in both unless its severity changed, or what its check measured moved.
        if former and latter and former.severity == latter.severity and key[0] not in checks_of_moved:
            continue
        findings.append(
            FindingChange(
                file=file,
                change="changed" if former and latter else "new" if latter else "gone",
                check=key[0],
                code=key[1],
                stream=key[2],
                severity_before=former.severity if former else None,
                severity_after=latter.severity if latter else None,
                message_before=former.message if former else "",
                message_after=latter.message if latter else "",
            )
        )
    return RecordChanges(tuple(findings), len(keys) - len(findings), tuple(outcomes), tuple(moved))


def allowed_shift(before: Measurement, after: Measurement) -> float | None:
    """Return how far a value may move between two correct versions; None where a limit is not known.

    Each may deviate by its limit. The two are independent but for errors of the model, which they share.
    """
    if before.limit is None or after.limit is None:
        return None
    return hypot(before.limit, after.limit)


def _findings(record: FileRecord) -> dict[Key, Finding]:
    numbered: dict[Key, Finding] = {}
    for result in record.results:
        for finding in result.findings:
            for where in finding.all_places:
                # Paired by order within a rule and stream: messages hold measured values and identify nothing.
                kind = result.check, finding.code, where.stream or ""
                numbered[*kind, sum(key[:3] == kind for key in numbered)] = replace(finding, where=where, places=())
    return numbered


def _limited_value(measured: Measurement) -> float:
    """Return a value, or the expected one where the value lies on the side without a limit."""
    value, expected = measured.value or 0.0, measured.expected
    if expected is None or measured.side == "both":
        return value
    return max(value, expected) if measured.side == "upper" else min(value, expected)


def _measurements(record: FileRecord) -> Mapping[tuple[str, str], Measurement]:
    """Return the measurements of checks that came to a verdict, by check and name."""
    return {
        (result.check, measured.name): measured
        for result in record.results
        if result.outcome in {"passed", "failed", "warned"}
        for measured in result.measurements
    }


def statistic_changes(file: str, before: Statistics, after: Statistics, level: float) -> Iterator[StatisticChange]:
    """Yield every number that is not the same in both; see ``count_with_errors`` for those that are tests."""
    for name, (first, other) in _numbers(before, after).items():
        if first == other:
            continue
        error = _error(name, before, after)
        if error is None or first is None or other is None:
            yield StatisticChange(file, name, first, other, None, None, "changed")
            continue
        # P(|z| > x) = erfc(x / sqrt 2) of a normal difference; without an error any difference is certain.
        chance = erfc(abs(other - first) / (error * sqrt(2))) if error else 0.0
        yield StatisticChange(file, name, first, other, error, chance, "moved" if chance <= level else "within_error")


def count_with_errors(before: Statistics, after: Statistics) -> int:
    """Return how many statistics have a standard error on both sides: each is a test of whether it moved."""
    return sum(_error(name, before, after) is not None for name in _numbers(before, after))


def _numbers(before: Statistics, after: Statistics) -> dict[str, tuple[float | None, float | None]]:
    """Return the numbers of both by ``group.name``, without the errors; None where one side has none."""
    named: dict[str, tuple[float | None, float | None]] = {}
    for group in dict.fromkeys([*before, *after]):
        first, other = before.get(group, {}), after.get(group, {})
        for key in dict.fromkeys([*first, *other]):
            values = _number(first.get(key)), _number(other.get(key))
            if _ERROR not in key and values != (None, None):
                named[f"{group}.{key}"] = values
    return named


def _error(name: str, before: Statistics, after: Statistics) -> float | None:
    """Return the standard error of the difference; None where either side has none."""
    group, _, key = name.rpartition(".")
    # The error of a statistic: of speed_max_m_s it is speed_max_standard_error_m_s.
    errors = [
        next((_number(v) for n, v in side.get(group, {}).items() if _ERROR in n and n.replace(_ERROR, "") == key), None)
        for side in (before, after)
    ]
    finite_errors = [error for error in errors if error is not None]
    # The errors of two versions are independent: variances add.
    error = hypot(*finite_errors)
    return error if len(finite_errors) == len(errors) and isfinite(error) else None


def _number(value: Scalar) -> float | None:
    return None if isinstance(value, bool | str) or value is None else float(value)
