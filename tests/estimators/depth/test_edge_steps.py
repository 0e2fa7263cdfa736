"""Steps of depth: none on surfaces, all outlines, with their nearer side."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.depth.inverse_depth import LEAST_STEP, depth_steps

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
