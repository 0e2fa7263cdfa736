"""The baseline: findings of an earlier gate are known; new ones, and known ones that have grown worse, are not."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from statistics import NormalDist

from fedora_qa.errors import MisuseError
from fedora_qa.gating.severity_override import GRAVE, mark_findings
from fedora_qa.record.several_files import names_in_release
from fedora_qa.record.types import FileRecord, Finding, Measurement, Record, Result, Side

_KNOWN_SEVERITIES = GRAVE | {"warning"}
"""Severities of an earlier record's findings that count as known. Waived findings are information and do not."""

Key = tuple[str, str, str, str | None, str]
"""Name of the file, check, code, stream; and of a rule about the release its message, which holds no noise."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """The findings of an earlier gate: their number by kind, and the results that they belong to."""

    counts: Mapping[Key, int]
    results: Mapping[tuple[str, str], Result]


def baseline_of(record: Record) -> Baseline:
    """Return the record of an earlier gate as a baseline.

    Raises
    ------
    MisuseError
        The record was not written by a gate: the names of its files in the release are unknown.
    """
    named = tuple(named_files(record))
    keys = [
        key
        for name, file in named
        for result in file.results
        for finding in result.findings
        if finding.severity in _KNOWN_SEVERITIES
        for key in _keys(name, result, finding)
    ]
    results = {(name, result.check): result for name, file in named for result in file.results}
    return Baseline(Counter(keys), results)


def named_files(record: Record) -> Iterator[tuple[str, FileRecord]]:
    """Yield the files of a gate's record with their names in the release, which comes last."""
    names = names_in_release(record)
    if not names:
        raise MisuseError("Expected a record that `fedora-qa gate --json` wrote, got one without a release")
    yield from zip(names, record.files, strict=True)


def accept_known(name: str, file: FileRecord, baseline: Baseline, false_alarm_rate: float) -> FileRecord:
    """Return the file with its known findings as warnings.

    As many findings of a kind are known as the baseline has, where no measurement of their check has grown worse.

    Parameters
    ----------
    name
        The name of the file in the release.
    false_alarm_rate
        Probability that a check whose fault has not grown counts as worse.
    """
    left = Counter(baseline.counts)

    def mark(result: Result, finding: Finding) -> Finding:
        keys = Counter(_keys(name, result, finding))
        # A finding is known where it is known at all its places.
        if finding.severity not in GRAVE or not keys <= left:
            return finding
        # Whether any value lies farther out than before, beyond the errors of both. The difference of two correct
        # deviations is normal with the variances of both. The check's measurements share the rate (Bonferroni).
        before = baseline.results[name, result.check]
        sigmas = NormalDist().inv_cdf(1 - false_alarm_rate / max(len(result.measurements), 1))
        earlier = {measurement.name: measurement for measurement in before.measurements}
        grown_worse = any(
            _farther_out(measurement, earlier[measurement.name], sigmas)
            for measurement in result.measurements
            if measurement.name in earlier
        )
        if grown_worse:
            return replace(finding, message=f"{finding.message} Worse than in the baseline.")
        # One known finding accepts one: a second of its kind is new.
        left.subtract(keys)
        return replace(finding, severity="warning", message=f"{finding.message} Known from the baseline.")

    return mark_findings(file, mark)


def _keys(name: str, result: Result, finding: Finding) -> tuple[Key, ...]:
    """Return a key for each place of a finding."""
    message = finding.message.removesuffix(" Known from the baseline.") if result.check.startswith("release.") else ""
    return tuple((name, result.check, finding.code, where.stream, message) for where in finding.all_places)


def _farther_out(now: Measurement, before: Measurement, sigmas: float) -> bool:
    """Whether a value lies farther out than before; what is not a number lies farther out than every number."""
    if now.value is None or before.value is None:
        return now.value is None and before.value is not None
    if now.expected is None or before.expected is None:
        return False
    grown = _deviation(now.value - now.expected, now.side) - _deviation(before.value - before.expected, before.side)
    # Variances of both deviations add; ``sigmas`` is the one-sided quantile at the shared rate.
    return grown > sigmas * math.hypot(now.standard_error or 0.0, before.standard_error or 0.0)


def _deviation(difference: float, side: Side) -> float:
    if side == "both":
        return abs(difference)
    # What lies on the side without a limit does not deviate.
    return max(difference if side == "upper" else -difference, 0.0)
