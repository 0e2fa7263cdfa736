"""Fields of shifts that follow known errors of a camera."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.events.shift_field import FEWEST_TILES, ShiftFieldModel, field_fits, scale_and_roll

Float64 = NDArray[np.float64]

K = np.array([[60.0, 0.0, 59.5], [0.0, 60.0, 44.0], [0.0, 0.0, 1.0]])
CENTRES = np.stack([a.ravel() for a in np.meshgrid([14.5, 44.5, 74.5, 104.5], [10.6, 32.9, 55.1, 77.4])], axis=1)


def shifts_of(true_K: Float64, rotation: Float64) -> Float64:
    """Return how far points of another camera lie from the tiles, exactly: u' = K' R K^-1 u, less u."""
    rays = np.linalg.inv(K) @ np.column_stack([CENTRES, np.ones(len(CENTRES))]).T
    image = true_K @ Rotation.from_rotvec(rotation).as_matrix() @ rays
    moved: Float64 = (image[:2] / image[2]).T - CENTRES
    return moved


def best_model(shifts_px: Float64) -> tuple[ShiftFieldModel, tuple[float, ...]]:
    fits = field_fits(CENTRES, shifts_px, K)
    best = max(fits, key=lambda fit: fit.explained)
    return best.model, best.parameters


@settings(max_examples=25, deadline=None)
@given(percent=st.floats(1, 8).flatmap(lambda size: st.sampled_from([size, -size])), outliers=st.integers(0, 4))
def test_another_focal_length_is_distinguished_from_a_rotation_and_a_shift(percent: float, outliers: int) -> None:
    """Also where some tiles have peaks at wrong edges."""
    wider = K * np.array([[1 + percent / 100, 1, 1], [1, 1 + percent / 100, 1], [1, 1, 1]])
    shifts_px = shifts_of(wider, np.zeros(3))
    shifts_px[:outliers] += np.array([[5.0, -4.0], [-3.0, 6.0], [7.0, 2.0], [-6.0, -5.0]])[:outliers]
    model, parameters = best_model(shifts_px)
    assert model in ("focal", "focal_by_axis", "shift_and_focal")
    assert parameters[-1] == pytest.approx(percent / 100, rel=0.05)


@settings(max_examples=25, deadline=None)
@given(st.floats(1, 4), st.integers(0, 10_000))
def test_a_rotation_is_estimated_with_its_axis(angle_deg: float, seed: int) -> None:
    """To first order in the angle; a pitch is no shift, as it moves the edges of a wide image further."""
    axis = np.random.default_rng(seed).normal(size=3)
    rotation = np.deg2rad(angle_deg) * axis / np.linalg.norm(axis)
    model, parameters = best_model(shifts_of(K, rotation))
    assert model == "rotation"
    assert np.linalg.norm(np.subtract(parameters, rotation)) < 0.15 * np.deg2rad(angle_deg)


def test_one_axis_alone_and_a_shift_beside_a_focal_length() -> None:
    """Letterboxed frames are narrower along their rows; a crop that is enlarged is moved as well."""
    boxed = K * np.array([[1, 1, 1], [1, 1.05, 1], [1, 1, 1]])
    model, (columns, rows) = best_model(shifts_of(boxed, np.zeros(3)))
    assert (model, round(columns, 6), round(rows, 6)) == ("focal_by_axis", 0, 0.05)
    cropped = np.array([[63.0, 0, 62.5], [0, 63.0, 42.0], [0, 0, 1]])
    model, parameters = best_model(shifts_of(cropped, np.zeros(3)))
    assert model == "shift_and_focal"
    np.testing.assert_allclose(parameters, (3.0, -2.0, 0.05), atol=1e-6)


def test_a_shift_leaves_nothing_to_cameras() -> None:
    """Tiles that are all shifted by as much support no focal length, and a rotation by its curvature alone."""
    fits = {fit.model: fit for fit in field_fits(CENTRES, np.tile([2.0, -1.0], (16, 1)), K)}
    assert fits["shift"].explained == pytest.approx(1.0)
    assert all(fit.beyond_shift == 0 for model, fit in fits.items() if model in ("shift", "focal", "rotation"))


def test_few_tiles_and_none_that_is_shifted_have_no_fit() -> None:
    """The parameters of a rotation need more than their number."""
    few = FEWEST_TILES - 1
    assert field_fits(CENTRES[:few], np.ones((few, 2)), K) == ()
    assert field_fits(CENTRES, np.zeros((16, 2)), K) == ()
    assert scale_and_roll(CENTRES[:few], np.ones((few, 2)), np.ones((few, 2)), K) is None


def test_scale_and_roll_err_as_stated() -> None:
    """Over 400 fields of noise beside a scale of 1%, a roll of 0.5 deg and a shift: pulls have a spread near 1."""
    random, sigma = np.random.default_rng(5), 0.05
    wider = K * np.array([[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]])
    exact = shifts_of(wider, np.array([0.0, 0.0, np.deg2rad(0.5)])) + np.array([0.3, -0.2])
    pulls = []
    for _ in range(400):
        noisy = exact + random.normal(0, sigma, exact.shape)
        fit = scale_and_roll(CENTRES, noisy, np.full(exact.shape, sigma), K)
        assert fit is not None
        pulls.append(((fit.scale - 0.01) / fit.scale_error, (fit.roll_rad - np.deg2rad(0.5)) / fit.roll_error_rad))
    # The larger of two estimates of the error is taken, so that pulls are a little narrower than 1.
    assert np.all((np.std(pulls, axis=0) > 0.7) & (np.std(pulls, axis=0) < 1.1))
    # First order in the roll: its cosine changes the scale by 4e-5.
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.3)


def test_a_displacement_of_tiles_changes_the_scale_by_its_bound_at_most() -> None:
    """Tiles displaced away from the principal point, by 1 px along each axis."""
    away = np.sign(CENTRES - K[:2, 2])
    fit = scale_and_roll(CENTRES, away, np.ones((16, 2)), K)
    assert fit is not None
    assert 0.5 * fit.per_px < fit.scale <= fit.per_px
