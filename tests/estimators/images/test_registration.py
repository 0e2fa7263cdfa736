"""Registration of correlations: sub-pixel shifts, against closed form and against scikit-image on whole pictures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import fourier_shift, gaussian_filter
from skimage.registration import phase_cross_correlation

from fedora_qa.estimators.events.shift import (
    RADIUS_PX,
    auto_correlation,
    cross_correlation,
    slope_sums,
)
from fedora_qa.estimators.events.shift_errors import open_level_errors
from fedora_qa.estimators.images.registration import PEAK_RADIUS_PX, registered_shift

AXIS = np.arange(-RADIUS_PX, RADIUS_PX + 1)
FARTHEST_PX = RADIUS_PX - PEAK_RADIUS_PX - 0.5


def bump(right_px: float, down_px: float, width_px: float) -> np.ndarray:
    """A Gaussian autocorrelation, moved."""
    return np.exp(-((AXIS - right_px) ** 2 + (AXIS[:, np.newaxis] - down_px) ** 2) / (2 * width_px**2))


@settings(max_examples=30, deadline=None)
@given(st.floats(-FARTHEST_PX, FARTHEST_PX), st.floats(-FARTHEST_PX, FARTHEST_PX), st.floats(1.0, 2.0))
def test_moved_autocorrelation_is_found(right_px: float, down_px: float, width_px: float) -> None:
    """A correlation that is the autocorrelation moved is found where it is, to some hundredths of a pixel."""
    found = registered_shift(bump(0, 0, width_px), bump(right_px, down_px, width_px))
    assert found is not None
    assert (found.right_px, found.down_px) == pytest.approx((right_px, down_px), abs=0.03)


@pytest.mark.parametrize(("right_px", "down_px"), [(0.3, -0.4), (1.75, 0.1), (-2.5, 2.25)])
def test_agrees_with_scikit_image_on_pictures(right_px: float, down_px: float) -> None:
    """Summing correlations first and registering them once gives what registering the pictures gives."""
    rng = np.random.default_rng(1)
    picture = np.abs(gaussian_filter(rng.normal(size=(80, 100)), 1.0, mode="wrap"))
    moved = np.fft.ifft2(fourier_shift(np.fft.fft2(picture), (down_px, right_px))).real
    everywhere = np.ones(picture.shape, bool)
    auto, cross = (cross_correlation(picture, other, everywhere) for other in (picture, moved))
    back, *_ = phase_cross_correlation(picture, moved, upsample_factor=100, normalization=None)
    found = registered_shift(auto, cross)
    assert found is not None
    assert (found.down_px, found.right_px) == pytest.approx(-back, abs=0.06)
    assert (found.right_px, found.down_px) == pytest.approx((right_px, down_px), abs=0.06)


def test_no_peak_is_said() -> None:
    """Nothing positive, or a peak at the rim, is no shift."""
    assert registered_shift(bump(0, 0, 1), -bump(0, 0, 1)) is None
    assert registered_shift(bump(0, 0, 1), bump(RADIUS_PX, 0, 1)) is None


def test_errors_of_a_ramp_are_closed_form() -> None:
    """On a ramp of slope g that changes by a ramp of slope c, C/2 is C/(2 g) px, N pixels know C sqrt(2/3 / N) / c."""
    slope, change_slope, threshold = 0.05, 0.02, 0.2
    ramp = np.arange(41.0)[np.newaxis].repeat(30, axis=0)
    sums = slope_sums(slope * ramp, change_slope * ramp, np.ones(ramp.shape, bool))
    errors, lags = open_level_errors(sums, threshold)
    assert lags[0] == pytest.approx(threshold / (2 * slope))
    assert errors[0] == pytest.approx(threshold * np.sqrt(2 / 3 / (30 * 40)) / change_slope)
    assert errors[1] > 1e6


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("rest", [0.0, -0.3, 7.0])
def test_correlation_is_that_of_its_definition_however_many_pixels_fire(share: float, rest: float) -> None:
    """By sums over shifted images in double precision; what is said of the silent pixels changes nothing."""
    rng = np.random.default_rng(7)
    change, usable = rng.normal(size=(30, 70)), rng.uniform(size=(30, 70)) < 0.9
    events = np.where(rng.uniform(size=change.shape) < share, rng.normal(size=change.shape), min(rest, 0.0))
    found = cross_correlation(change, events, usable, rest)
    one, other = (np.where(usable, image - image[usable].mean(), 0.0) for image in (change, events))
    around = np.pad(other, RADIUS_PX)
    shifts = range(2 * RADIUS_PX + 1)
    due = [[np.sum(one * around[down : down + 30, right : right + 70]) for right in shifts] for down in shifts]
    assert found == pytest.approx(np.array(due), abs=1e-5 * np.sqrt(np.sum(one**2) * np.sum(other**2)) + 1e-5)


def test_autocorrelation_is_the_correlation_with_itself() -> None:
    """Half of it is computed; it is the same the other way round."""
    rng = np.random.default_rng(8)
    change, usable = rng.normal(size=(20, 30)), rng.uniform(size=(20, 30)) < 0.8
    assert auto_correlation(change, usable) == pytest.approx(cross_correlation(change, change, usable), abs=1e-3)
    assert not np.any(auto_correlation(change, np.zeros_like(usable)))
