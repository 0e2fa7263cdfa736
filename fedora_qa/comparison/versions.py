"""What was found in two versions of a file: new, gone and changed findings, and values that moved."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import hypot

from fedora_qa.comparison.types import Change, FindingChange, MeasurementChange, OutcomeChange
from fedora_qa.record.types import FileRecord, Finding, Measurement, Result

Key = tuple[str, str, str, int]
"""Check, rule, stream, and how many-th of the same: what makes a finding the same in two versions."""


@dataclass(frozen=True, slots=True)
class RecordChanges:
    """What changed between two records of one file."""

    findings: tuple[FindingChange, ...]
    unchanged: int
    outcomes: tuple[OutcomeChange, ...]
    measurements: tuple[MeasurementChange, ...]


def record_changes(file: str, before: FileRecord, after: FileRecord) -> RecordChanges:
    """Compare two records of one file."""
    moved = tuple(_measurement_changes(file, before, after))
    restless = {change.check for change in moved}
    first, other = _findings(before), _findings(after)
    changes = [_finding_change(file, key, first.get(key), other.get(key), restless) for key in {**first, **other}]
    finding_changes = tuple(change for change in changes if change is not None)
    return RecordChanges(
        finding_changes, len(changes) - len(finding_changes), tuple(_outcome_changes(file, before, after)), moved
    )


def allowed_shift(before: Measurement, after: Measurement) -> float | None:
    """Return how far a value may move between two correct versions; None where a limit is not known.

    Each may deviate by its limit. The two are independent but for errors of the model, which they share.
    """
    if before.limit is None or after.limit is None:
        return None
    return hypot(before.limit, after.limit)


def _findings(record: FileRecord) -> dict[Key, tuple[Result, Finding]]:
    numbered: dict[Key, tuple[Result, Finding]] = {}
    for result in record.results:
        for finding in result.findings:
            # Paired by order within a rule and stream: messages hold measured values and identify nothing.
            same = sum(key[:3] == (result.check, finding.code, finding.where.stream or "") for key in numbered)
            numbered[result.check, finding.code, finding.where.stream or "", same] = result, finding
    return numbered


def _finding_change(
    file: str,
    key: Key,
    before: tuple[Result, Finding] | None,
    after: tuple[Result, Finding] | None,
    restless: set[str],
) -> FindingChange | None:
    """Return what became of a finding; None where nothing did."""
    first, other = (side[1] if side else None for side in (before, after))
    change: Change = "changed" if first and other else "new" if other else "gone"
    if first and other and first.severity == other.severity and key[0] not in restless:
        return None
    return FindingChange(
        file=file,
        change=change,
        check=key[0],
        code=key[1],
        stream=key[2],
        severity_before=first.severity if first else None,
        severity_after=other.severity if other else None,
        message_before=first.message if first else "",
        message_after=other.message if other else "",
    )


def _outcome_changes(file: str, before: FileRecord, after: FileRecord) -> Iterator[OutcomeChange]:
    first, other = ({result.check: result.outcome for result in side.results} for side in (before, after))
    for check in {**first, **other}:
        if first.get(check) != other.get(check):
            yield OutcomeChange(file, check, first.get(check), other.get(check))


def _measurement_changes(file: str, before: FileRecord, after: FileRecord) -> Iterator[MeasurementChange]:
    first, other = _measurements(before), _measurements(after)
    for (check, name), measured in other.items():
        earlier = first.get((check, name))
        allowed = allowed_shift(earlier, measured) if earlier and earlier.unit == measured.unit else None
        if earlier is None or allowed is None or earlier.value is None or measured.value is None:
            continue
        # A value that moves on the side without a limit has not changed.
        if abs(_counting(measured) - _counting(earlier)) > allowed:
            yield MeasurementChange(file, check, name, measured.unit, earlier.value, measured.value, allowed)


def _counting(measured: Measurement) -> float:
    """Return a value, or what is expected where it lies on the side that does not count."""
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
