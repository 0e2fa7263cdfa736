"""Counts over the bits of images against those of NumPy, and of values that no correct file holds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.images.values import (
    DIGEST_BYTES,
    add_up,
    count_codes,
    count_not_finite,
    digest_of,
    is_of_one_code,
    tally_depth,
    tally_flow,
    tally_samples,
)

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


def test_an_image_of_one_code_is_told_by_every_value() -> None:
    """One other value anywhere, in one channel, is enough; without values there is no code."""
    image = np.full((3, 4, 3), 7, np.uint8)
    assert is_of_one_code(image)
    for place in range(image.size):
        other = image.copy()
        other.flat[place] = 8
        assert not is_of_one_code(other)
    assert not is_of_one_code(image[:0])


def test_samples_that_are_not_finite_are_counted_by_row() -> None:
    samples = np.zeros((5, 3))
    samples[2, 1], samples[2, 2], samples[4, 0] = np.nan, np.inf, -np.inf
    counts = tally_samples("path/imu/w", 10, samples)
    assert (counts.values, counts.nan, counts.first) == (5, 2, (12, 0))


def test_flow_counts_invalid_infinite_and_too_long_vectors() -> None:
    flow_px = np.zeros((4, 5, 2), np.float32)
    flow_px[0, 0], flow_px[1, 2, 0], flow_px[3, 4, 1] = np.nan, np.inf, 90.0
    counts = tally_flow("path/flow/10hz", 7, flow_px, longest_px=50.0)
    assert (counts.values, counts.nan, counts.infinite, counts.outside) == (20, 1, 1, 1)
    assert counts.first == (7, 1 * 5 + 2)
    assert counts.filled == ((7, pytest.approx(0.95)),)


def test_depth_outside_of_its_range_may_be_in_another_unit() -> None:
    depth_mm = np.full((3, 4), 2_000.0, np.float32)
    depth_mm[0, 1], depth_mm[2, 2], depth_mm[1, 1] = 2.0, -5.0, np.nan
    counts = tally_depth("path/depth", 0, depth_mm, (0.5, 40.0))
    assert (counts.nan, counts.outside, counts.rescaled) == (1, 2, 1)
    assert (counts.low, counts.high, counts.first) == (-5.0, 2.0, (0, 1))


def test_tallies_of_a_dataset_add_up_and_keep_the_first_place() -> None:
    clean, bad = np.zeros((2, 3)), np.full((2, 3), np.nan)
    (total,) = add_up([tally_samples("k", 0, clean), tally_samples("k", 2, bad), tally_samples("k", 4, bad)])
    assert (total.values, total.nan, total.first) == (6, 4, (2, 0))
    long, none = np.full((2, 4, 2), 1e4, np.float32), np.zeros((2, 4, 2), np.float32)
    (total,) = add_up([tally_flow("f", row, field, 100.0) for row, field in enumerate([long, none, long])])
    assert (total.outside, total.low, total.high) == (16, pytest.approx(1e4), pytest.approx(1e4))


RNG = np.random.default_rng(0)
IMAGE = RNG.integers(0, 256, (45, 67, 3)).astype(np.uint8)


def test_equal_images_have_equal_digests() -> None:
    """Wherever in memory they lie, writable or not, contiguous or cut out."""
    wide = np.zeros((45, 90, 3), np.uint8)
    wide[:, 5:72] = IMAGE
    shifted = np.zeros(IMAGE.size + 3, np.uint8)[3:].reshape(IMAGE.shape)
    shifted[:] = IMAGE
    assert len(digest_of(IMAGE)) == DIGEST_BYTES
    for same in (IMAGE.copy(), wide[:, 5:72], shifted):
        np.testing.assert_array_equal(digest_of(same), digest_of(IMAGE))


def test_every_byte_counts() -> None:
    """One bit of a code, anywhere, the rest that fills no eight words among it."""
    digests = {digest_of(IMAGE).tobytes()}
    for place in range(0, IMAGE.size, 7):
        changed = IMAGE.copy()
        changed.flat[place] ^= 1
        digests.add(digest_of(changed).tobytes())
    assert len(digests) == len(range(0, IMAGE.size, 7)) + 1


@pytest.mark.parametrize("shape", [(16, 16, 3), (8, 32, 3), (32, 24, 1)])
def test_order_and_shape_count(shape: tuple[int, int, int]) -> None:
    """Rows that changed places, and the same bytes in another shape, are another image."""
    image = IMAGE.reshape(-1)[:768].reshape(shape)
    others = (image[::-1], image[:, ::-1], np.roll(image, 1, 0), image.reshape(shape[1], shape[0], shape[2]))
    different = [one for one in others if one.shape != shape or not np.array_equal(one, image)]
    assert len({digest_of(one).tobytes() for one in (image, *different)}) == len(different) + 1


def test_images_of_one_value_and_none() -> None:
    """Nothing to fold gives a digest, and so does black."""
    black, white = np.zeros((40, 40, 3), np.uint8), np.full((40, 40, 3), 255, np.uint8)
    empty = np.zeros((0, 0, 3), np.uint8)
    assert len({digest_of(one).tobytes() for one in (black, white, empty)}) == 3
