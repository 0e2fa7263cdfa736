"""Counts over the bits of images say what NumPy says of their values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.images.values import count_codes, count_not_finite

FLOATS = st.floats(width=32, allow_nan=True, allow_infinity=True)


def as_numpy_counts(vectors: NDArray[np.float32], most: float) -> tuple[int, int, int]:
    """Return the same counts from the values themselves."""
    sizes = np.abs(vectors)
    beyond = (sizes > np.float32(min(most, float(np.finfo(np.float32).max)))) & np.isfinite(vectors)
    each = (np.isnan(vectors), np.isinf(vectors), beyond)
    nan, infinite, far = (int(np.count_nonzero(one.any(axis=1))) for one in each)
    return nan, infinite, far


@settings(deadline=None)
@given(st.lists(st.tuples(FLOATS, FLOATS), max_size=40), st.one_of(st.just(np.inf), st.floats(0, 2.0**127, width=32)))
def test_vectors_are_counted_as_numpy_counts_them(vectors: list[tuple[float, float]], most: float) -> None:
    """NaN of either sign, infinities, and what is beyond a length: any of two components, whatever the other is."""
    values = np.array(vectors, np.float32).reshape(-1, 2)
    assert count_not_finite(values, most) == as_numpy_counts(values, most)


@pytest.mark.parametrize("most", [1.0, np.inf])
def test_only_nan_beside_what_may_be(most: float) -> None:
    """A field whose invalid pixels are NaN, one component or both, of any bits, holds nothing else that is wrong."""
    values = np.linspace(-1, 1, 2000, dtype=np.float32).reshape(-1, 2)
    values[::7] = np.nan
    values[3, 0] = -np.nan
    values.view(np.uint32)[5, 1] = 0x7F800001
    assert count_not_finite(values, most) == as_numpy_counts(values, most) == (145, 0, 0)


@pytest.mark.parametrize("shape", [(1, 1, 3), (9, 14, 3), (40, 33, 3)])
@pytest.mark.parametrize("every_px", [1, 4])
def test_codes_are_counted_as_numpy_counts_them(shape: tuple[int, int, int], every_px: int) -> None:
    """Codes of every so many-th pixel are added to those counted before, and pixels at 255 are counted."""
    rgb = np.random.default_rng(3).choice(np.array([0, 7, 254, 255], np.uint8), shape, p=[0.5, 0.2, 0.2, 0.1])
    counts = np.ones(256, np.int64)
    some = rgb[::every_px, ::every_px]
    assert count_codes(rgb, every_px, counts) == np.count_nonzero(some.max(axis=2) == 255)
    np.testing.assert_array_equal(counts - 1, np.bincount(some.ravel(), minlength=256))
