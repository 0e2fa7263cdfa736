"""The way of the weights from one order of channels to another."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.event_colours import (
    LEVEL_BIAS,
    WRONG_ORDERS,
    ChannelWeightErrors,
    ColourEstimate,
    ColourFit,
    nearest_order,
    towards,
    weights_in,
)

NOISE = np.array([[4.0, 1.0, -2.0], [1.0, 3.0, 0.5], [-2.0, 0.5, 5.0]]) * 1e-4


def fit_of(weights: np.ndarray, formal: np.ndarray = NOISE, biases: np.ndarray | None = None) -> ColourFit:
    one = ColourEstimate(1.0, 0.0, 0.0)
    stated = tuple(ColourEstimate(float(value), 0.01, 0.0) for value in weights)
    errors = ChannelWeightErrors(formal, formal, np.zeros((0, 3)) if biases is None else biases)
    return ColourFit((stated[0], stated[1], stated[2]), (one, one, one), one, one, errors, 0.0, 0.0)


@pytest.mark.parametrize("order", WRONG_ORDERS)
def test_the_way_runs_from_nothing_to_one(order: str) -> None:
    """The right order lies at 0 of every way, and a wrong one at 1 of its own, whatever the covariance."""
    assert towards(fit_of(np.array(LUMA_WEIGHTS_RGB)), order).value == pytest.approx(0.0, abs=1e-12)
    assert towards(fit_of(weights_in(order)), order).value == pytest.approx(1.0)
    assert nearest_order(fit_of(weights_in(order))) == order


@given(st.floats(0.8, 2.5))
def test_weights_that_are_stretched_are_on_no_way(stretch: float) -> None:
    """Errors that stretch the differences of the weights never lead towards another order."""
    weights = 1 / 3 + stretch * (np.array(LUMA_WEIGHTS_RGB) - 1 / 3)
    assert nearest_order(fit_of(weights)) == "RGB"
    assert all(towards(fit_of(weights), order).value < 0.15 for order in WRONG_ORDERS)


@pytest.mark.parametrize("order", WRONG_ORDERS)
def test_the_error_is_that_of_repetition(order: str) -> None:
    """Weights with the stated covariance scatter along the way by the stated error."""
    rng = np.random.default_rng(5)
    noise = rng.multivariate_normal(np.zeros(3), NOISE, 4000)
    noise -= noise.mean(axis=1, keepdims=True)
    formal = np.cov(noise.T)
    ways = [towards(fit_of(np.array(LUMA_WEIGHTS_RGB) + one, formal), order) for one in noise[:1500]]
    assert np.std([way.value for way in ways]) == pytest.approx(ways[0].standard_error, rel=0.06)


def test_no_other_line_tells_the_order_with_less_error() -> None:
    """Against the difference of two weights, which also runs from 0 to 1, the error is never larger."""
    fit = fit_of(np.array(LUMA_WEIGHTS_RGB), formal=100 * NOISE)
    for first, second in permutations(range(3), 2):
        order = list("RGB")
        order[first], order[second] = order[second], order[first]
        line = np.zeros(3)
        line[first], line[second] = 1.0, -1.0
        line /= line @ (weights_in("".join(order)) - weights_in("RGB"))
        assert towards(fit, "".join(order)).standard_error <= np.sqrt(line @ (100 * NOISE) @ line) * (1 + 1e-3)


def test_known_biases_bound_the_way() -> None:
    """The bound covers a bias wherever it leads, and the bias of levels always."""
    bias = np.array([[0.05, -0.02, -0.03]])
    for order in WRONG_ORDERS:
        way = towards(fit_of(np.array(LUMA_WEIGHTS_RGB) + bias[0], biases=bias), order)
        assert abs(way.value) <= way.bound
        assert way.bound >= LEVEL_BIAS


def test_unknown_weights_tell_no_order() -> None:
    """A grey scene, whose weights are not known, has an infinite error and no other order."""
    fit = fit_of(np.array(LUMA_WEIGHTS_RGB), np.full((3, 3), np.nan))
    assert towards(fit, "BGR").standard_error == np.inf
    assert nearest_order(fit) == "RGB"
