"""Compare subjects with the first of them: distributions, and as versions findings, values and statistics."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import erfc, hypot, isfinite, sqrt
from typing import Final

import numpy as np

from fedora_qa import __version__
from fedora_qa.comparison.distances import PairedCounts, difference_of, paired_counts
from fedora_qa.comparison.paper_tables import PUBLISHED
from fedora_qa.comparison.subjects import Int64, Match, SubjectInput, design_of, matches, meaning_of, shares_of, unit_of
from fedora_qa.comparison.types import (
    COMPARISON_VERSION,
    Comparison,
    Design,
    FindingChange,
    MeasurementChange,
    OutcomeChange,
    Overlay,
    Pair,
    StatisticChange,
    Versions,
)
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.value_counts import octave_edges
from fedora_qa.record.types import FileRecord, Finding, Measurement, Scalar, Tool

Key = tuple[str, str, str, int]
"""Check, rule, stream, and how many-th of the same: what makes a finding the same in two versions."""

Statistics = Mapping[str, Mapping[str, Scalar]]

_ERROR: Final = "_standard_error"


@dataclass(frozen=True, slots=True)
class _PairPlan:
    """The comparisons of one pair, known before any is judged, so that all can share one false-alarm rate."""

    before: SubjectInput
    after: SubjectInput
    place: int
    design: Design
    distributions: tuple[PairedCounts, ...]
    matched: tuple[Match, ...]

    @property
    def tests(self) -> int:
        return len(self.distributions) + sum(
            count_with_errors(match.before.statistics, match.after.statistics) for match in self.matched
        )


def compare(inputs: Sequence[SubjectInput], design: Design | None, false_alarm_rate: float) -> Comparison:
    """Compare two or more subjects with the first.

    Parameters
    ----------
    inputs
        The subjects, the reference first.
    design
        What they are to each other; None where their names decide.
    false_alarm_rate
        Probability, 0 to 1, that any test of the whole comparison reports a difference where there is none.

    Raises
    ------
    MisuseError
        There are fewer than two, or versions have no file in common.
    """
    if len(inputs) < 2:
        raise MisuseError(f"Expected two or more subjects to compare, got {len(inputs)}")
    # All tests are counted before the first is judged: they share one false-alarm rate.
    before, planned = inputs[0], list[_PairPlan]()
    for place, after in enumerate(inputs[1:], start=1):
        pair_design = design or design_of(before, after)
        matched = matches(before, after) if pair_design == "versions" else ()
        if pair_design == "versions" and not matched:
            raise MisuseError(
                f"Expected versions of the same files, got none in {after.name} named as one in {before.name}; "
                "compare them as sequences or datasets"
            )
        distributions = paired_counts(before, after, pair_design)
        planned.append(_PairPlan(before, after, place, pair_design, distributions, matched))
    tests = sum(item.tests for item in planned)
    # Bonferroni: valid whatever the dependence of the tests.
    level = false_alarm_rate / max(tests, 1)
    pairs = tuple(
        Pair(
            before=0,
            after=item.place,
            design=item.design,
            differences=tuple(difference_of(counts, level) for counts in item.distributions),
            versions=_versions(item, level) if item.design == "versions" else None,
        )
        for item in planned
    )

    # What could not be compared.
    notes: list[str] = []
    for subject in inputs:
        lacking = [name for name, file in subject.by_name.items() if file.sampled is None]
        if lacking:
            notes.append(
                f"{subject.name}: nothing is known of the distributions of {', '.join(lacking[:3])}"
                f"{f' and {len(lacking) - 3} more' if len(lacking) > 3 else ''}; its record is of an earlier version, "
                "or its arrays do not lie beside it."
            )
    checked = [subject.name for subject in inputs if any(file.record for file in subject.files)]
    if checked and len(checked) < len(inputs):
        notes.append("Findings are compared only where both sides are records of `fedora-qa check`.")
    return Comparison(
        comparison_version=COMPARISON_VERSION,
        tool=Tool("fedora-qa", __version__),
        false_alarm_rate=false_alarm_rate,
        tests=tests,
        level=level,
        subjects=tuple(item.subject for item in inputs),
        overlays=tuple(_overlays(inputs)),
        pairs=pairs,
        published=PUBLISHED,
        notes=tuple(notes),
    )


def _versions(planned: _PairPlan, level: float) -> Versions:
    changes = [
        record_changes(item.name, item.before.record, item.after.record)
        for item in planned.matched
        if item.before.record and item.after.record
    ]
    before, after = planned.before.by_name, planned.after.by_name
    # By identity: two single files are versions of each other under different names.
    matched_files = {id(file) for item in planned.matched for file in (item.before, item.after)}
    return Versions(
        matched=len(planned.matched),
        checked=len(changes),
        gone=tuple(name for name, file in before.items() if id(file) not in matched_files),
        new=tuple(name for name, file in after.items() if id(file) not in matched_files),
        findings=tuple(finding for item in changes for finding in item.findings),
        unchanged_findings=sum(item.unchanged for item in changes),
        outcomes=tuple(outcome for item in changes for outcome in item.outcomes),
        measurements=tuple(moved for item in changes for moved in item.measurements),
        statistics=tuple(
            change
            for item in planned.matched
            for change in statistic_changes(item.name, item.before.statistics, item.after.statistics, level)
        ),
    )


def _overlays(inputs: Sequence[SubjectInput]) -> Iterator[Overlay]:
    """Yield the distribution of every quantity that any subject has, all its files together."""
    quantities = dict.fromkeys(
        q for subject in inputs for file in subject.files if file.sampled for q in file.sampled.counts
    )
    for quantity in quantities:
        totals: list[Int64 | None] = []
        for subject in inputs:
            counts = [
                file.sampled.total(quantity)
                for file in subject.files
                if file.sampled and quantity in file.sampled.counts
            ]
            totals.append(np.asarray(np.sum(counts, axis=0)) if counts else None)
        # One range of bins for all subjects, so that their shares can be drawn over each other.
        filled_bins = np.flatnonzero(np.any([total > 0 for total in totals if total is not None], axis=0))
        first, last = int(filled_bins[0]), int(filled_bins[-1]) + 1
        shares = tuple(
            None if total is None else tuple(float(share) for share in shares_of(total[first:last])) for total in totals
        )
        edges = tuple(float(edge) for edge in octave_edges()[first : last + 1])
        yield Overlay(quantity, meaning_of(quantity), unit_of(quantity), edges, shares)


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
