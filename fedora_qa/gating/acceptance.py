"""Which findings of a release count: severities by policy, waivers until a day, and the baseline.

Findings of an earlier gate are known (the baseline); new ones, and known ones that have grown worse, are not. A waiver
that is not needed, or has expired, is a finding.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date
from statistics import NormalDist
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field

from fedora_qa.causes import CAUSES, STREAMS
from fedora_qa.check_names import subject_of
from fedora_qa.errors import MisuseError, did_you_mean
from fedora_qa.gating.release import ReleaseResult, Violation
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.record.types import (
    FOLDER,
    GRAVE,
    IMMATERIAL,
    FileRecord,
    Finding,
    Measurement,
    Record,
    Result,
    Severity,
    Waived,
    names_in_release,
)

Mark = Callable[[Result, Finding], Finding]
"""Returns a finding with the severity and message that it is to have."""

NonEmpty = Annotated[str, Field(min_length=1)]

_KNOWN_SEVERITIES = GRAVE | {"warning"}
"""Severities of an earlier record's findings that count as known. Waived findings are information and do not."""

Key = tuple[str, str, str, str | None, str]
"""Name of the file, check, code, stream; and of a rule about the release its message, which holds no noise."""


def _mark_findings(file: FileRecord, mark: Mark) -> FileRecord:
    """Return the file with all findings changed by ``mark``; a check fails where a finding is grave, and else warns."""
    results = []
    for result in file.results:
        findings = tuple(mark(result, finding) for finding in result.findings)
        if findings == result.findings:
            results.append(result)
        # A check that crashed or could not measure keeps its outcome, whatever the severity of its findings.
        elif result.outcome not in {"failed", "warned"}:
            results.append(replace(result, findings=findings))
        else:
            grave = any(finding.severity in GRAVE for finding in findings)
            results.append(replace(result, findings=findings, outcome="failed" if grave else "warned"))
    return replace(file, results=tuple(results))


def with_severity(
    file: FileRecord, severity: Mapping[str, Severity], fail_on: Literal["failed", "warned"]
) -> FileRecord:
    """Return the file with the severities of the policy.

    Parameters
    ----------
    severity
        By subject or check. Where both are named, the check counts.
    fail_on
        ``warned``: a warning of a check is an error unless ``severity`` sets another severity.

    Returns
    -------
    FileRecord
        Deviations that are not material stay information: the profile of the policy decides about them.
    """

    def mark(result: Result, finding: Finding) -> Finding:
        if finding.code == f"{result.check}.{IMMATERIAL}":
            return finding
        subject = subject_of(result.check)
        named = severity.get(result.check, severity.get(subject))
        unnamed: Severity = "error" if fail_on == "warned" and result.outcome == "warned" else finding.severity
        return replace(finding, severity=named or unnamed)

    return _mark_findings(file, mark)


@dataclass(frozen=True, slots=True)
class Waiver:
    """A finding that is accepted: of one check, in one file, of one rule or with one cause."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    file: NonEmpty
    """Name of the sequence in the release; ``.`` is the release itself."""
    check: NonEmpty
    """The check whose finding it is."""
    reason: NonEmpty
    """Why it is accepted."""
    owner: NonEmpty
    """Who is responsible for that."""
    expires: date
    """The last day on which the waiver is valid."""
    code: NonEmpty | None = None
    """The rule that may be broken; or else ``cause``."""
    cause: NonEmpty | None = None
    """The probable cause, as ``stream:cause``, in place of a rule."""

    def __post_init__(self) -> None:
        if (self.code is None) == (self.cause is None):
            raise ValueError("a waiver names either a code or a cause")

    def covers(self, name: str, file: FileRecord, result: Result, finding: Finding) -> bool:
        """Whether the waiver is for this finding; ``name`` is the name of the file in the release."""
        if (self.file, self.check) != (name, result.check):
            return False
        if self.code is not None:
            return finding.code == self.code
        return any(
            self.cause == f"{diagnosis.stream}:{diagnosis.cause}" and finding.id in diagnosis.explains
            for diagnosis in file.diagnoses
        )


def require_legal_names(waiver: Waiver, checks: Collection[str]) -> None:
    """Raise ``MisuseError`` for a check, rule or cause that does not exist: such a waiver never covers a finding."""
    where = f"in the waiver of {waiver.owner} for {waiver.file}"
    if waiver.check not in checks:
        raise MisuseError(f"Expected a check {where}, got {waiver.check!r}{did_you_mean(waiver.check, checks)}")
    # A code is the name of its check and that of a rule.
    if waiver.code is not None and not waiver.code.startswith(f"{waiver.check}."):
        raise MisuseError(f"Expected a code that begins with {waiver.check}. {where}, got {waiver.code!r}")
    if waiver.cause is not None:
        stream, _, cause = waiver.cause.partition(":")
        if cause not in CAUSES or not (stream in STREAMS or is_flow_stream(stream)):
            legal = [f"{stream}:{cause.identifier}" for cause in CAUSES.values() for stream in cause.streams]
            raise MisuseError(
                f"Expected a cause such as events:time_offset {where}, got {waiver.cause!r}"
                f"{did_you_mean(waiver.cause, legal)}"
            )


def waive(name: str, file: FileRecord, waivers: Iterable[Waiver], today: date) -> FileRecord:
    """Return the file with waived findings as information: who waived them, why, and until when."""
    # The day of expiry is the last on which a waiver holds.
    valid = [waiver for waiver in waivers if waiver.expires >= today]

    def mark(result: Result, finding: Finding) -> Finding:
        for waiver in valid:
            if waiver.covers(name, file, result, finding):
                message = f"{finding.message} Waived until {waiver.expires} by {waiver.owner}: {waiver.reason}"
                waived = Waived(waiver.owner, waiver.reason, waiver.expires.isoformat())
                return replace(finding, severity="info", message=message, waived=waived)
        return finding

    return _mark_findings(file, mark)


def rule_on_waivers(files: Iterable[tuple[str, FileRecord]], waivers: Iterable[Waiver], today: date) -> ReleaseResult:
    """Every waiver is needed, and none has expired."""
    question = "Is every waiver needed, and none expired?"
    named, waivers, violations = tuple(files), tuple(waivers), []
    if not waivers:
        return ReleaseResult("release.waivers", question, FOLDER, not_applicable="the policy has no waivers")
    for waiver in waivers:
        what = f"the waiver of {waiver.owner} for {waiver.code or waiver.cause} in {waiver.file}"
        if waiver.expires < today:
            message = f"Expected waivers that hold, got one that expired on {waiver.expires}: {what}"
            violations.append(Violation(FOLDER, "expired", message))
        elif not any(
            waiver.covers(name, file, result, finding)
            for name, file in named
            for result in file.results
            for finding in result.findings
        ):
            message = f"Expected waivers that are needed, got one that covers no finding: {what}; remove it"
            violations.append(Violation(FOLDER, "unused", message))
    return ReleaseResult("release.waivers", question, FOLDER, tuple(violations))


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

    return _mark_findings(file, mark)


def _keys(name: str, result: Result, finding: Finding) -> tuple[Key, ...]:
    """Return a key for each place of a finding."""
    message = finding.message.removesuffix(" Known from the baseline.") if result.check.startswith("release.") else ""
    return tuple((name, result.check, finding.code, where.stream, message) for where in finding.all_places)


def _farther_out(now: Measurement, before: Measurement, sigmas: float) -> bool:
    """Whether a value lies farther out than before; what is not a number lies farther out than every number."""
    if now.value is None or before.value is None:
        return now.value is None and before.value is not None
    deviation, earlier = now.counted_deviation, before.counted_deviation
    if deviation is None or earlier is None:
        return False
    # Variances of both deviations add; ``sigmas`` is the one-sided quantile at the shared rate.
    return deviation - earlier > sigmas * math.hypot(now.standard_error or 0.0, before.standard_error or 0.0)
