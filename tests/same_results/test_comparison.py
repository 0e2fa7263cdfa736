"""The comparison of records tells rounding, wording and results apart, and each can be found."""

from typing import Any

import numpy as np
import pytest

from tests.same_results.comparison import Comparison, compare_arrays, compare_values


def measurement(**changes: Any) -> dict[str, Any]:
    return {"name": "offset", "value": 1.0, "standard_error": 0.1, "expected": 0.0, "tests": 1, **changes}


def record(**changes: Any) -> dict[str, Any]:
    result = {"check": "clocks.rate", "outcome": "passed", "reason": "", "measurements": [measurement(**changes)]}
    return {"path": "a.h5", "verdict": "clean", "results": [result], "run": {"seconds": 1.0}}


def kinds(before: Any, after: Any) -> list[str]:
    return [change.kind for change in compare_values("file", before, after)]


def test_the_same_record_has_no_change() -> None:
    assert kinds(record(), record()) == []


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"value": 1.0 + 5e-11}, "rounding"),
        ({"value": 1.0 + 2e-9}, "different"),
        ({"standard_error": 0.1 * (1 + 5e-10)}, "rounding"),
        ({"value": None}, "different"),
        ({"tests": 2}, "different"),
        ({"name": "rate"}, "different"),
    ],
)
def test_numbers_are_judged_by_their_standard_error(change: dict[str, Any], kind: str) -> None:
    """A billionth of the standard error is rounding, more is not; counts and names have no rounding."""
    assert set(kinds(record(), record(**change))) == {kind}


def test_words_are_no_result_and_outcomes_are() -> None:
    before, reworded, failed = record(), record(), record()
    reworded["results"][0]["reason"] = "other words"
    failed["results"][0]["outcome"] = "failed"
    assert kinds(before, reworded) == ["wording"]
    assert kinds(before, failed) == ["different"]


def test_a_missing_field_and_a_missing_result_are_different() -> None:
    before, less, none = record(), record(), record()
    del less["results"][0]["measurements"][0]["tests"]
    none["results"] = []
    assert kinds(before, less) == kinds(less, before) == ["different"]
    assert kinds(before, none) == ["different"]


def test_the_run_is_not_compared() -> None:
    other = record()
    other["run"] = {"seconds": 2.0}
    assert kinds(record(), other) == []


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        (np.array([1.0, np.nan]), []),
        (np.array([1.0 + 1e-12, np.nan]), ["rounding"]),
        (np.array([1.1, np.nan]), ["different"]),
        (np.array([1.0, np.nan], np.float32), ["different"]),
        (np.array([1.0]), ["different"]),
    ],
)
def test_arrays(after: np.ndarray, expected: list[str]) -> None:
    changes = compare_arrays({"a": np.array([1.0, np.nan])}, {"a": after})
    assert [change.kind for change in changes] == expected


def test_an_array_that_is_gone_is_different() -> None:
    assert [change.kind for change in compare_arrays({"a": np.zeros(2)}, {})] == ["different"]


def test_nothing_compared_is_not_the_same() -> None:
    """A run that compared no file proves nothing."""
    comparison = Comparison()
    assert not comparison.same
    comparison.add("a.h5", iter(()))
    assert comparison.same
