"""Axes place values in order, and their ticks lie at round numbers."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from fedora_reports.scales import Axis

finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(1e-300, 1e300)


@given(finite, finite, st.lists(finite, min_size=1, max_size=5))
def test_shares_keep_the_order_and_stay_on_the_drawing(low: float, high: float, values: list[float]) -> None:
    """Greater values never lie further left, and none lies outside."""
    assume(low <= high)
    shares = Axis(low, high).shares(np.sort(values))
    assert ((shares >= 0) & (shares <= 1)).all()
    assert (np.diff(shares) >= 0).all()


@given(finite, finite)
@example(-5e-324, 0.0)
def test_ticks_lie_in_order_on_an_even_axis(low: float, high: float) -> None:
    """There is at least one tick, a few at most, and all lie on the axis."""
    assume(low <= high)
    shares = [tick.share for tick in Axis(low, high).ticks()]
    assert 1 <= len(shares) <= 9
    assert shares == sorted(shares)


@given(positive, positive)
def test_ticks_lie_in_order_on_a_logarithmic_axis(low: float, high: float) -> None:
    """The same on a logarithmic axis."""
    assume(low <= high)
    shares = [tick.share for tick in Axis(low, high, logarithmic=True).ticks()]
    assert 1 <= len(shares) <= 9
    assert shares == sorted(shares)


@pytest.mark.parametrize(
    ("axis", "labels"),
    [
        (Axis(0.0, 1.0), ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        (Axis(0.0, 1.005), ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        (Axis(-3.0, 3.0), ["-3", "-2", "-1", "0", "1", "2", "3"]),
        (Axis(0.0, 1e7), ["0", "2000000", "4000000", "6000000", "8000000", "1e+07"]),
        (Axis(0.1, 30.0, logarithmic=True), ["0.1", "0.3", "1", "3", "10", "30"]),
        (Axis(3.1, 29.0, logarithmic=True), ["5", "7", "10", "20"]),
        (Axis(2.0, 2.0), ["2"]),
    ],
)
def test_ticks_are_round(axis: Axis, labels: list[str]) -> None:
    """Labels are what a person would write."""
    assert [tick.label for tick in axis.ticks()] == labels


def test_a_decade_is_as_long_as_the_next() -> None:
    """On a logarithmic axis equal factors are equally far apart."""
    shares = Axis(0.1, 100.0, logarithmic=True).shares(np.array([0.1, 1.0, 10.0, 100.0, 0.0, math.nan]))
    np.testing.assert_allclose(shares, [0, 1 / 3, 2 / 3, 1, 0, np.nan], atol=1e-12)


def test_single_value_lies_in_the_middle() -> None:
    """An axis without length puts everything in its middle, and NaN nowhere."""
    np.testing.assert_array_equal(Axis(5.0, 5.0).shares(np.array([5.0, np.nan])), [0.5, np.nan])
