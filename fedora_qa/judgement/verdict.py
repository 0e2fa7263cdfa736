"""The verdict of a file, from the results of its checks."""

from collections.abc import Iterable
from typing import Any

from fedora_qa.checks.protocol import Check
from fedora_qa.record.types import Result, Verdict


def crossing_streams(checks: Iterable[Check[Any]]) -> frozenset[str]:
    """Return the names of the checks that compare streams with each other."""
    return frozenset(check.name for check in checks if len(check.needs) > 1)


def verdict_of(results: tuple[Result, ...], crossing: frozenset[str]) -> Verdict:
    """Return the verdict of a file.

    Parameters
    ----------
    results
        Results of all checks of the file.
    crossing
        Names of the checks that compare streams with each other, from ``crossing_streams``.

    Returns
    -------
    Verdict
        ``incomplete`` where a check crashed; else ``findings`` where a check failed; else ``incomplete`` where
        ``crossing`` names checks and none of them passed or warned; else ``clean``.
    """
    # Before findings: a check that crashed can have missed further ones.
    if any(result.outcome == "crashed" for result in results):
        return "incomplete"
    if any(result.outcome == "failed" for result in results):
        return "findings"
    conclusive = {"passed", "warned"}
    # Without a conclusive comparison of streams, each stream was only tested by itself.
    if crossing and not any(result.outcome in conclusive and result.check in crossing for result in results):
        return "incomplete"
    return "clean"
