"""Pictures are means and sums of whole blocks of pixels, as another library computes them."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from skimage.measure import block_reduce

from fedora_qa.evidence.pictures import (
    block_px,
    events_of_pixels,
    mean_codes,
    mean_values,
    picture_shape,
    summed_counts,
)

SIZES = st.tuples(st.integers(1, 23), st.integers(1, 23))


def whole_blocks(image: NDArray[Any], block: int) -> NDArray[Any]:
    rows, columns = (size // block * block for size in image.shape[:2])
    return image[:rows, :columns]


@given(st.integers(1, 5000), st.integers(1, 500))
def test_pictures_are_as_wide_as_they_may_be(width: int, most: int) -> None:
    """The block is the least whose pictures are no wider than asked."""
    block = block_px(width, most)
    assert width // block <= most
    assert block == 1 or width / (block - 1) > most


@settings(deadline=None)  # the first example waits for compilation
@given(st.integers(2, 5), st.integers(0, 1000))
def test_depth_is_the_mean_of_what_is_valid(block: int, seed: int) -> None:
    """Invalid pixels do not count; a block without valid ones is NaN; remainders of blocks are left out."""
    random = np.random.default_rng(seed)
    image = random.uniform(0.1, 30, (block * 3 + 1, block * 4 + block - 1, 2)).astype(np.float32)
    image[random.random(image.shape) < 0.3] = np.nan
    image[:block, :block] = np.inf
    expected_of = np.where(np.isfinite(image), image, np.nan)
    with np.errstate(invalid="ignore"):
        counts = block_reduce(np.isfinite(whole_blocks(image, block)), (block, block, 1), np.sum)
        sums = block_reduce(np.nan_to_num(whole_blocks(expected_of, block)).astype(float), (block, block, 1), np.sum)
        expected = sums / np.where(counts, counts, np.nan)
    np.testing.assert_allclose(mean_values(image, block), expected, rtol=1e-5)


def test_values_are_kept_where_nothing_is_made_smaller() -> None:
    """With blocks of one pixel a picture is the image; what is infinite is NaN."""
    image = np.array([[1.5, np.nan], [np.inf, -2.25]], np.float32)
    np.testing.assert_array_equal(mean_values(image, 1), [[1.5, np.nan], [np.nan, -2.25]])


@settings(deadline=None)  # the first example waits for compilation
@given(st.integers(1, 5), st.integers(0, 1000))
def test_codes_are_rounded_means(block: int, seed: int) -> None:
    """Colours are averaged channel by channel and rounded once."""
    image = np.random.default_rng(seed).integers(0, 256, (block * 2 + 1, block * 3, 3)).astype(np.uint8)
    means = block_reduce(whole_blocks(image, block).astype(float), (block, block, 1), np.mean)
    assert np.abs(mean_codes(image, block) - means).max() <= 0.5 + 1e-4


@given(SIZES, st.integers(1, 30), st.integers(0, 1000))
def test_no_event_of_a_whole_block_is_lost(size: tuple[int, int], block: int, seed: int) -> None:
    """Sums are exact; an image smaller than a block is one block."""
    counts = np.random.default_rng(seed).integers(0, 50, size).astype(np.uint16)
    small = summed_counts(counts, block)
    assert small.shape == picture_shape(*size, block)
    kept = [side if side < block else side // block * block for side in size]
    assert int(small.sum()) == int(counts[: kept[0], : kept[1]].sum())


@settings(deadline=None)  # the first example waits for compilation
@given(SIZES, st.integers(1, 30), st.integers(0, 1000))
def test_events_of_blocks_are_those_of_their_pixels(size: tuple[int, int], block: int, seed: int) -> None:
    """Counted block by block, events are as many as summed over pixels, by polarity; those beyond are left out."""
    random = np.random.default_rng(seed)
    x, y, p = random.integers(0, 30, 500), random.integers(0, 30, 500), random.integers(0, 2, 500)
    counts = np.zeros((2, 30, 30), np.uint16)
    np.add.at(counts, (p, y, x), 1)
    expected = summed_counts(counts[:, : size[0], : size[1]], block)
    columns = (x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))
    np.testing.assert_array_equal(events_of_pixels(*columns, size, block), expected)


def test_events_of_a_pixel_do_not_wrap() -> None:
    """More events of a block than fit are shown as the most that do."""
    x, p = np.zeros(70_000, np.uint16), np.ones(70_000, np.uint8)
    assert events_of_pixels(x, x, p, (1, 1), 1).tolist() == [[[0]], [[65_535]]]


@pytest.mark.parametrize("count", [70_000, 65_535])
def test_counts_do_not_wrap(count: int) -> None:
    """More events than fit are shown as the most that do."""
    assert summed_counts(np.array([[count]]), 1)[0, 0] == 65_535
