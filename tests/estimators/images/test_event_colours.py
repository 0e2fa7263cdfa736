"""Weights of the channels and the exponent of the curve, from levels that events tell exactly."""

from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.event_colours import (
    ColourFit,
    colour_blocks,
    colour_columns,
    concatenate_colours,
    fit_colours,
)

Floats = NDArray[np.float64]
WEIGHTS = np.array(LUMA_WEIGHTS_RGB)
SAMPLES, BLOCKS = 2000, 20


@dataclass(frozen=True)
class Levels:
    """Pixels of independent colours at two times, and what an ideal sensor says of them, in closed form."""

    model: Literal["log", "linear"] = "linear"
    noise: float = 0.0
    grey: bool = False
    late_s: float = 0.0
    seed: int = 0

    def fit(self, order: tuple[int, ...] = (0, 1, 2), gamma: float = 1.0, threshold: float = 1.0) -> ColourFit:
        """Fit frames that store the channels in ``order`` and bent by ``gamma``, thresholds declared too large."""
        rng = np.random.default_rng(self.seed)
        true = rng.uniform(20, 230, (2, SAMPLES, 1 if self.grey else 3)) * np.ones(3)
        signal = true @ WEIGHTS
        if self.model == "log":
            signal = np.log(signal)
        rate = rng.normal(0, 30, SAMPLES)
        events = signal[1] - signal[0] + self.late_s * rate
        stored = 255 * (true[..., order] / 255) ** (1 / gamma) + self.noise * rng.normal(size=true.shape)
        columns = colour_columns(stored[0], stored[1], self.model, 0.0)
        blocks = np.arange(SAMPLES) * BLOCKS // SAMPLES
        sums = colour_blocks(np.column_stack([columns, rate]), threshold * events, blocks, BLOCKS)
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


def test_blocks_without_samples_are_left_out() -> None:
    """A quarter of the image that shows nothing is no block."""
    columns = np.random.default_rng(0).normal(size=(100, 5))
    sums = colour_blocks(columns, columns @ np.ones(5), np.zeros(100, np.intp), 4)
    assert len(concatenate_colours([sums, sums])) == 2
    # A quarter of the image without events tells that nothing changes there.
    still = colour_blocks(columns, np.zeros(100), np.zeros(100, np.intp), 4)
    assert len(concatenate_colours([still])) == 1


def test_error_of_the_exponent_is_that_of_repetition_whatever_the_scale() -> None:
    """With thresholds declared twice too large the exponent scatters as its standard error says."""
    exponents = [Levels("linear", noise=3.0, seed=seed).fit(threshold=2.0).exponent for seed in range(40)]
    claimed = np.mean([exponent.standard_error for exponent in exponents])
    assert 0.6 < np.std([exponent.value for exponent in exponents]) / claimed < 1.4
