"""Depth frames made ready to be read: edges as everywhere, and how far values may err."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from fedora_qa.estimators.depth.inverse_depth import depth_image
from fedora_qa.estimators.flow.mask import edges, inverse_depth

HEIGHT, WIDTH = 61, 83


def boards(seed: int) -> np.ndarray:
    """Slanted boards before a wall, and a hole."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    depth_m = 9.0 / (1 + 0.002 * columns + 0.001 * rows)
    for _ in range(4):
        left, top = rng.integers(0, WIDTH - 20), rng.integers(0, HEIGHT - 20)
        depth_m[top : top + 15, left : left + 18] = 3.0 / (1 + 0.004 * columns[top : top + 15, left : left + 18])
    depth_m[40:43, 10:14] = np.nan
    return np.asarray(depth_m, dtype=np.float32)


@pytest.mark.parametrize("seed", range(3))
def test_edges_are_those_that_flow_is_masked_by(seed: int) -> None:
    """One definition of an edge for depth and flow, here by a compiled loop and there by OpenCV."""
    depth_m = boards(seed)
    np.testing.assert_array_equal(depth_image(depth_m).near_edge, edges(inverse_depth(depth_m)))


@pytest.mark.parametrize("seed", range(2))
def test_errors_are_shares_of_the_largest_bend_around(seed: int) -> None:
    """Against second differences by slices, and the largest of nine by a filter."""
    depth_m = boards(seed).astype(np.float64)
    inverse = np.where(np.isfinite(depth_m), 1 / depth_m, 0.0)
    bends = np.zeros_like(inverse)
    bends[:, 1:-1] += np.abs(np.diff(inverse, 2, axis=1))
    bends[1:-1] += np.abs(np.diff(inverse, 2, axis=0))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(bends, 1), (3, 3)).max(axis=(2, 3))
    image = depth_image(depth_m, relative_step=1e-3)
    # Differences in single precision err by 2e-7 of themselves: here by a thousandth of what rounding may do.
    np.testing.assert_allclose(image.error_per_m, 0.25 * around + 8 * 2.0**-24 * inverse, rtol=1e-3)
    assert image.quantisation_error == 5e-4
    assert image.nearest_per_m == pytest.approx(inverse.max())


@pytest.mark.parametrize("shape", [(61, 83), (721, 901), (1300, 1400)])
def test_clearance_is_at_most_the_distance_from_marks(shape: tuple[int, int]) -> None:
    """Against exact distances of each pixel; told by blocks, where an image is large, a little is given away."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    depth_m = (9.0 / (1 + 0.002 * columns + 0.001 * rows)).astype(np.float32)
    depth_m[shape[0] // 3, shape[1] // 2 :: 37] = np.nan
    image = depth_image(depth_m)
    block = image.block_px
    assert (block > 1) == (depth_m.size > 180_000)
    told = np.repeat(np.repeat(image.clearance_px, block, axis=0), block, axis=1)[: shape[0], : shape[1]]
    exact = distance_transform_edt(image.near_edge == 0)
    of_chamfer = 0.09  # what two steps' weights err by (Borgefors 1986)
    assert np.all(told <= (1 + of_chamfer) * exact)
    assert np.all(told >= (1 - of_chamfer) * exact - 2 * np.sqrt(2.0) * (block - 1))


@pytest.mark.parametrize(("axis", "shift_px"), [(0, 3), (1, -5)])
def test_what_a_moved_image_lets_in_is_near_an_edge(axis: int, shift_px: int) -> None:
    """An image of blocks, moved by no multiple of them, keeps its pixels and their distances from marks."""
    image = depth_image(np.full((700, 900), 4.0, np.float32))
    moved = image.moved(axis, shift_px)
    assert image.block_px == moved.block_px == 2
    entered = moved.near_edge[:, :shift_px] if axis == 0 else moved.near_edge[shift_px:]
    assert entered.all()
    exact = distance_transform_edt(moved.near_edge == 0)[::2, ::2]
    assert np.all(moved.clearance_px <= 1.09 * exact)
    assert moved.clearance_px.max() > 300
