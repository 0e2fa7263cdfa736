"""Hold a record to the coverage that the configuration requires."""

from collections.abc import Mapping
from dataclasses import replace

from fedora_qa.record.types import FileRecord, Result
from fedora_qa.record.wording import SHORT_OF_COVERAGE


def hold_to_coverage(file: FileRecord, required: Mapping[str, float]) -> FileRecord:
    """Return the record, incomplete where a check covers less of its stream than required; its reason then states so.

    Parameters
    ----------
    file
        The record of one file.
    required
        Least share, 0 to 1, by subject or check. Where both are named, the check counts.
    """
    # A check's own requirement overrides that of its subject; without either the required share is 0.
    results = tuple(
        _held(result, required.get(result.check, required.get(result.check.partition(".")[0], 0.0)))
        for result in file.results
    )
    if results == file.results:
        return file
    return replace(file, results=results, verdict="incomplete")


def _held(result: Result, required: float) -> Result:
    # A check without coverage (it crashed, say) measured nothing, so that it meets no requirement above 0.
    share = result.coverage.share if result.coverage else 0.0
    if share >= required:
        return result
    short = f"saw {share:.3g} of its stream {SHORT_OF_COVERAGE} {required:.3g}"
    return replace(result, reason="; ".join(filter(None, (result.reason, short))))
