"""All fields of one rate fitted together."""

import numpy as np
import pytest

from fedora_qa.estimators.flow.field_fit import GAIN, MEAN
from fedora_qa.estimators.flow.motion_fit import Evidence
from fedora_qa.estimators.flow.rate_fit import error_scales, fit_rate, gain_on_true_flow

TEMPLATES = 15


def evidence(sizes: dict[int, float], rng: np.random.Generator, noise: float = 0.0) -> Evidence:
    """Normal equations of a field whose residual is a sum of templates of known sizes, with white noise."""
    design = np.zeros((200, TEMPLATES))
    columns = [0, 1, 2]
    design[:, columns] = rng.normal(0, 1, (200, len(columns)))
    residual = design @ np.array([sizes.get(column, 0.0) for column in range(TEMPLATES)])
    residual = residual + noise * rng.normal(0, 1, len(residual))
    return Evidence(design.T @ design, design.T @ residual, float(residual @ residual), len(residual))


def test_the_mean_of_a_rate_is_fitted() -> None:
    """Constant residuals of all fields are the mean, without geometry none of its templates is fitted."""
    rng = np.random.default_rng(0)
    fit = fit_rate([evidence({0: 0.2, 1: -0.1}, rng) for _ in range(8)], [1.0] * 8)
    np.testing.assert_allclose(fit.mean.sizes, [0.2, -0.1], atol=1e-9)
    assert fit.geometric is None


def test_errors_of_the_mean_are_those_of_the_noise() -> None:
    """Of eight fields with 200 tiles of unit noise the mean has an error of 1 / sqrt(1600), to a third."""
    rng = np.random.default_rng(1)
    fit = fit_rate([evidence({}, rng, noise=1.0) for _ in range(8)], [1.0] * 8)
    assert fit.mean.errors == pytest.approx(np.full(2, 1600**-0.5), rel=0.4)
    assert np.all(np.abs(fit.mean.sizes) < 5 * fit.mean.errors)


def test_a_gain_explains_a_residual_that_follows_the_flow() -> None:
    """A residual that is a multiple of the flow is explained by the gain in full, its sign that of the stored flow."""
    rng = np.random.default_rng(2)
    total = evidence({GAIN.start: -0.05}, rng)
    gain, error, share = gain_on_true_flow(total)
    assert share == pytest.approx(1.0, abs=0.05)
    assert abs(gain) == pytest.approx(0.05, rel=0.1)
    assert error > 0


def test_units_scale_sizes_errors_and_biases_alike() -> None:
    rng = np.random.default_rng(3)
    mean = fit_rate([evidence({MEAN.start: 0.3}, rng, noise=0.1) for _ in range(4)], [1.0] * 4).mean
    scaled = mean.scaled(100.0)
    np.testing.assert_array_equal(scaled.sizes, 100.0 * mean.sizes)
    np.testing.assert_array_equal(scaled.errors, 100.0 * mean.errors)
    np.testing.assert_array_equal(scaled.biases, 100.0 * mean.biases)


def test_a_field_that_scatters_more_has_its_own_scale() -> None:
    """Nine fields with unit scatter share a scale near 1; the tenth, with 100 times of it, has ten times that."""
    scales = error_scales([1.0] * 9 + [100.0], [300] * 10)
    assert scales[:9] == [scales[0]] * 9
    assert scales[0] == pytest.approx(1.0, rel=0.05)
    assert scales[9] == pytest.approx(10.0, rel=0.05)


def test_fields_without_a_fit_keep_their_errors() -> None:
    assert error_scales([0.0, 0.0], [0, 0]) == [1.0, 1.0]
