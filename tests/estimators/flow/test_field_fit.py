"""A field's tiles together: robust mean, honest errors, templates, gains."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.fitting.tails import student_factor
from fedora_qa.estimators.flow.field_fit import (
    CENTRE,
    FOCAL,
    GAIN,
    GEOMETRIC,
    LOCKING,
    MEAN,
    MOUNTING,
    OF_THE_FLOW,
    SHIFT,
    TIME,
    fit_field,
    gain_of_true,
    lock_in,
    robust_errors,
    templates_of_flow,
)

COUNT = 60
RNG = np.random.default_rng(9)
FLOWS = RNG.uniform(-6, 6, (COUNT, 2))
SLOPES = RNG.normal(0, 0.05, (COUNT, 2, 2))
COVARIANCES = np.tile(np.diag([0.01**2, 0.02**2]), (COUNT, 1, 1))
TEMPLATES = templates_of_flow(FLOWS, SLOPES, np.sin(2 * np.pi * FLOWS), None)


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((COUNT, 2)) * (0.01, 0.02)


def test_mean_resists_bad_tiles() -> None:
    """Three of sixty tiles that are off by pixels move the mean by less than its error times three."""
    errors = noise(1) + np.array([0.05, -0.03])
    errors[:3] += 4.0
    fit = fit_field(errors, COVARIANCES, TEMPLATES)
    assert (np.abs(fit.mean_px - (0.05, -0.03)) < 3 * fit.mean_error_px + 0.002).all()
    assert set(np.argsort(fit.deviations)[-3:]) == {0, 1, 2}


def test_stated_error_covers_the_scatter() -> None:
    """Over 300 draws the mean lies within its stated error of the truth at least as often as a normal one."""
    scaled = []
    for seed in range(300):
        fit = fit_field(noise(seed), COVARIANCES, TEMPLATES)
        scaled.append(fit.mean_px / fit.mean_error_px)
    assert np.std(scaled) < 1.1
    assert np.abs(scaled).max() < 5


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_spread_tells_what_the_covariance_does_not_know(factor: float) -> None:
    """Tiles that scatter by a factor more than stated have its square as spread; Huber takes a little."""
    spreads = [fit_field(factor * noise(seed), COVARIANCES, TEMPLATES).spread for seed in range(20)]
    weighted_down = 0.5 * factor if factor > 2 else 0.93 * factor
    assert weighted_down < np.sqrt(np.mean(spreads)) < 1.05 * factor


def test_each_template_has_one_name() -> None:
    """Names follow each other without a gap, those of the flow and those of geometry within their groups."""
    columns = range(TEMPLATES.shape[-1])
    groups = [
        (OF_THE_FLOW, (MEAN, GAIN, SHIFT)),
        (LOCKING, (LOCKING,)),
        (GEOMETRIC, (FOCAL, CENTRE, MOUNTING, TIME, slice(14, 15))),
    ]
    for group, names in groups:
        assert [column for name in names for column in columns[name]] == list(columns[group])
    assert [column for group, _ in groups for column in columns[group]] == list(columns)


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
    sizes, share = fit_field(errors, COVARIANCES, TEMPLATES).evidence.explained_by(columns)
    np.testing.assert_allclose(sizes, size, rtol=1e-6)
    assert share == pytest.approx(1.0, abs=0.35)  # tiles far from the mean are weighted down after Huber


@given(st.floats(-0.9, 5.0))
def test_gain_on_the_true_flow(gain: float) -> None:
    """Stored = (1 + G) true: the error is G / (1 + G) of what is stored."""
    recovered, slope = gain_of_true(gain / (1 + gain))
    assert recovered == pytest.approx(gain, abs=1e-9)
    assert slope == pytest.approx((1 + gain) ** 2)


ONE = np.array([[1.0]])


def test_blocks_that_scatter_as_stated_leave_the_formal_error() -> None:
    """Normal scores of the stated variance: the formal error, in 97 of 100 cases at least, however few the blocks."""
    rng = np.random.default_rng(6)
    formal = [
        robust_errors(np.array([[8.0]]), np.array([[8.0]]), rng.standard_normal((8, 1)))[0] == pytest.approx(8**-0.5)
        for _ in range(300)
    ]
    assert np.mean(formal) >= 0.97


def test_blocks_with_errors_of_their_own_widen_the_error() -> None:
    """Scores ten times as large as stated: their own scatter is taken, with Student's tails for 3 of them."""
    scores = 10 * np.array([[1.0], [-1.0], [1.0], [-1.0]])
    assert robust_errors(ONE, ONE, scores)[0] == pytest.approx(student_factor(3) * np.sqrt(400 * 4 / 3))
    assert student_factor(3) > 5
    assert robust_errors(ONE, 4 * ONE, scores[:1])[0] == pytest.approx(2.0)  # one block has nothing to scatter from


@pytest.mark.parametrize("columns", [MEAN, GAIN, SHIFT], ids=["constant", "gain", "shift"])
def test_lock_in_bounds_a_bias_that_follows_the_sine(columns: slice) -> None:
    """Residuals of 0.01 sin(2 pi flow) px, of either sign for u and v, move no size by more than it says."""
    for signs in ((1, 1), (1, -1)):
        errors = 0.01 * np.sin(2 * np.pi * FLOWS) * signs
        fit = fit_field(errors, COVARIANCES, TEMPLATES)
        sizes, _ = fit.evidence.explained_by(columns)
        assert (np.abs(sizes) <= 0.01 * lock_in(fit.evidence, columns) * (1 + 1e-9)).all()


def test_lock_in_is_whole_where_all_moves_by_a_quarter_pixel() -> None:
    """Nothing averages out where every tile moves alike: the whole bias goes into the mean."""
    flows = np.full((COUNT, 2), 0.25)
    fit = fit_field(noise(3), COVARIANCES, templates_of_flow(flows, SLOPES, np.sin(2 * np.pi * flows), None))
    np.testing.assert_allclose(lock_in(fit.evidence, MEAN), 1.0)
    assert (LOCKING.stop, OF_THE_FLOW.stop) == (7, LOCKING.start)
