"""Arrays are found by their names, and only where they are what was promised."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_reports.evidence import Evidence, evidence_of, finite
from fedora_reports.maps import exhibits, value_map
from tests.support.records import file_record, passed, record


@pytest.mark.parametrize(
    ("array", "shape", "found"),
    [
        (np.zeros((3, 2)), (3, 2), True),
        (np.zeros((3, 2)), (None, 2), True),
        (np.zeros((3, 2), np.bool_), (None, None), True),
        (np.float64(4.0), (), True),
        (np.zeros((3, 2)), (None,), False),
        (np.zeros((3, 2)), (2, 2), False),
        (np.zeros((0, 2)), (None, 2), False),
        (np.array(["a", "b"]), (None,), False),
        (np.zeros(2, complex), (None,), False),
    ],
)
def test_numbers_of_the_promised_shape_are_found(array: np.ndarray, shape: tuple[int | None, ...], found: bool) -> None:
    """Any length stands for one of at least 1; text and complex numbers cannot be drawn."""
    evidence = Evidence({"a": np.asarray(array)}, {})
    assert (evidence.numbers("a", *shape) is not None) is found
    assert evidence.numbers("b", *shape) is None


def test_evidence_of_one_file_has_bare_names() -> None:
    """With one file nothing precedes the names."""
    arrays = {"0/x": np.zeros(1), "x": np.ones(1)}
    assert evidence_of(record(), 0, arrays).names() == ("0/x", "x")


def test_evidence_of_several_files_is_told_apart() -> None:
    """With several, each file sees its own arrays under their bare names."""
    both = record(file_record(passed()), file_record(passed()))
    arrays = {"0/x": np.zeros(1), "1/x": np.ones(1), "1/y": np.ones(1), "10/x": np.ones(1), "x": np.ones(1)}
    assert evidence_of(both, 0, arrays).names() == ("x",)
    assert evidence_of(both, 1, arrays).names() == ("x", "y")


def test_titles_of_several_files_are_told_apart() -> None:
    """The record precedes the names of titles like those of arrays; a file sees both without."""
    named = [replace(file_record(passed()), evidence={f"{k}/x": f"X of {k}"}) for k in (0, 1)]
    evidence = evidence_of(record(*named), 1, {"1/x": np.ones(1)})
    assert (evidence.title("x"), evidence.missing) == ("X of 1", ())


def test_names_follow_the_record() -> None:
    """Promised arrays come first, in the record's order; titles stand for them, and what is missing is named."""
    evidence = Evidence({"a": np.zeros(1), "c/x": np.zeros(1), "c/y": np.zeros(1)}, {"c/y": "Y, m", "gone": "Gone"})
    assert evidence.names() == ("c/y", "a", "c/x")
    assert tuple(evidence.under("c")) == ("c/y", "c/x")
    assert (evidence.title("c/y"), evidence.title("a")) == ("Y, m", "a")
    assert evidence.missing == ("gone",)


def test_finite_leaves_out_what_is_not_a_number() -> None:
    """NaN and infinity are no numbers to scale by."""
    np.testing.assert_array_equal(finite(np.array([[1, np.nan], [np.inf, 2]])), [1, 2])


def test_pairs_are_series_planes_are_maps_and_the_rest_is_named() -> None:
    """What cannot be drawn is not kept silent."""
    arrays = {"a": np.zeros((5, 2)), "b": np.zeros((4, 6)), "c": np.zeros(3), "d": np.full((3, 2), np.nan)}
    shown = exhibits(Evidence(arrays, {"b": "A map [px]"}), ("a", "b", "c", "d"))
    assert ([chart.title for chart in shown.charts], [one.title for one in shown.maps]) == (["a"], ["A map [px]"])
    assert shown.undrawn == ("c", "d")


def test_signed_maps_are_centred_on_zero() -> None:
    """Where both signs occur, the bar reaches equally far to either side; else from least to greatest."""
    signed = value_map(np.array([[-1.0, 4.0]]), "Residual [px]")
    positive = value_map(np.array([[1.0, 4.0]]), "Count")
    assert signed.bar is not None
    assert positive.bar is not None
    assert [signed.bar.ticks[0].label, signed.bar.ticks[-1].label] == ["-4", "4"]
    assert [positive.bar.ticks[0].label, positive.bar.ticks[-1].label] == ["1", "4"]
    assert signed.caption == "-1 to 4"


def test_map_of_nothing_says_so() -> None:
    """A map without any value is grey and has no bar."""
    empty = value_map(np.full((2, 3), np.nan), "Residual [px]")
    assert (empty.caption, empty.bar) == ("no value anywhere", None)
