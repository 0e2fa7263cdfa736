"""Luma by table, of linear codes, and at some pixels, against NumPy's weighted sums."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from skimage.color import rgb2xyz

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.luma import (
    LUMA_ROUNDING_VARIANCE_DN2,
    LUMA_WEIGHTS,
    TRANSFERS,
    cut_off,
    luma_of,
    luma_of_linear,
    luma_table,
    sampled_luma,
    to_code,
    to_linear,
)

RGB = np.random.default_rng(0).integers(0, 256, (17, 23, 3)).astype(np.uint8)
RGB.flags.writeable = False  # as in decoded frames, so that loops are compiled once


def test_luma_is_the_weighted_sum_of_linear_values() -> None:
    """Of any curve by its table; of linear codes both ways give the same bits."""
    curve = 255 * (np.arange(256) / 255) ** 2.2
    np.testing.assert_allclose(luma_of(RGB, luma_table(curve)), curve[RGB] @ np.array(LUMA_WEIGHTS_RGB), rtol=1e-6)
    by_table = luma_of(RGB, luma_table(np.arange(256.0)))
    np.testing.assert_array_equal(luma_of_linear(RGB, LUMA_WEIGHTS), by_table)


@pytest.mark.parametrize(("first", "stride"), [(0, 1), (1, 4), (3, 5)])
def test_some_pixels_have_the_luma_of_all(first: int, stride: int) -> None:
    some = sampled_luma(RGB, first, stride, LUMA_WEIGHTS)
    np.testing.assert_allclose(some, (RGB @ LUMA_WEIGHTS)[first::stride, first::stride], rtol=1e-6)


def test_rounded_channels_scatter_the_luma_as_stated() -> None:
    """By many colours that are rounded to whole numbers."""
    exact = np.random.default_rng(1).uniform(0, 255, (200_000, 3))
    errors = (np.rint(exact) - exact) @ LUMA_WEIGHTS
    assert np.var(errors) == pytest.approx(LUMA_ROUNDING_VARIANCE_DN2, rel=0.02)


def test_a_channel_at_its_end_or_a_bright_pixel_is_cut_off() -> None:
    """In rows with such a pixel and in rows without one."""
    luma = luma_of_linear(RGB, LUMA_WEIGHTS)
    for saturated in (100.0, 300.0):
        due = (RGB == 255).any(axis=2) | (luma >= np.float32(saturated))
        np.testing.assert_array_equal(cut_off(RGB, luma, saturated), due)


CODES = np.arange(256.0)


@example("srgb", [9.0, 9.8, 10.3, 10.4])  # on both sides of where the toe meets the curve, code 10.31
@given(st.sampled_from(TRANSFERS), st.lists(st.floats(0, 255), min_size=1, max_size=20))
def test_codes_and_linear_values_are_inverse(transfer: str, codes: list[float]) -> None:
    """Decoding what was encoded gives it back, between whole codes too."""
    np.testing.assert_allclose(to_code(to_linear(np.array(codes), transfer), transfer), codes, atol=1e-6)


def test_srgb_is_that_of_scikit_image() -> None:
    """The luminance of grey by scikit-image's colour conversion."""
    grey = np.repeat((CODES / 255)[:, np.newaxis, np.newaxis], 3, axis=2)
    np.testing.assert_allclose(to_linear(CODES, "srgb") / 255, rgb2xyz(grey)[:, 0, 1], atol=1e-6)


def test_black_and_white_stay_and_curves_rise() -> None:
    """Every curve keeps 0 and 255, rises, and a display's curve lies below the straight line."""
    for transfer in TRANSFERS:
        linear = to_linear(CODES, transfer)
        np.testing.assert_allclose(linear[[0, 255]], [0, 255], atol=1e-9)
        assert np.all(np.diff(linear) > 0)
        assert np.all(linear <= CODES + 1e-9)


def test_unknown_curve_is_refused() -> None:
    """A curve that nobody defined is an error that names the known ones."""
    for convert in (to_linear, to_code):
        with pytest.raises(ValueError, match="Expected a transfer of linear, srgb"):
            convert(CODES, "rec709")
