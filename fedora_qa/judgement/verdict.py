"""The verdict of a file, and what it rests on, from the results of its checks."""

from collections.abc import Iterable
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.record.types import Result, Verdict

INDEX_MAPS: Final = "index_maps."
"""Begins the names of the checks that compare an index map with the timestamps that it was made from."""


def crossing_streams(checks: Iterable[Check[Any]]) -> frozenset[str]:
    """Return the names of the checks that compare streams with each other."""
    return frozenset(check.name for check in checks if len(check.needs) > 1)


def comparisons_of(results: tuple[Result, ...], crossing: frozenset[str]) -> int:
    """Return how many checks compared streams with each other and came to an outcome."""
    return len(_conclusive(results) & crossing)


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
        ``crossing`` names checks and none of them passed or warned, those of index maps left out unless only these
        were selected; else ``clean``.
    """
    # Before findings: a check that crashed can have missed further ones.
    if any(result.outcome == "crashed" for result in results):
        return "incomplete"
    if any(result.outcome == "failed" for result in results):
        return "findings"
    # An index map repeats timestamps: it tells nothing of what the streams hold.
    beyond_maps = frozenset(name for name in crossing if not name.startswith(INDEX_MAPS)) or crossing
    # Without a conclusive comparison of streams, each stream was only tested by itself.
    if beyond_maps and not _conclusive(results) & beyond_maps:
        return "incomplete"
    return "clean"


def _conclusive(results: tuple[Result, ...]) -> frozenset[str]:
    return frozenset(result.check for result in results if result.outcome in {"passed", "warned"})
