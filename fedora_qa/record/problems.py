"""A flat list of the problems of a file, as CI systems show it. Their levels give the same verdict in every format."""

from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.record.types import FileRecord, Severity, Waived, Where
from fedora_qa.record.wording import cause_sentence, why_incomplete

Level = Literal["error", "warning", "note"]

INCOMPLETE: Final = "incomplete"
"""Code of the problem of an incomplete file: it is no finding, but too little of the file was measured."""

# GitHub has three kinds of annotations, the record four severities.
_LEVELS: Final[dict[Severity, Level]] = {"critical": "error", "error": "error", "warning": "warning", "info": "note"}


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing to show about a file.

    A file with a problem of level ``error`` is not clean: incomplete where one has the code ``INCOMPLETE``, else with
    findings. ``code`` is the rule, ``check`` its check (empty for ``INCOMPLETE``), ``waived`` who accepts it.
    """

    path: str
    check: str
    code: str
    level: Level
    message: str
    where: Where
    waived: Waived | None = None


def problems_of(file: FileRecord) -> tuple[Problem, ...]:
    """Return the problems of a file, in the order of its checks, and last whether it is incomplete."""
    problems: list[Problem] = []
    for result in file.results:
        failed, has_error = result.outcome == "failed", False
        for finding in result.findings:
            level = _LEVELS[finding.severity]
            # `critical` and `error` of a check that did not fail would contradict the verdict of the file.
            level = "warning" if level == "error" and not failed else level
            has_error |= level == "error"
            causes = [
                f"Probable cause: {cause_sentence(diagnosis)}. {diagnosis.remedy}"
                for diagnosis in file.diagnoses
                if finding.id in diagnosis.explains
            ]
            problems.append(
                Problem(
                    path=file.path,
                    check=result.check,
                    code=finding.code or result.check,
                    level=level,
                    message=" ".join((finding.message, *causes)),
                    where=finding.where,
                    waived=finding.waived,
                )
            )
        # A failed check without a finding of that level must still fail the build.
        if failed and not has_error:
            message = f"The check failed: {result.reason or result.question}"
            problems.append(Problem(file.path, result.check, result.check, "error", message, Where()))
    crashed = [result.check for result in file.results if result.outcome == "crashed"]
    why = why_incomplete(file) or (f"crashed: {', '.join(crashed)}" if crashed else "")
    if why:
        problems.append(Problem(file.path, "", INCOMPLETE, "error", f"The check is incomplete: {why}.", Where()))
    return tuple(problems)
