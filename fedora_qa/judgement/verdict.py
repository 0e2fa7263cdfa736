"""The verdict of a file, and what it rests on, from the results of its checks; the default false-alarm rate.

Two more places make a verdict ``incomplete``: ``engine/outcomes.py``, where nothing could be measured (no known
layout, a lost worker), and ``cli/check.py``, where the file changed. ``gating/verdict.py`` judges a release. This
file imports no code that judges, because options load it without.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Final

from fedora_qa.causes import stream_family
from fedora_qa.record.types import FileRecord, Result, Verdict
from fedora_qa.record.wording import SHORT_OF_COVERAGE

DEFAULT_FALSE_ALARM_RATE: Final = 1e-4
"""Probability that a correct file fails, shared by all comparisons of the file."""


INDEX_MAPS: Final = "index_maps."
"""Start of the names of the checks that compare an index map with the timestamps that it was made from."""


_OF_VALUES: Final = frozenset({"rgb", "depth", "events", "flow", "imu", "pose"})
"""Streams of values, which other streams confirm or contradict."""


def crossing_streams(needs: Mapping[str, Collection[str]]) -> frozenset[str]:
    """Return the names of the checks that compare streams with each other, by the streams that each check needs."""
    return frozenset(check for check, streams in needs.items() if len(streams) > 1)


def comparisons_of(results: tuple[Result, ...], crossing: frozenset[str]) -> int:
    """Return how many checks compared streams with each other and came to an outcome."""
    return len(_conclusive(results) & crossing)


def uncompared_streams(
    results: tuple[Result, ...], needs: Mapping[str, Collection[str]], streams: Collection[str]
) -> tuple[str, ...]:
    """Return the streams of a file that no check compared with another one and came to an outcome.

    Parameters
    ----------
    results
        Results of all checks of the file.
    needs
        Streams that each check needs, by its name.
    streams
        Of the file; all rates of flow are one stream.

    Returns
    -------
    tuple
        In alphabetical order. An index map repeats timestamps, and compares no stream.
    """
    compared = {
        stream_family(stream)
        for check in _conclusive(results) & crossing_streams(needs)
        if not check.startswith(INDEX_MAPS)
        for stream in needs[check]
    }
    return tuple(sorted({stream_family(stream) for stream in streams} & _OF_VALUES - compared))


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
    # An index map repeats timestamps, and does not depend on what the streams hold.
    of_values = frozenset(name for name in crossing if not name.startswith(INDEX_MAPS)) or crossing
    # Without a conclusive comparison of streams, each stream was only tested by itself.
    if of_values and not _conclusive(results) & of_values:
        return "incomplete"
    return "clean"


def with_required_coverage(file: FileRecord, required: Mapping[str, float]) -> FileRecord:
    """Return the record, incomplete where a check covers less of its stream than required; its reason then states so.

    Parameters
    ----------
    file
        The record of one file.
    required
        Least share, 0 to 1, by subject or check. Where both are named, that of the check counts.
    """
    results: list[Result] = []
    for result in file.results:
        # A check's own requirement overrides that of its subject; without either the required share is 0.
        least = required.get(result.check, required.get(result.check.partition(".")[0], 0.0))
        # A check without coverage, such as one that crashed, measured nothing: it meets no requirement above 0.
        share = result.coverage.share if result.coverage else 0.0
        if share >= least:
            results.append(result)
        else:
            short = f"saw {share:.3g} of its stream {SHORT_OF_COVERAGE} {least:.3g}"
            results.append(replace(result, reason="; ".join(filter(None, (result.reason, short)))))
    if tuple(results) == file.results:
        return file
    return replace(file, results=tuple(results), verdict="incomplete")


def _conclusive(results: tuple[Result, ...]) -> frozenset[str]:
    return frozenset(result.check for result in results if result.outcome in {"passed", "warned"})
