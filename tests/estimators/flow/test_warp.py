"""Frames are read between pixels exactly enough: remap itself, and the spline read against closed-form textures."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from fedora_qa.estimators.flow.warp import read_at_pixels, read_between, smooth

SIZE = 96


def wave(frequency_rad_px: float, shift_px: float = 0.0, angle: float = 0.3) -> np.ndarray:
    columns, rows = np.meshgrid(np.arange(SIZE, dtype=float), np.arange(SIZE, dtype=float))
    along = (columns - shift_px) * np.cos(angle) + rows * np.sin(angle)
    return np.asarray(100 + 50 * np.cos(frequency_rad_px * along), dtype=np.float32)


def test_bilinear_remap_is_exact_or_rounded() -> None:
    """cv2.remap reads linearly to 1e-4 of the contrast, or to the rounding of the version."""
    rng = np.random.default_rng(0)
    image = rng.random((60, 70), dtype=np.float32)
    columns, rows = rng.uniform(1, 68, (50, 40)).astype(np.float32), rng.uniform(1, 58, (50, 40)).astype(np.float32)
    left, above = np.floor(columns).astype(int), np.floor(rows).astype(int)
    right, below = columns - left, rows - above
    expected = (
        (1 - below) * ((1 - right) * image[above, left] + right * image[above, left + 1])
        + below * ((1 - right) * image[above + 1, left] + right * image[above + 1, left + 1])
    )  # fmt: skip
    read = cv2.remap(image, columns, rows, cv2.INTER_LINEAR)
    # OpenCV 4 rounds positions to 1/32 px; OpenCV 5 does not.
    rounding_px = 0.0 if int(cv2.__version__.split(".", maxsplit=1)[0]) >= 5 else 1 / 64
    assert np.abs(read - expected).max() < 1e-4 + 2 * rounding_px


def test_lanczos_remap_rounds_its_positions() -> None:
    """cv2.remap with Lanczos knows no more than 33 places from one pixel to the next: too coarse for hundredths."""
    image = np.random.default_rng(2).random((20, 30), dtype=np.float32)
    columns = np.linspace(10, 11, 1000, dtype=np.float32)[None, :]
    read = cv2.remap(image, columns, np.full_like(columns, 9.0), cv2.INTER_LANCZOS4)
    assert len(np.unique(read)) <= 33


@pytest.mark.parametrize("sigma_px", [1.0, 1.5, 2.0])
def test_blur_and_spline_together_have_the_width_that_was_asked_for(sigma_px: float) -> None:
    """The second moment of what a single bright pixel becomes, along columns, is sigma squared."""
    point = np.zeros((41, 41), dtype=np.float32)
    point[20, 20] = 1.0
    profile = read_at_pixels(smooth(point, sigma_px)).sum(axis=0)
    assert profile.sum() == pytest.approx(1.0, abs=1e-5)
    assert profile @ (np.arange(41) - 20.0) ** 2 == pytest.approx(sigma_px**2, rel=0.01)


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (40, 30)])
def test_any_position_is_answered(shape: tuple[int, int]) -> None:
    """Beyond the image its border is read, wherever that is; NaN reads something, and nothing is read outside."""
    image = np.random.default_rng(4).random(shape, dtype=np.float32)
    far = np.array([[-1e30, -0.5, 1e30, np.inf, -np.inf, np.nan]], dtype=np.float32)
    read = read_between(image, far, far[:, ::-1].copy())
    assert (read >= image.min() - 1e-6).all()
    assert (read <= image.max() + 1e-6).all()


def test_spline_is_that_of_scipy() -> None:
    """Without prefilter, with the same mirrored border, to single precision."""
    image = np.random.default_rng(5).random((60, 70), dtype=np.float32)
    rng = np.random.default_rng(6)
    columns, rows = rng.uniform(0, 69, (50, 40)).astype(np.float32), rng.uniform(0, 59, (50, 40)).astype(np.float32)
    expected = map_coordinates(image.astype(np.float64), [rows, columns], order=3, prefilter=False, mode="mirror")
    np.testing.assert_allclose(read_between(image, columns, rows), expected, atol=2e-6)


def test_reading_at_pixels_and_between_agree() -> None:
    """At whole coordinates both reads are the same spline."""
    smoothed = smooth(np.random.default_rng(1).random((SIZE, SIZE), dtype=np.float32))
    columns, rows = np.meshgrid(np.arange(8, 80, dtype=np.float32), np.arange(8, 80, dtype=np.float32))
    np.testing.assert_allclose(read_between(smoothed, columns, rows), read_at_pixels(smoothed)[8:80, 8:80], atol=1e-5)


def test_both_kernels_together_have_the_variance_asked_for() -> None:
    """A single bright pixel spreads with a variance of 1 px^2 along each axis, and keeps its sum."""
    dot = np.zeros((41, 41), dtype=np.float32)
    dot[20, 20] = 1.0
    spread = read_at_pixels(smooth(dot)).astype(float)
    offsets = np.arange(41) - 20.0
    assert spread.sum() == pytest.approx(1.0, abs=1e-5)
    assert (spread.sum(axis=0) * offsets**2).sum() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("wavelength_px", [5.0, 8.0, 20.0])
@pytest.mark.parametrize("fraction_px", [0.1, 0.25, 0.5, 0.9])
def test_shifted_wave_is_read_back(wavelength_px: float, fraction_px: float) -> None:
    """Moved by a fraction of a pixel and read back there, a wave differs by no more than the spline's aliases.

    The alias of frequency w is weakened by (w / (2 pi - w))^4 along each axis; it can add to itself at both reads.
    """
    frequency = 2 * np.pi / wavelength_px
    before = read_at_pixels(smooth(wave(frequency)))
    columns, rows = np.meshgrid(np.arange(10, 86, dtype=np.float32), np.arange(10, 86, dtype=np.float32))
    after = read_between(smooth(wave(frequency, fraction_px)), columns + np.float32(fraction_px), rows)
    along = frequency * np.array([np.cos(0.3), np.sin(0.3)])
    aliases = float(np.sum((along / (2 * np.pi - along)) ** 4))
    contrast = float(np.ptp(before)) / 2
    assert np.abs(after - before[10:86, 10:86]).max() / contrast < 2.5 * aliases + 1e-4
