"""Tiles cover the image but for its margin, and which of them are sampled follows from the seed alone."""

import numpy as np
import pytest

from fedora_qa.estimators.flow.residual import TileGrid, patches_of, pixels_of


@pytest.mark.parametrize(("height", "width", "count"), [(540, 720, 16 * 22), (48, 48, 1), (47, 200, 0), (10, 10, 0)])
def test_grid_holds_whole_tiles_clear_of_the_border(height: int, width: int, count: int) -> None:
    """As many as fit 8 px clear of the border; none in an image that is too small."""
    grid = TileGrid.of(height, width)
    assert len(grid.origins) == count
    if count:
        assert grid.origins.min() >= 8
        assert (grid.origins.max(axis=0) + 32 <= np.array([width, height]) - 8).all()


def test_sample_depends_on_the_seed_only() -> None:
    """The same share and seed give the same tiles; other fields other tiles; all of them at share 1."""
    grid = TileGrid.of(540, 720)
    first, again, other = grid.sample(0.25, 25, 7), grid.sample(0.25, 25, 7), grid.sample(0.25, 25, 8)
    assert len(first) == 88
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(grid.sample(1.0, 1), grid.origins)
    assert len(grid.sample(1e-9, 1)) == 1


@pytest.mark.parametrize("channels", [(), (2,)])
def test_patches_are_the_pixels_they_name(channels: tuple[int, ...]) -> None:
    """`patches_of` an image is that image at the columns and rows of `pixels_of`."""
    image = np.random.default_rng(0).random((90, 120, *channels))
    origins = TileGrid.of(90, 120).origins
    columns, rows = pixels_of(origins)
    np.testing.assert_array_equal(patches_of(image, origins), image[rows, columns])
