"""Outcomes of windows and files whose process died twice: they state it, and never give a clean verdict."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.digest import file_digest
from fedora_qa.engine.executors import DIED_TWICE
from fedora_qa.engine.options import FileRun
from fedora_qa.record.types import Coverage, FileRecord, Result
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span
from fedora_qa.storage.place import Place

NAME: Final = "windows"
QUESTION: Final = "Could every window be measured?"


def lost_windows(lost: Sequence[Span], of: int, facts: Facts) -> tuple[Result, ...]:
    """Return the result that names the windows that could not be measured; none where there are none."""
    if not lost:
        return ()
    first = lost[0]
    start_us, stop_us = (facts.to_file_us(time_ns) for time_ns in (first.start_ns, first.stop_ns))
    reason = (
        f"{len(lost)} of {of} windows were not seen by any check, as the process that measured one {DIED_TWICE}; "
        f"the first is from {start_us:.0f} to {stop_us:.0f} us"
    )
    return (Result(NAME, "crashed", QUESTION, coverage=Coverage(of - len(lost), of, "windows"), reason=reason),)


def lost_file(path: Place, checks: Iterable[Check[Any]], doing: str, end: str) -> FileRun:
    """Return the run of a file that no process could open, or judge: every check crashed.

    ``doing`` and ``end`` are parts of the reason: the step that failed, and how its process ended.
    """
    # Reads bytes only, not through HDF5, which may have ended the processes before.
    digest = file_digest(path)
    reason = f"the process by which it was {doing} {end}"
    return FileRun(
        FileRecord(
            path=str(path),
            size=digest.version.size,
            sha256=digest.sha256,
            digest_kind=digest.kind,
            dialect="",
            inferred={},
            statistics={},
            verdict="incomplete",
            results=tuple(Result(check.name, "crashed", check.question, reason=reason) for check in checks),
        )
    )
