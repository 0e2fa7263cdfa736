"""Transfer curves."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from skimage.color import rgb2xyz

from fedora_qa.estimators.images.luma import TRANSFERS, to_code, to_linear

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
