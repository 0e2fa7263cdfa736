"""The rule about what a release amounts to."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from fedora_qa.gate.policy import Bounds, Total
from fedora_qa.gate.release import FOLDER
from fedora_qa.gate.release_result import ReleaseResult, Violation
from fedora_qa.record.types import FileRecord
from fedora_qa.record.wording import number

_STATISTICS: Final[Mapping[Total, tuple[str, str]]] = {
    "duration_s": ("sequence", "duration_s"),
    "distance_m": ("motion", "distance_m"),
    "events": ("events", "count"),
}
"""Group and name of the statistic that is summed."""


def rule_on_totals(files: Sequence[FileRecord], totals: Mapping[Total, Bounds]) -> ReleaseResult:
    """Sum over all sequences, and compare each sum with its bounds."""
    violations = [violation for total, bounds in totals.items() for violation in _out_of_bounds(files, total, bounds)]
    return ReleaseResult("release.totals", "Does the release amount to what it should?", FOLDER, tuple(violations))


def _out_of_bounds(files: Sequence[FileRecord], total: Total, bounds: Bounds) -> Iterator[Violation]:
    amount = amount_of(files, total)
    if amount is None:
        yield Violation(FOLDER, total, f"Expected to sum {total}, got a sequence whose statistics do not tell it")
    elif bounds.least is not None and amount < bounds.least:
        yield Violation(FOLDER, total, f"Expected {total} of at least {number(bounds.least)}, got {number(amount)}")
    elif bounds.most is not None and amount > bounds.most:
        yield Violation(FOLDER, total, f"Expected {total} of at most {number(bounds.most)}, got {number(amount)}")


def amount_of(files: Sequence[FileRecord], total: Total) -> float | None:
    """Return the sum over all sequences, in the unit of the total; None where one of them lacks the statistic."""
    if total == "sequences":
        return float(len(files))
    if total == "bytes":
        return float(sum(file.size for file in files))
    group, name = _STATISTICS[total]
    values = [file.statistics.get(group, {}).get(name) for file in files]
    # A sum that lacks a sequence would look like a smaller release.
    if any(not isinstance(value, int | float) for value in values):
        return None
    return float(sum(value for value in values if isinstance(value, int | float)))
