"""A field's tiles together: robust mean, honest errors, templates, gains."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.flow_field_fit import GAIN, MEAN, SHIFT, fit_field, gain_of_true, robust_errors

COUNT = 60
RNG = np.random.default_rng(9)
FLOWS = RNG.uniform(-6, 6, (COUNT, 2))
SLOPES = RNG.normal(0, 0.05, (COUNT, 2, 2))
COVARIANCES = np.tile(np.diag([0.01**2, 0.02**2]), (COUNT, 1, 1))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((COUNT, 2)) * (0.01, 0.02)


def test_mean_resists_bad_tiles() -> None:
    """Three of sixty tiles that are off by pixels move the mean by less than its error times three."""
    errors = noise(1) + np.array([0.05, -0.03])
    errors[:3] += 4.0
    fit = fit_field(errors, COVARIANCES, FLOWS, SLOPES)
    assert (np.abs(fit.mean_px - (0.05, -0.03)) < 3 * fit.mean_error_px + 0.002).all()
    assert set(np.argsort(fit.deviations)[-3:]) == {0, 1, 2}


def test_stated_error_covers_the_scatter() -> None:
    """Over 300 draws the mean lies within its stated error of the truth at least as often as a normal one."""
    scaled = []
    for seed in range(300):
        fit = fit_field(noise(seed), COVARIANCES, FLOWS, SLOPES)
        scaled.append(fit.mean_px / fit.mean_error_px)
    assert np.std(scaled) < 1.1
    assert np.abs(scaled).max() < 5


def test_error_grows_with_what_the_covariance_does_not_know() -> None:
    """Tiles that scatter four times as much as stated quadruple the error, and a little more for their number."""
    ratio = fit_field(4 * noise(2), COVARIANCES, FLOWS, SLOPES).mean_error_px / fit_field(
        noise(2), COVARIANCES, FLOWS, SLOPES
    ).mean_error_px  # fmt: skip
    assert (ratio > 2.0).all()


@pytest.mark.parametrize(
    ("columns", "errors", "size"),
    [
        (GAIN, 0.02 * FLOWS, [0.02]),
        (MEAN, np.tile([0.3, -0.1], (COUNT, 1)), [0.3, -0.1]),
        (SHIFT, np.einsum("nij,j->ni", SLOPES, [2.0, -1.0]), [2.0, -1.0]),
    ],
    ids=["gain", "constant", "shift"],
)
def test_template_explains_its_own_fault(columns: slice, errors: np.ndarray, size: list[float]) -> None:
    """A fault without noise is explained entirely, with its size."""
    sizes, share = fit_field(errors, COVARIANCES, FLOWS, SLOPES).evidence.explained_by(columns)
    np.testing.assert_allclose(sizes, size, rtol=1e-6)
    assert share == pytest.approx(1.0, abs=0.35)  # tiles far from the mean are weighted down after Huber


@given(st.floats(-0.9, 5.0))
def test_gain_on_the_true_flow(gain: float) -> None:
    """Stored = (1 + G) true: the error is G / (1 + G) of what is stored."""
    recovered, slope = gain_of_true(gain / (1 + gain))
    assert recovered == pytest.approx(gain, abs=1e-9)
    assert slope == pytest.approx((1 + gain) ** 2)


def test_few_blocks_make_the_error_wider() -> None:
    """With 3 degrees of freedom Student's tails need more than five times the width; one block tells nothing."""
    scores = np.array([[1.0], [-1.0], [1.0], [-1.0]])
    assert robust_errors(np.array([[1.0]]), scores)[0] > 5 * np.sqrt(4 * 4 / 3)
    assert np.isinf(robust_errors(np.array([[1.0]]), scores[:1])).all()
