"""A frame that is read in parts is the frame that is read whole."""

import numpy as np

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.flow.warp import (
    parts_about,
    read_at_pixels,
    read_between,
    read_parts,
    smooth,
    smoothed_patches,
    smoothing_taps,
    taps_at_pixels,
)

HEIGHT, WIDTH = 90, 120
RNG = np.random.default_rng(3)
RGB = RNG.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
OF_CODES = np.outer(LUMA_WEIGHTS_RGB, np.arange(256.0)).astype(np.float32)
LUMA = (RGB @ np.array(LUMA_WEIGHTS_RGB)).astype(np.float32)


def test_parts_are_as_the_whole() -> None:
    """Within the image, at its border and beyond it, where tiles are torn apart, and where a place is no number."""
    corners = np.array([[20, 30], [-6, -4], [WIDTH - 20, HEIGHT - 25], [50, 40]])
    steps = np.arange(24, dtype=np.float32)
    columns = (corners[:, 0, None, None] + steps + RNG.uniform(-2, 2, (4, 24, 24))).astype(np.float32)
    rows = (corners[:, 1, None, None] + steps[:, None] + RNG.uniform(-2, 2, (4, 24, 24))).astype(np.float32)
    columns[3, :, 12:] += 40
    rows[3, 0, 0] = np.nan
    for sigma_px in (1.0, 2.3):
        parts = parts_about(columns, rows, WIDTH, HEIGHT)
        read = read_parts(RGB, OF_CODES, smoothing_taps(sigma_px), parts, columns, rows)
        whole = read_between(smooth(LUMA, sigma_px), columns.reshape(-1, 24), rows.reshape(-1, 24))
        np.testing.assert_allclose(read, whole.reshape(read.shape), atol=2e-3)


def test_a_part_is_no_larger_than_it_must() -> None:
    """Of a tile of 32 pixels that are read at pixels: one before, and two behind the last."""
    columns, rows = np.meshgrid(np.arange(40, 72, dtype=np.float32), np.arange(20, 52, dtype=np.float32))
    assert parts_about(columns[None], rows[None], WIDTH, HEIGHT).tolist() == [[39, 19, 74, 54]]


def test_patches_of_luma() -> None:
    """Those of the whole luma."""
    corners = np.array([[0, 0], [33, 41], [WIDTH - 32, HEIGHT - 32]])
    expected = [LUMA[top : top + 32, left : left + 32] for left, top in corners]
    np.testing.assert_allclose(
        smoothed_patches(RGB, OF_CODES, np.ones(1, np.float32), corners, 32), expected, atol=1e-3
    )


def test_patches_at_pixels_are_those_of_the_whole() -> None:
    """Gaussian and B-spline in one, up to the border of the image."""
    corners = np.array([[0, 0], [33, 41], [WIDTH - 36, HEIGHT - 36]])
    for sigma_px in (1.0, 2.3):
        seen = read_at_pixels(smooth(LUMA, sigma_px))
        expected = [seen[top : top + 36, left : left + 36] for left, top in corners]
        found = smoothed_patches(RGB, OF_CODES, taps_at_pixels(sigma_px), corners, 36)
        np.testing.assert_allclose(found, expected, atol=2e-3)
