"""From judgements to the results of all checks, with those of checks that measured nothing."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.stream import PassState
from fedora_qa.judgement.judge import Judged
from fedora_qa.record.types import Result
from fedora_qa.sequence.facts import Facts

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
    # It counts as applicable for now: the same call fails again in ``stream.start``, which notes the crash.
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
