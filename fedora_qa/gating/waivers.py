"""Waivers: findings that somebody accepts until a day. A waiver that is not needed, or has expired, is a finding."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from datetime import date
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from fedora_qa.causes import CAUSES, STREAMS
from fedora_qa.errors import MisuseError, did_you_mean
from fedora_qa.gating.release_result import ReleaseResult, Violation
from fedora_qa.gating.severity_override import mark_findings
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.record.several_files import FOLDER
from fedora_qa.record.types import FileRecord, Finding, Result, Waived

NonEmpty = Annotated[str, Field(min_length=1)]


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
    """Raise ``MisuseError`` for a check, rule or cause that does not exist: such a waiver would never cover a finding.

    Parameters
    ----------
    checks
        Names of all checks, and of the rules about a release.
    """
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

    return mark_findings(file, mark)


def rule_on_waivers(files: Iterable[tuple[str, FileRecord]], waivers: Iterable[Waiver], today: date) -> ReleaseResult:
    """Every waiver is needed, and none has expired.

    Parameters
    ----------
    files
        Name and record of every file, before anything was waived.
    """
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
