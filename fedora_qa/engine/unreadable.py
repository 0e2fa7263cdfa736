"""The record of a file that begins like HDF5 and cannot be opened: a failed integrity, and nothing else."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Final

from fedora_qa.causes import CAUSES
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.digest import Digest
from fedora_qa.engine.outcomes import not_applicable
from fedora_qa.record.types import Coverage, Diagnosis, FileRecord, Finding, Result, Where
from fedora_qa.storage.place import Place

_TELLING_CHECK: Final = "integrity.readable"


def unreadable_record(path: Place, digest: Digest, checks: Iterable[Check[Any]], reason: str) -> FileRecord:
    """Return the record of a file that HDF5 refuses to open; ``reason`` is its message."""
    finding = Finding("F1", "integrity.readable.file", "critical", reason, Where())
    # HDF5 compares the stated length of a file with its actual one, and names it truncated; other errors are damage.
    cause = "truncated" if "truncated" in reason else "corrupt_chunk"
    diagnosis = Diagnosis(
        id="D1",
        cause=cause,
        stream="file",
        magnitude=None,
        unit="",
        standard_error=None,
        confidence=1.0 if cause == "truncated" else 0.5,
        where=Where(),
        remedy=CAUSES[cause].remedy,
        explains=("F1",),
    )
    return FileRecord(
        path=str(path),
        size=digest.version.size,
        sha256=digest.sha256,
        digest_kind=digest.kind,
        dialect="",
        inferred={},
        statistics={},
        verdict="findings",
        results=tuple(_result(check, finding) for check in checks),
        diagnoses=(diagnosis,),
    )


def _result(check: Check[Any], finding: Finding) -> Result:
    result = not_applicable(check, "the file cannot be opened")
    if check.name != _TELLING_CHECK:
        return result
    return replace(result, outcome="failed", reason="", findings=(finding,), coverage=Coverage(0, 1, "files"))
