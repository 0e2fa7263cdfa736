"""The statistics of a file in two versions: which of them moved beyond their error."""

from collections.abc import Iterator, Mapping
from math import erfc, hypot, isfinite, sqrt
from typing import Final

from fedora_qa.comparison.types import StatisticChange
from fedora_qa.record.types import Scalar

Statistics = Mapping[str, Mapping[str, Scalar]]

_ERROR: Final = "_standard_error"


def statistic_changes(file: str, before: Statistics, after: Statistics, level: float) -> Iterator[StatisticChange]:
    """Yield every number that is not the same in both; see ``with_errors`` for those that are tests."""
    for name, (first, other) in _numbers(before, after).items():
        if first == other:
            continue
        error = _error(name, before, after)
        if error is None or first is None or other is None:
            yield StatisticChange(file, name, first, other, None, None, "changed")
            continue
        # P(|z| > x) = erfc(x / sqrt 2) of a normal difference; without an error any difference is certain.
        chance = erfc(abs(other - first) / (error * sqrt(2))) if error else 0.0
        yield StatisticChange(file, name, first, other, error, chance, "moved" if chance <= level else "within_error")


def with_errors(before: Statistics, after: Statistics) -> int:
    """Return how many statistics have a standard error on both sides: each is a test of whether it moved."""
    return sum(_error(name, before, after) is not None for name in _numbers(before, after))


def _numbers(before: Statistics, after: Statistics) -> dict[str, tuple[float | None, float | None]]:
    """Return the numbers of both by ``group.name``, without the errors; None where one side has none."""
    named: dict[str, tuple[float | None, float | None]] = {}
    for group in dict.fromkeys([*before, *after]):
        first, other = before.get(group, {}), after.get(group, {})
        for key in dict.fromkeys([*first, *other]):
            values = _number(first.get(key)), _number(other.get(key))
            if _ERROR not in key and values != (None, None):
                named[f"{group}.{key}"] = values
    return named


def _error(name: str, before: Statistics, after: Statistics) -> float | None:
    """Return the standard error of the difference; None where either side has none."""
    group, _, key = name.rpartition(".")
    errors = [_error_of(side.get(group, {}), key) for side in (before, after)]
    finite_errors = [error for error in errors if error is not None]
    # The errors of two versions are independent: variances add.
    error = hypot(*finite_errors)
    return error if len(finite_errors) == len(errors) and isfinite(error) else None


def _error_of(group: Mapping[str, Scalar], key: str) -> float | None:
    """Return the error of a statistic: of ``speed_max_m_s`` it is ``speed_max_standard_error_m_s``."""
    return next((_number(v) for name, v in group.items() if _ERROR in name and name.replace(_ERROR, "") == key), None)


def _number(value: Scalar) -> float | None:
    return None if isinstance(value, bool | str) or value is None else float(value)
