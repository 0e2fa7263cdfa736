"""Results beside those that checks measured: of lost windows, of files that do not open, of questions not asked."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.measure import PassState
from fedora_qa.engine.options import DIED_TWICE, record_without_facts
from fedora_qa.judgement.judge import Judged
from fedora_qa.record.types import Coverage, Diagnosis, FileRecord, Finding, Result, Where
from fedora_qa.record.wording import not_recognised
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span
from fedora_qa.storage.digest import Digest
from fedora_qa.storage.place import Place

_READING_CHECK: Final = "integrity.readable"
"""The check that fails on a file which cannot be opened."""

LOST_WINDOWS: Final = "windows"
"""Name of the result that states which windows could not be measured."""

_COULD_BE_MEASURED: Final = "Could every window be measured?"

_COLLECTORS: Final[Mapping[str, str]] = {
    "statistics": "What do the streams hold?",
    "evidence": "What would a person want to see?",
    "distributions": "How are values distributed over time?",
}
"""Collectors beside the checks, and the question that each answers. Where one crashes, a result states it."""


def why_not_applicable(check: Check[Any], facts: Facts) -> str:
    """Return which stream the check lacks, or why its question cannot be asked of this file; empty where it can."""
    families = {stream_family(stream) for stream in facts.streams}
    # A check that needs ``flow`` is served by any rate, as each ``flow/<rate>`` belongs to that family.
    missing = [stream for stream in check.needs if stream not in facts.streams and stream not in families]
    if missing:
        return "; ".join(
            f"the file has no {stream} ({facts.absent.get(stream, 'no rate of it')})" for stream in missing
        )
    try:
        return check.not_applicable(facts)
    # It counts as applicable for now: the same call fails again in ``measure.start``, which notes the crash.
    except Exception:  # noqa: BLE001 - it is asked, and crashes as it starts, where that becomes an outcome
        return ""


def not_applicable(check: Check[Any], reason: str) -> Result:
    """Return the result of a check whose question cannot be asked."""
    return Result(check=check.name, outcome="not_applicable", question=check.question, reason=reason)


def crashed_result(name: str, question: str, traceback: str) -> Result:
    """Return the result of what failed itself: never a silent pass."""
    last_line = traceback.strip().splitlines()[-1]
    reason = f"the check itself failed: {last_line}"
    return Result(name, "crashed", question, reason=reason, traceback=traceback)


def results_in_order(
    checks: tuple[Check[Any], ...], judged: tuple[Judged, ...], states: PassState, reasons: Mapping[str, str]
) -> tuple[Result, ...]:
    """Return the result of every check in order, and of each collector that crashed."""
    by_name: dict[str, Result] = {}
    for judged_check in judged:
        result = judged_check.result
        if missed := states.missed.get(result.check, 0):
            note = f"{missed} windows were not seen because their rows cannot be decoded (see integrity.readable)"
            result = replace(result, reason="; ".join(filter(None, (result.reason, note))))
        by_name[result.check] = result
    results: list[Result] = []
    for check in checks:
        if check.name in by_name:
            results.append(by_name[check.name])
        elif check.name in states.crashes:
            results.append(crashed_result(check.name, check.question, states.crashes[check.name]))
        else:
            results.append(not_applicable(check, reasons[check.name]))
    results += [
        crashed_result(name, _COLLECTORS[name], states.crashes[name]) for name in _COLLECTORS if name in states.crashes
    ]
    return tuple(results)


def unreadable_record(path: Place, digest: Digest, checks: Iterable[Check[Any]], reason: str) -> FileRecord:
    """Return the record of a file that begins like HDF5 and cannot be opened: a failed integrity, and nothing else.

    Parameters
    ----------
    digest
        Of its bytes.
    checks
        All that were selected; those other than ``integrity.readable`` are not applicable.
    """
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
        confidence=0.0,
        where=Where(),
        remedy=CAUSES[cause].remedy,
        explains=("F1",),
        # HDF5 compares lengths itself; of damage it states only that something does not fit.
        status="supported" if cause == "truncated" else "suggested",
    )
    results = []
    for check in checks:
        result = not_applicable(check, "the file cannot be opened")
        if check.name == _READING_CHECK:
            result = replace(result, outcome="failed", reason="", findings=(finding,), coverage=Coverage(0, 1, "files"))
        results.append(result)
    return record_without_facts(path, digest, "findings", tuple(results), (diagnosis,))


def unrecognised_record(path: Place, digest: Digest, checks: Iterable[Check[Any]]) -> FileRecord:
    """Return the record of a file of which no dialect describes anything: no question can be asked of it.

    Parameters
    ----------
    digest
        Of its bytes.
    """
    reason = not_recognised(path)
    return record_without_facts(path, digest, "incomplete", tuple(not_applicable(check, reason) for check in checks))


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
    return (
        Result(
            LOST_WINDOWS, "crashed", _COULD_BE_MEASURED, coverage=Coverage(of - len(lost), of, "windows"), reason=reason
        ),
    )
