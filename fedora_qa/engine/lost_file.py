"""The run of a file that could not be opened or judged, and the record of a file of which nothing was measured."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.check_names import selected_explanations
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.record.types import Diagnosis, FileRecord, Result, Verdict
from fedora_qa.storage.digest import Digest, file_digest
from fedora_qa.storage.place import Place

if TYPE_CHECKING:  # loads what measures
    from fedora_qa.checks.protocol import Check

DIED_TWICE: Final = "died twice over it (out of memory, or a library crashed)"
ENDLESS: Final = "did not come to an end, and was ended"
"""How the processes that did a task ended, as a record states it."""


def lost_file(
    path: Place, checks: "Iterable[Check[Any]] | None", options: CheckOptions, doing: str, end: str
) -> FileRun:
    """Return the run of a file that no process could open, or judge: every check crashed.

    Parameters
    ----------
    checks
        None: those that the options select.
    doing, end
        Parts of the reason: the step that failed, and how its process ended.
    """
    if checks is None:
        selected = selected_explanations(options.select, options.ignore)
        questions = {explanation.check: explanation.question for explanation in selected}
    else:
        questions = {check.name: check.question for check in checks}
    # Reads bytes only, not through HDF5, which may have ended the processes before.
    digest = file_digest(path)
    reason = f"the process by which it was {doing} {end}"
    results = tuple(Result(name, "crashed", question, reason=reason) for name, question in questions.items())
    return FileRun(record_without_facts(path, digest, "incomplete", results))


def record_without_facts(
    path: Place, digest: Digest, verdict: Verdict, results: tuple[Result, ...], diagnoses: tuple[Diagnosis, ...] = ()
) -> FileRecord:
    """Return the record of a file of which nothing was measured."""
    return FileRecord(
        path=str(path),
        size=digest.version.size,
        sha256=digest.sha256,
        digest_kind=digest.kind,
        dialect="",
        inferred={},
        statistics={},
        verdict=verdict,
        results=results,
        diagnoses=diagnoses,
    )
