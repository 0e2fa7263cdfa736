"""Profiles of image edges around steps of depth: their form is the B-spline, their centroid its place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from fedora_qa.estimators.depth.edge_profiles import FARTHEST_PX, RADIUS_PX, find_peaks, peaks_near, tile_profiles
from fedora_qa.estimators.depth.edge_steps import DepthSteps, depth_steps

OFFSETS = np.arange(-RADIUS_PX, RADIUS_PX + 1)


def quadratic(x: np.ndarray) -> np.ndarray:
    """The quadratic B-spline around 0, by scipy."""
    return np.nan_to_num(BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)(x))


@given(st.floats(-FARTHEST_PX + 0.5, FARTHEST_PX - 0.5), st.floats(0, 0.2), st.floats(0, 0.2))
def test_place_of_a_spline_is_exact(shift_px: float, before: float, after: float) -> None:
    """A quadratic B-spline is found exactly where it is, also when the background differs on its two sides."""
    middle = RADIUS_PX + round(shift_px)
    background = np.where(np.arange(len(OFFSETS)) < middle, before, after)
    background[middle] = 0.5 * (before + after)
    profile = quadratic(OFFSETS - shift_px) + background
    found = peaks_near(profile, np.array(middle))
    assert find_peaks(profile) in (middle - 1, middle, middle + 1)
    assert float(found.positions_px) == pytest.approx(shift_px, abs=1e-9)


def test_profile_of_averaged_steps_is_the_spline() -> None:
    """Edges at all places within their pixel, each pixel the mean over its square, give 1/8, 3/4, 1/8."""
    profiles = []
    for place in np.linspace(19.5, 20.5, 401)[:-1] + 1 / 802:
        borders = np.arange(41) - 0.5
        image = np.diff(np.maximum(borders - place, 0.0))[np.newaxis].repeat(5, axis=0)
        depth_m = np.where(np.arange(40) < place, 4.0, 8.0)[np.newaxis].repeat(5, axis=0)
        steps = depth_steps(depth_m, 0, farthest_m=30.0)
        differences = np.abs(np.diff(image, axis=1))
        profiles.append(tile_profiles(differences, steps, 0, (steps.columns, steps.rows), first_px=0.5))
    far, near = np.sum(profiles, axis=(0, 2))
    assert not far.any()
    np.testing.assert_allclose(near[RADIUS_PX - 2 : RADIUS_PX + 3] / near.sum(), [0, 1 / 8, 3 / 4, 1 / 8, 0], atol=1e-5)


def test_reads_between_pixels_are_linear() -> None:
    """Places of another camera fall between pixels: the profile is read there, along both axes alike."""
    strength = np.add.outer(3.0 * np.arange(30), 2.0 * np.arange(40)) + 1.0
    steps = DepthSteps(np.array([20.25]), np.array([14.5]), np.array([1.0]), np.array([True]))
    along = tile_profiles(strength, steps, 0, (steps.columns, steps.rows), first_px=0.0)
    across = tile_profiles(strength.T, steps, 1, (steps.rows, steps.columns), first_px=0.0)
    expected = 3.0 * 14.5 + 2.0 * (20.25 + OFFSETS) + 1.0
    np.testing.assert_allclose(along.sum(axis=(0, 1)), expected / expected.sum())
    np.testing.assert_allclose(across.sum(axis=(0, 1)), expected / expected.sum())


def test_steps_near_the_border_are_left_out() -> None:
    """A step whose profile would leave the image has no voice."""
    steps = DepthSteps(np.array([5.0, 20.0]), np.array([3.0, 3.0]), np.ones(2), np.array([True, True]))
    sums = tile_profiles(np.ones((10, 40)), steps, 0, (steps.columns, steps.rows), first_px=0.0)
    assert sums.sum() == pytest.approx(1.0)
