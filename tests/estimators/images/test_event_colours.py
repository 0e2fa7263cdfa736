"""Weights of the channels and the exponent of the curve, from levels that events tell exactly."""

from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.event_colours import (
    LEVEL_BIAS,
    WRONG_ORDERS,
    ChannelWeightErrors,
    ColourEstimate,
    ColourFit,
    colour_blocks,
    colour_columns,
    concatenate_colours,
    curve_slopes,
    fit_colours,
    nearest_order,
    signal_secants,
    towards,
    weights_in,
)

Floats = NDArray[np.float64]
WEIGHTS = np.array(LUMA_WEIGHTS_RGB)
SAMPLES, BLOCKS = 2000, 20


NO_NOISE = np.zeros((100, 3))


@dataclass(frozen=True)
class Levels:
    """Pixels of independent colours at two times, and what an ideal sensor says of them, in closed form."""

    model: Literal["log", "linear"] = "linear"
    noise: float = 0.0
    common_noise: float = 0.0
    grey: bool = False
    saturation: float = 1.0
    late_s: float = 0.0
    seed: int = 0

    def fit(self, order: tuple[int, ...] = (0, 1, 2), gamma: float = 1.0, threshold: float = 1.0) -> ColourFit:
        """Fit frames that store the channels in ``order`` and bent by ``gamma``, thresholds declared too large."""
        rng = np.random.default_rng(self.seed)
        true = rng.uniform(20, 230, (2, SAMPLES, 1 if self.grey else 3)) * np.ones(3)
        true = self.saturation * true + (1 - self.saturation) * true.mean(axis=-1, keepdims=True)
        signal = true @ WEIGHTS
        if self.model == "log":
            signal = np.log(signal)
        rate = rng.normal(0, 30, SAMPLES)
        events = signal[1] - signal[0] + self.late_s * rate
        stored = 255 * (true[..., order] / 255) ** (1 / gamma) + self.noise * rng.normal(size=true.shape)
        stored = stored + self.common_noise * rng.normal(size=(2, SAMPLES, 1))
        columns = colour_columns(stored[0], stored[1], self.model, 0.0)
        blocks = np.arange(SAMPLES) * BLOCKS // SAMPLES
        slopes = curve_slopes(stored[0], stored[1])
        secants = signal_secants(stored[0], stored[1], self.model, 0.0)
        noise = np.outer(secants**2, np.full(3, 2 * self.noise**2))
        sums = colour_blocks(np.column_stack([columns, rate]), threshold * events, slopes, noise, blocks, BLOCKS)
        return fit_colours(concatenate_colours([sums]), with_exponent=self.model == "linear")


def found(fit: ColourFit) -> list[float]:
    return [weight.value for weight in fit.weights]


@pytest.mark.parametrize("model", ["log", "linear"])
def test_clean_frames_give_the_declared_weights(model: Literal["log", "linear"]) -> None:
    """Exact signals give weights, scale and exponent to rounding, whatever the time offset is."""
    fit = Levels(model, late_s=0.004).fit()
    np.testing.assert_allclose(found(fit), WEIGHTS, atol=1e-6)
    assert fit.scale.value == pytest.approx(1.0, abs=1e-6)
    assert fit.exponent.value == pytest.approx(1.0, abs=1e-6)
    assert fit.unexplained < 1e-9


@pytest.mark.parametrize("order", [order for order in permutations(range(3)) if order != (0, 1, 2)], ids=str)
@pytest.mark.parametrize("model", ["log", "linear"])
def test_every_wrong_order_turns_a_contrast(model: Literal["log", "linear"], order: tuple[int, ...]) -> None:
    """Weights follow the stored channels; in each wrong order at least one contrast changes its sign."""
    fit = Levels(model).fit(order)
    np.testing.assert_allclose(found(fit), WEIGHTS[list(order)], atol=0.06 if model == "log" else 1e-6)
    assert any(contrast.value < -0.1 for contrast in fit.contrasts)


def test_threshold_is_the_scale_and_no_weight() -> None:
    """A threshold declared 20% too large scales everything alike."""
    fit = Levels("log").fit(threshold=1.2)
    assert fit.scale.value == pytest.approx(1.2, abs=1e-6)
    np.testing.assert_allclose(found(fit), WEIGHTS, atol=1e-6)


@pytest.mark.parametrize("gamma", [1.05, 0.95, 1.0])
def test_linear_sensor_tells_the_exponent(gamma: float) -> None:
    """Codes bent a little, declared as linear, give the exponent back, whatever the threshold is."""
    assert Levels("linear").fit(gamma=gamma, threshold=1.3).exponent.value == pytest.approx(gamma, abs=0.01)


@pytest.mark.parametrize(
    ("gamma", "low", "high"), [(2.2, 1.7, np.inf), (1 / 2.2, -np.inf, 0.6)], ids=["display", "inverse"]
)
def test_linear_sensor_sees_the_curve_of_a_display(gamma: float, low: float, high: float) -> None:
    """Far from 1 the exponent is no longer exact, and unmistakable."""
    assert low < Levels("linear").fit(gamma=gamma).exponent.value < high


def test_log_sensor_shows_the_exponent_as_its_scale() -> None:
    """A log sensor sees a gamma of 2.2 as steps that are 2.2 times too large."""
    assert Levels("log").fit(gamma=2.2).scale.value == pytest.approx(2.2, abs=0.15)


def test_grey_scene_tells_no_weights() -> None:
    """Without colours the channels are collinear: errors are infinite, and values no numbers."""
    for model in ("log", "linear"):
        fit = Levels(model, grey=True).fit()  # type: ignore[arg-type]
        assert all(np.isinf(weight.standard_error) and np.isnan(weight.value) for weight in fit.weights)


def test_errors_are_those_of_repetition() -> None:
    """Weights from noisy frames scatter as their standard errors say, and stay within error and bound of the truth."""
    fits = [Levels("linear", noise=3.0, seed=seed).fit() for seed in range(40)]
    for channel in range(3):
        values = np.array([fit.weights[channel].value for fit in fits])
        claimed = np.mean([fit.weights[channel].standard_error for fit in fits])
        bound = np.mean([fit.weights[channel].bound for fit in fits])
        assert 0.6 < values.std() / claimed < 1.4
        assert abs(values.mean() - WEIGHTS[channel]) < 3 * claimed / np.sqrt(40) + bound


def test_errors_that_channels_share_bias_weights_by_their_bound() -> None:
    """Errors of 10 DN in all channels alike draw the weights of green and blue together, by as much as is stated."""
    fits = [Levels("linear", common_noise=10.0, seed=seed).fit() for seed in range(20)]
    for channel, sign in ((1, 1), (2, -1)):
        bias = np.mean([fit.weights[channel].value for fit in fits]) - WEIGHTS[channel]
        assert sign * bias == pytest.approx(np.mean([fit.weights[channel].bound for fit in fits]), rel=0.25)


@pytest.mark.parametrize("common_dn", [3.0, 10.0])
def test_errors_that_channels_share_bias_the_exponent_by_their_bound(common_dn: float) -> None:
    """They flatten the signal, and bend it where it is dark: by as much as is stated, to first order."""
    fits = [Levels("linear", common_noise=common_dn, seed=seed).fit() for seed in range(40)]
    bias = np.mean([fit.exponent.value for fit in fits]) - 1.0
    error = np.mean([fit.exponent.standard_error for fit in fits]) / np.sqrt(40)
    assert bias == pytest.approx(np.mean([fit.exponent.bound for fit in fits]), abs=4 * error, rel=0.3)


@given(st.floats(20.0, 250.0), st.floats(20.0, 250.0), st.floats(20.0, 250.0))
def test_slopes_are_those_of_the_bent_luma(red: float, green: float, blue: float) -> None:
    """The last column changes by the slope where all channels change by as much."""
    colours = np.array([[red, green, blue]])
    bent = colour_columns(colours - 0.005, colours + 0.005, "linear", 0.0)[0, 3] / 0.01
    assert bent == pytest.approx(curve_slopes(colours, colours)[0], abs=1e-6)


@given(st.floats(5.0, 250.0), st.floats(-14.0, 2.0), st.sampled_from([-1.0, 1.0]))
@example(first_dn=100.0, power=-3.0, sign=1.0)
def test_columns_of_a_log_sensor_add_up_to_its_signal(first_dn: float, power: float, sign: float) -> None:
    """Their sum by the true weights is the change of the logarithm of luma, however small or large that is."""
    change = sign * min(10.0**power, 0.9)
    earlier = np.full((1, 3), first_dn) * [1.1, 1.0, 0.7]
    columns = colour_columns(earlier, earlier * (1 + change), "log", 0.0)
    exact = np.log1p((earlier * (1 + change) - earlier) @ WEIGHTS / (earlier @ WEIGHTS))
    assert columns[:, :3] @ WEIGHTS == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("model", ["log", "linear"])
def test_noise_of_single_channels_biases_the_weights_by_its_bound(model: Literal["log", "linear"]) -> None:
    """In a scene of little colour weights tend to be equal; the bound is the distance to the unattenuated fit."""
    fits = [Levels(model, noise=4.0, saturation=0.1, seed=seed).fit() for seed in range(40)]
    for channel, weight in enumerate(WEIGHTS):
        estimates = [fit.weights[channel] for fit in fits]
        error = np.mean([estimate.standard_error for estimate in estimates]) / np.sqrt(len(fits))
        bias = abs(np.mean([estimate.value for estimate in estimates]) - weight)
        assert bias > 10 * error
        assert bias == pytest.approx(np.mean([estimate.bound for estimate in estimates]), rel=0.3)


def test_channels_that_differ_by_noise_alone_have_no_weights() -> None:
    """Noise as large as all changes leaves nothing that determines them; the order is not named."""
    fit = Levels("log", noise=12.0, saturation=0.02).fit()
    assert not np.isfinite(fit.weights[0].standard_error)
    assert not np.isfinite(towards(fit, "BGR").standard_error)
    assert np.isfinite([fit.scale.value, fit.scale.standard_error, fit.scale.bound]).all()


def test_blocks_without_samples_are_left_out() -> None:
    """A quarter of the image that shows nothing is no block."""
    columns = np.random.default_rng(0).normal(size=(100, 5))
    sums = colour_blocks(columns, columns @ np.ones(5), np.zeros(100), NO_NOISE, np.zeros(100, np.intp), 4)
    assert len(concatenate_colours([sums, sums])) == 2
    # A quarter of the image without events tells that nothing changes there.
    still = colour_blocks(columns, np.zeros(100), np.zeros(100), NO_NOISE, np.zeros(100, np.intp), 4)
    assert len(concatenate_colours([still])) == 1


def test_error_of_the_exponent_is_that_of_repetition_whatever_the_scale() -> None:
    """With thresholds declared twice too large the exponent scatters as its standard error says."""
    exponents = [Levels("linear", noise=3.0, seed=seed).fit(threshold=2.0).exponent for seed in range(40)]
    claimed = np.mean([exponent.standard_error for exponent in exponents])
    assert 0.6 < np.std([exponent.value for exponent in exponents]) / claimed < 1.4


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


@pytest.mark.parametrize("order", list(permutations(range(3))), ids=str)
def test_the_order_of_noisy_frames_is_told(order: tuple[int, ...]) -> None:
    """Whichever it is, with the errors that the fit itself states; the way to it ends at 1, within error and bound."""
    fit, stored = Levels("linear", noise=3.0).fit(order), "".join("RGB"[channel] for channel in order)
    assert nearest_order(fit) == stored
    if stored != "RGB":
        way = towards(fit, stored)
        assert abs(way.value - 1.0) < 3 * way.standard_error + way.bound
        assert way.standard_error + way.bound < 0.3


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


@pytest.mark.parametrize("order", WRONG_ORDERS)
def test_errors_of_levels_count_as_much_as_they_are_known_to_be(order: str) -> None:
    """No other line has less error by noise and by levels, which err by ``LEVEL_BIAS`` in a difference of weights."""
    right, unit = np.array(LUMA_WEIGHTS_RGB), np.eye(3)
    line = np.array([towards(fit_of(right + one), order).value for one in unit])  # the value is linear in the weights
    covariance = NOISE + LEVEL_BIAS**2 / 2 * unit
    difference = weights_in(order) - right
    for seed in range(20):
        other = np.random.default_rng(seed).normal(size=3)
        other -= other.mean()
        other = line + 0.3 * (other - (other @ difference) * line)
        assert other @ difference == pytest.approx(1.0)
        assert line @ covariance @ line <= (other @ covariance @ other) * (1 + 1e-9)


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
