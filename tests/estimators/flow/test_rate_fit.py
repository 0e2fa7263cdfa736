"""All fields of one rate fitted together."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import chi2

from fedora_qa.estimators.fitting.tails import student_factor
from fedora_qa.estimators.flow.field_fit import (
    GAIN,
    MEAN,
    error_scales,
    fit_rate,
    gain_on_true_flow,
    have_common_gain,
    own_mean_share,
    templates_of_flow,
)
from fedora_qa.estimators.flow.parameter_templates import Evidence

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
    np.testing.assert_allclose(scaled.sizes * scaled.effects_px, mean.sizes * mean.effects_px)


def of_tiles(flows_px: np.ndarray, errors_px: np.ndarray, weights: np.ndarray) -> Evidence:
    """Normal equations of tiles with a flow (n, 2), of which the error (n, 2) is measured, with weights (n,)."""
    count = len(flows_px)
    focal = np.zeros((count, 2, 8))
    focal[:, :, 0] = 0.01 * flows_px[:, ::-1]
    templates = templates_of_flow(flows_px, np.zeros((count, 2, 2)), np.zeros((count, 2)), focal)
    weighted = weights[:, None, None] * templates
    matrix = np.einsum("nia,nib->ab", weighted, templates)
    vector = np.einsum("nia,ni->a", weighted, errors_px)
    return Evidence(matrix, vector, float(np.sum(weights[:, None] * errors_px**2)), errors_px.size)


@pytest.mark.parametrize("gain", [-0.5, 0.0, 0.1, 3.0])
def test_effect_is_the_change_of_the_flow_by_one_unit(gain: float) -> None:
    """A gain of 1 changes the flow by the true flow, a percent of the focal length by its template, in mean squares."""
    rng = np.random.default_rng(4)
    true_px, weights = rng.normal(0.0, 1.5, (300, 2)), rng.uniform(0.5, 2.0, 300)
    fit = fit_rate([of_tiles((1 + gain) * true_px, gain * true_px, weights)], [1.0])
    rms_px = np.sqrt(np.average(np.sum(true_px**2, axis=1), weights=weights))
    assert fit.gain.effects_px[0] == pytest.approx(rms_px)
    assert fit.gain.scaled(100).effects_px[0] == pytest.approx(0.01 * rms_px)
    assert fit.geometric is not None
    assert fit.geometric.effects_px[0] == pytest.approx(0.01 * (1 + gain) * rms_px)
    np.testing.assert_allclose(fit.mean.effects_px, 1.0)


def test_a_field_that_scatters_more_has_its_own_scale() -> None:
    """Nine fields with unit scatter share a scale near 1; the tenth, with 100 times of it, has ten times that."""
    scales = error_scales([1.0] * 9 + [100.0], [300] * 10)
    assert scales[:9] == [scales[0]] * 9
    assert scales[0] == pytest.approx(1.0, rel=0.05)
    assert scales[9] == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize("freedom", [3, 10, 300])
def test_median_scatter_of_noise_has_the_scale_of_noise(freedom: int) -> None:
    """Where the scatter is the median of chi squared over its degrees of freedom, only Student's factor is left."""
    scales = error_scales([float(chi2.median(freedom)) / freedom] * 5 + [0.0], [freedom] * 5 + [0])
    assert scales == pytest.approx([student_factor(5 * freedom)] * 6, rel=5e-3)


@pytest.mark.parametrize(("share", "gain", "slope"), [(0.0, 0.0, 1.0), (0.2, 0.25, 1 / 0.64), (-1.0, -0.5, 0.25)])
def test_a_share_of_the_stored_flow_is_a_gain_on_the_true_flow(share: float, gain: float, slope: float) -> None:
    """G = g / (1 - g) and its derivative; where little is known, the error is that of g times the derivative."""
    (few,) = gains([share])
    few = Evidence(few.matrix * 1e-8, few.vector * 1e-8, few.total * 1e-8, few.count)
    found, error, explained = gain_on_true_flow(few)
    assert found == pytest.approx(gain)
    assert error == pytest.approx(slope * 1e3, rel=1e-6)
    assert explained == pytest.approx(float(share != 0))
    fit = fit_rate([few] * 10, [1.0] * 10)
    assert fit.gain.sizes == pytest.approx([gain], abs=1e-6)


def gains(values: Sequence[float]) -> list[Evidence]:
    """Fields whose residual is the flow times a gain, of a hundred tiles of unit flow each."""
    made = []
    for value in values:
        matrix, vector = np.zeros((TEMPLATES, TEMPLATES)), np.zeros(TEMPLATES)
        matrix[GAIN, GAIN], vector[GAIN] = 100.0, 100.0 * value
        made.append(Evidence(matrix, vector, 100.0 * value**2, 100))
    return made


def test_a_gain_that_most_fields_have_is_common() -> None:
    """Of either sign, and from half a percent on; a gain of single fields, or of one field alone, is not."""
    assert have_common_gain(gains([0.02] * 5 + [0.0, 0.5]))
    assert have_common_gain(gains([-0.02, -0.02]))
    assert have_common_gain(gains([0.0051] * 5))
    assert not have_common_gain(gains([0.0049] * 5))
    assert not have_common_gain(gains([0.02] * 2 + [0.0] * 5))
    assert not have_common_gain(gains([0.02]))


def test_gains_at_random_are_not_common() -> None:
    """The median of ten normal gains exceeds five of its errors by the errors' own scatter only: seldom."""
    rng = np.random.default_rng(4)
    alike = [have_common_gain(gains(rng.normal(0, 0.1, 10))) for _ in range(300)]
    assert np.mean(alike) < 0.02
    # A gain of ten of its standard errors, 1.25 sigma / sqrt(n), is common.
    common = [have_common_gain(gains(rng.normal(0.4, 0.1, 10))) for _ in range(300)]
    assert np.mean(common) > 0.95


def means(values: Sequence[float], gain: float = 0.0) -> list[Evidence]:
    """Fields of a hundred tiles each with a mean along the columns, and a gain, of orthogonal templates."""
    made = []
    for value in values:
        sizes = np.zeros(TEMPLATES)
        sizes[MEAN.start], sizes[GAIN] = value, gain
        made.append(Evidence(100.0 * np.eye(TEMPLATES), 100.0 * sizes, 100.0 * float(sizes @ sizes), 100))
    return made


def test_means_of_their_own_are_those_that_fields_do_not_share() -> None:
    """Means of opposite signs are shared by none; equal ones by all; of 1 and 3 a fifth of the squares is not.

    The squares of 1 and 3 about their common mean 2 are 2 of 10.
    """
    assert own_mean_share(means([1.0, -1.0])) == pytest.approx(1.0)
    assert own_mean_share(means([2.0, 2.0])) == pytest.approx(0.0, abs=1e-12)
    assert own_mean_share(means([1.0, 3.0])) == pytest.approx(0.2)
    # A common gain of 1 explains 2 of 4 squares, as much as the means of their own.
    assert own_mean_share(means([1.0, -1.0], gain=1.0)) == pytest.approx(0.0, abs=1e-12)
    assert own_mean_share(means([0.0, 0.0])) == 0.0
    assert own_mean_share([]) == 0.0


def test_fields_without_a_fit_keep_their_errors() -> None:
    assert error_scales([0.0, 0.0], [0, 0]) == [1.0, 1.0]
