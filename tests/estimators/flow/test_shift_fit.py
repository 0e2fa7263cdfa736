"""The shift of a flow field: exact without noise, with honest errors, beside variables of unit variance, or none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from fedora_qa.estimators.flow.shift_fit import ShiftFit, ShiftSample, fit_shift

HEIGHT, WIDTH = 96, 128
COLUMNS, ROWS = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
PLACES = np.s_[::3, ::3]
CORRECTION = np.stack([np.ones((HEIGHT, WIDTH)), 0.01 * COLUMNS], axis=-1)
"""Change of the flow by a variable of variance 1: constant to the right, and a turn."""


def of_plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Flow (..., 2) ahead over a plane: u = y (x - 64) / 500, v = y^2 / 500, px."""
    return np.stack([y * (x - 64.0) / 500.0, y * y / 500.0], axis=-1)


def of_ramp(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Flow whose gradient is the same everywhere."""
    return np.stack([0.05 * (x - 60) - 0.02 * y, 0.03 * x + 0.04 * (y - 40)], axis=-1)


def sample_of(stored_px: np.ndarray, recomputed_px: np.ndarray, effects_px: np.ndarray | None = None) -> ShiftSample:
    """Every third pixel of every third row that has a value."""
    valid = np.isfinite(stored_px[PLACES][..., 0]).ravel()
    effects = np.zeros((HEIGHT, WIDTH, 2, 0)) if effects_px is None else effects_px[..., None]
    columns, rows = (each[PLACES].ravel()[valid].astype(np.intp) for each in (COLUMNS, ROWS))
    stored, of_variables = (each[PLACES].reshape(len(valid), *each.shape[2:])[valid] for each in (stored_px, effects))
    return ShiftSample(columns, rows, stored, recomputed_px, of_variables, np.zeros(effects.shape[-1]), 1e-6)


def fitted(sample: ShiftSample) -> ShiftFit:
    fit = fit_shift(sample)
    assert fit is not None
    return fit


@pytest.mark.parametrize("shift_px", [(0.1, 0.0), (0.28, 0.24), (-0.5, 0.5), (2.6, -1.7), (0.0, -7.3)])
def test_a_shifted_ramp_is_measured_exactly(shift_px: tuple[float, float]) -> None:
    """In closed form: the field at x is that of x - d."""
    recomputed = of_ramp(COLUMNS, ROWS)
    fit = fitted(sample_of(of_ramp(COLUMNS - shift_px[0], ROWS - shift_px[1]), recomputed))
    np.testing.assert_allclose(fit.shift_px, shift_px, atol=1e-6)
    assert fit.removed_share > 0.999


@pytest.mark.parametrize("shift_px", [(0.28, 0.24), (-2.6, 0.7)])
def test_a_field_that_was_resampled_across_a_step_is_measured(shift_px: tuple[float, float]) -> None:
    """SciPy shifts a field of two surfaces, and mixes them where they meet."""
    recomputed = of_plane(COLUMNS, ROWS)
    recomputed[:, 70:] += 4.0
    recomputed[20:30, 20:30] = np.nan
    stored = ndimage.shift(recomputed, (shift_px[1], shift_px[0], 0), order=1, cval=np.nan)
    fit = fitted(sample_of(stored, recomputed))
    np.testing.assert_allclose(fit.shift_px, shift_px, atol=1e-6)
    assert fit.removed_share > 0.999


def test_errors_are_those_of_the_scatter() -> None:
    """The covariance that fits of forty noisy fields state, on the average, is that of their results."""
    shift, recomputed = np.array([0.3, -0.2]), of_plane(COLUMNS, ROWS)
    clean = ndimage.shift(recomputed, (shift[1], shift[0], 0), order=1, cval=np.nan)
    noise = (np.random.default_rng(seed).normal(0.0, 0.1, clean.shape) for seed in range(40))
    fits = [fitted(sample_of(clean + of_field, recomputed)) for of_field in noise]
    variances = np.mean([(fit.shift_px - shift) ** 2 for fit in fits], axis=0)
    stated = np.mean([np.diag(fit.covariance_px2) for fit in fits], axis=0)
    # A variance of forty values has a standard error of sqrt(2 / 40) = 22%: 2.7 of these.
    np.testing.assert_allclose(variances / stated, 1.0, atol=0.6)


def test_errors_of_a_strip_are_those_of_its_tiles() -> None:
    """Pixels of a tile err together: a strip of a few rows has as many independent deviations as tiles."""
    shift, recomputed = np.array([0.3, -0.2]), of_ramp(COLUMNS, ROWS)
    clean = of_ramp(COLUMNS - shift[0], ROWS - shift[1])
    clean[12:] = np.nan
    fits = []
    for seed in range(40):
        of_tiles = np.random.default_rng(seed).normal(0.0, 0.1, (1, WIDTH // 16 + 1, 2))
        fits.append(fitted(sample_of(clean + np.repeat(of_tiles, 16, axis=1)[:, :WIDTH], recomputed)))
    variances = np.mean([(fit.shift_px - shift) ** 2 for fit in fits], axis=0)
    stated = np.mean([np.diag(fit.covariance_px2) for fit in fits], axis=0)
    np.testing.assert_allclose(variances / stated, 1.0, atol=0.6)


def test_the_effect_of_resampling_is_stated() -> None:
    """Of a curved flow that was computed at other places, not resampled, it is the difference from the shift."""
    shift, recomputed = np.array([0.3, -0.5]), of_plane(COLUMNS, ROWS)
    fit = fitted(sample_of(of_plane(COLUMNS - shift[0], ROWS - shift[1]), recomputed))
    difference = fit.shift_px - shift
    assert np.abs(difference).max() > 1e-3
    np.testing.assert_allclose(-fit.resampling_px, difference, atol=0.1 * np.abs(difference).max())


def test_a_tenth_of_other_pixels_moves_it_little() -> None:
    """Values of something else, off by 3 px, in a tenth of the pixels."""
    shift, recomputed = np.array([0.3, -0.2]), of_plane(COLUMNS, ROWS)
    stored = of_plane(COLUMNS - shift[0], ROWS - shift[1])
    random = np.random.default_rng(3)
    stored += random.normal(0.0, 0.01, stored.shape)
    stored[random.random((HEIGHT, WIDTH)) < 0.1] += 3.0
    fit = fitted(sample_of(stored, recomputed))
    np.testing.assert_allclose(fit.shift_px, shift, atol=0.05)


def test_a_shift_is_measured_beside_a_correction() -> None:
    """A variable of variance 1 turns the flow by a pixel, and is fitted with the shift."""
    recomputed = of_plane(COLUMNS, ROWS)
    corrected = recomputed + 0.8 * CORRECTION
    sample = sample_of(ndimage.shift(corrected, (0.24, 0.28, 0), order=1, cval=np.nan), recomputed, CORRECTION)
    fit = fitted(sample)
    np.testing.assert_allclose(fit.shift_px, (0.28, 0.24), atol=0.02)
    np.testing.assert_allclose(fit.variables, [0.8], atol=0.02)
    # About the corrected flow it is exact.
    about = fitted(replace(sample, recomputed_px=corrected, variables=np.array([0.8])))
    np.testing.assert_allclose(about.shift_px, (0.28, 0.24), atol=1e-6)
    np.testing.assert_allclose(about.variables, [0.8], atol=1e-6)


def test_what_does_not_determine_a_shift_gives_none() -> None:
    """An even flow, a gradient of one direction, a shift beyond the range, and too few pixels."""
    even = np.ones((HEIGHT, WIDTH, 2))
    assert fit_shift(sample_of(even + 0.1, even)) is None
    slanted = np.stack([COLUMNS, COLUMNS], axis=-1) * 0.05
    assert fit_shift(sample_of(slanted + 0.1, slanted)) is None
    ramp = of_ramp(COLUMNS, ROWS)
    assert fit_shift(sample_of(of_ramp(COLUMNS - 20, ROWS), ramp)) is None
    few = np.full((HEIGHT, WIDTH, 2), np.nan)
    few[:9, :9] = ramp[:9, :9]
    assert fit_shift(sample_of(few, ramp)) is None
