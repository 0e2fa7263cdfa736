"""The verdict of a file, from the results of its checks."""

from collections.abc import Iterable
from typing import Any

from fedora_qa.checks.protocol import Check
from fedora_qa.record.types import Result, Verdict


def crossing_streams(checks: Iterable[Check[Any]]) -> frozenset[str]:
    """Return the names of the checks that compare streams with each other."""
    return frozenset(check.name for check in checks if len(check.needs) > 1)


def verdict_of(results: tuple[Result, ...], crossing: frozenset[str]) -> Verdict:
    """Return the verdict: incomplete where a check crashed or no streams could be compared."""
    # Before findings: a crashed check might have given further ones.
    if any(result.outcome == "crashed" for result in results):
        return "incomplete"
    if any(result.outcome == "failed" for result in results):
        return "findings"
    conclusive = {"passed", "warned"}
    # Without a conclusive comparison of streams nothing was tested beyond each stream by itself.
    if crossing and not any(result.outcome in conclusive and result.check in crossing for result in results):
        return "incomplete"
    return "clean"
