"""Noise of single channels: white noise is measured, texture that channels share is not noise."""

import numpy as np
import pytest

from fedora_qa.estimators.images.channel_noise import PATCH_PX, channel_noise_variances, spread_patches

ROWS, COLUMNS = np.mgrid[:160, :200]


def coloured(seed: int = 0) -> np.ndarray:
    """Two surfaces of different colours, each with fine texture in its own colour."""
    texture = np.random.default_rng(seed).uniform(0.5, 1.5, (160, 200, 1))
    colours = np.where((COLUMNS > 90)[..., np.newaxis], [90.0, 120.0, 40.0], [120.0, 80.0, 60.0])
    return texture * colours


@pytest.mark.parametrize("deviations", [(2.0, 2.0, 2.0), (0.5, 1.0, 4.0)])
def test_white_noise_is_measured_on_even_surfaces(deviations: tuple[float, ...]) -> None:
    """Of each channel, whatever that of the others is."""
    noise = np.random.default_rng(1).normal(size=(160, 200, 3)) * deviations
    smooth = np.stack([0.5 * COLUMNS, 0.3 * ROWS, 0.2 * COLUMNS], axis=-1) + noise
    assert channel_noise_variances(spread_patches(smooth)) == pytest.approx(np.square(deviations), rel=0.1)


def test_texture_of_one_colour_is_no_noise() -> None:
    """Also where it is as fine as pixels, and of another colour on another surface."""
    assert channel_noise_variances(spread_patches(coloured())).max() < 1e-6


def test_noise_within_texture_is_bounded() -> None:
    """The other channels predict the texture with noise of their own, so that the result is an upper bound."""
    noise = np.random.default_rng(1).normal(0.0, 2.0, (160, 200, 3))
    variances = channel_noise_variances(spread_patches(coloured() + noise))
    assert (variances > 4.0).all()
    assert (variances < 16.0).all()


def test_a_small_frame_has_no_patch() -> None:
    """Nothing is known of its noise."""
    assert channel_noise_variances(spread_patches(np.ones((PATCH_PX - 1, 40, 3)))).tolist() == [0.0, 0.0, 0.0]
