"""Depth frames made ready to be read: edges as everywhere, and how far values may err."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from fedora_qa.estimators.depth.inverse_depth import LEAST_STEP, depth_image, depth_steps
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


FAR_M = 30.0


@settings(deadline=None)  # the first example compiles
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(0, 1))
def test_a_plane_has_no_steps(right: float, down: float, axis: int) -> None:
    """Inverse depth is affine on a plane, however slanted."""
    columns, rows = np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 30))
    depth_m = 5.0 / (1.0 + right * columns + down * rows)
    assert len(depth_steps(depth_m, axis, farthest_m=FAR_M)) == 0


@pytest.mark.parametrize("behind_m", [10.0, np.nan])
def test_a_box_has_its_outline(behind_m: float) -> None:
    """A box before a wall, or before nothing, steps halfway between its pixels and those beside it, on both sides."""
    depth_m = np.full((30, 40), behind_m)
    depth_m[8:20, 11:31] = 4.0
    right, down = (depth_steps(depth_m, axis, farthest_m=FAR_M) for axis in (0, 1))
    assert set(right.columns) == {10.5, 30.5}
    assert set(right.rows) == set(range(8, 20))
    assert set(down.rows) == {7.5, 19.5}
    assert set(down.columns) == set(range(11, 31))
    np.testing.assert_array_equal(right.near_first, right.columns == 30.5)
    np.testing.assert_array_equal(down.near_first, down.rows == 19.5)
    np.testing.assert_allclose(right.depths_m, 4.0)


@settings(deadline=None)  # the first example compiles
@given(st.floats(0.2, 8.0), st.floats(0.0, 1.0), st.integers(0, 1), st.sampled_from([np.nan, FAR_M, np.inf]))
def test_what_fades_out_of_range_is_no_outline(slope: float, phase: float, axis: int, beyond: float) -> None:
    """Ground that ends where the range ends has no step there, however few pixels remain to the horizon."""
    rows = np.arange(50)[::-1] + phase
    inverse = (slope * (rows - 20) / FAR_M)[:, np.newaxis].repeat(20, axis=1)
    depth_m = np.divide(1.0, inverse, out=np.full(inverse.shape, np.inf), where=inverse > 0)
    depth_m = np.where(depth_m < FAR_M, depth_m, beyond)
    if axis == 0:
        depth_m = depth_m.T
    assert len(depth_steps(depth_m, axis, farthest_m=FAR_M)) == 0
    assert len(depth_steps(np.flip(depth_m, 1 - axis), axis, farthest_m=FAR_M)) == 0


def test_a_slanted_wall_before_nothing_has_its_outline() -> None:
    """A wall that ends long before the range does has its outline, though it slopes towards what is missing."""
    inverse = np.linspace(1 / 3, 1 / 8, 20)[np.newaxis].repeat(30, axis=0)
    depth_m = np.full((30, 40), np.nan)
    depth_m[:, :20] = 1 / inverse
    steps = depth_steps(depth_m, 0, farthest_m=FAR_M)
    assert set(steps.columns) == {19.5}
    assert len(steps) == 30
    assert np.all(steps.near_first)


@pytest.mark.parametrize(("share", "is_step"), [(1.01, True), (0.99, False)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("slope", [0.0, -0.5])
def test_a_step_is_a_tenth_of_the_nearer_inverse_depth_beyond_the_slope(
    share: float, is_step: bool, axis: int, slope: float
) -> None:
    """From a plane to a parallel one: slopes against the step are added to what is seen of it."""
    size, near = share * LEAST_STEP, 0.5
    columns = np.arange(20.0)
    per_m = near * (1 + slope * size * (columns - 10)) - near * size * (columns < 10)
    depth_m = (1.0 / per_m)[np.newaxis].repeat(20, axis=0)
    steps = depth_steps(depth_m if axis == 0 else depth_m.T, axis, farthest_m=FAR_M)
    assert len(steps) == (20 if is_step else 0)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (0, 5)])
def test_tiny_images_have_no_steps(shape: tuple[int, int]) -> None:
    """Nothing is found where no slope can be compared, and nothing breaks."""
    assert len(depth_steps(np.ones(shape), 0, farthest_m=FAR_M)) == 0
