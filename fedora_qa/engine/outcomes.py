"""Results for checks that measured nothing: not asked, not applicable, or crashed."""

from collections.abc import Iterable
from typing import Any

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Check
from fedora_qa.record.types import Result
from fedora_qa.sequence.facts import Facts


def why_not_applicable(check: Check[Any], facts: Facts) -> str:
    """Say which stream the check misses, or why its question cannot be asked of this file; empty where it can."""
    families = {stream_family(stream) for stream in facts.streams}
    missing = [stream for stream in check.needs if stream not in facts.streams and stream not in families]
    if missing:
        return "; ".join(
            f"the file has no {stream} ({facts.absent.get(stream, 'no rate of it')})" for stream in missing
        )
    return check.not_applicable(facts)


def not_applicable(check: Check[Any], reason: str) -> Result:
    """Return the result of a check whose question cannot be asked."""
    return Result(check=check.name, outcome="not_applicable", question=check.question, reason=reason)


def crashed(check: Check[Any], traceback: str) -> Result:
    """Return the result of a check that failed itself: never a silent pass."""
    last_line = traceback.strip().splitlines()[-1]
    return Result(
        check=check.name,
        outcome="crashed",
        question=check.question,
        reason=f"the check itself failed: {last_line}",
        traceback=traceback,
    )


def crossing_streams(checks: Iterable[Check[Any]]) -> frozenset[str]:
    """Return the names of the checks that hold one stream against another."""
    return frozenset(check.name for check in checks if len(check.needs) > 1)
