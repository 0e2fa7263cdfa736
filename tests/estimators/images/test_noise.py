"""Noise of patches: white noise is measured, edges and slopes are not noise, texture only adds."""

import numpy as np
import pytest

from fedora_qa.estimators.images.noise import noise_variances

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("sigma_dn", [0.3, 1.0, 5.0])
def test_white_noise_is_measured(sigma_dn: float) -> None:
    """Over 200 patches of 32 px the mean variance is right to 3%."""
    noise = RNG.normal(0.0, sigma_dn, (200, 32, 32)).astype(np.float32)
    assert noise_variances(noise).mean() == pytest.approx(sigma_dn**2, rel=0.03)


def test_what_bends_along_one_axis_is_no_noise() -> None:
    """A slope, and an edge along the columns, however high."""
    columns, rows = np.meshgrid(np.arange(32.0), np.arange(32.0))
    patches = np.stack([3 * columns - rows + 7, 200.0 * (columns > 15)]).astype(np.float32)
    np.testing.assert_allclose(noise_variances(patches), 0.0, atol=1e-9)


def test_texture_only_adds() -> None:
    """Fine texture under noise reads as more noise, never as less."""
    columns, rows = np.meshgrid(np.arange(32.0), np.arange(32.0))
    texture = 20 * np.sin(1.2 * columns) * np.sin(0.9 * rows)
    noise = RNG.normal(0.0, 1.0, (50, 32, 32))
    assert (noise_variances((texture + noise).astype(np.float32)) > 1.0).all()
