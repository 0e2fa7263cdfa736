"""Flow against points projected by another library, and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_generator.camera import CameraOptions, colour_camera
from fedora_generator.flow import flow_px

Floats = NDArray[np.float64]

CAMERA = colour_camera(CameraOptions(width=32, height=24))
K = CAMERA.K

vector = st.tuples(*[st.floats(-0.4, 0.4)] * 3)


def transform(rotation_vector: tuple[float, ...], translation: tuple[float, ...]) -> Floats:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(rotation_vector).as_matrix()
    T[:3, 3] = translation
    return T


def grid() -> Floats:
    return np.stack(np.meshgrid(np.arange(32.0), np.arange(24.0)), axis=-1)


@settings(deadline=None)
@given(vector, vector, vector, vector, st.integers(0, 2**32 - 1))
def test_flow_is_the_displacement_of_the_projected_point(
    rotation_start: tuple[float, ...],
    position_start: tuple[float, ...],
    rotation_end: tuple[float, ...],
    position_end: tuple[float, ...],
    seed: int,
) -> None:
    """Unproject at the start, take the point through the world with SciPy's rotations, project at the end."""
    T_start, T_end = transform(rotation_start, position_start), transform(rotation_end, position_end)
    z_m = np.random.default_rng(seed).uniform(2, 30, (24, 32))
    pixels = grid()
    rays = np.concatenate([(pixels - K[:2, 2]) / K[0, 0], np.ones((24, 32, 1))], axis=-1)
    world = Rotation.from_rotvec(rotation_start).apply((rays * z_m[..., None]).reshape(-1, 3)) + position_start
    seen = Rotation.from_rotvec(rotation_end).inv().apply(world - position_end).reshape(24, 32, 3)
    expected = K[0, 0] * seen[..., :2] / seen[..., 2:] + K[:2, 2] - pixels
    expected[seen[..., 2] <= 0] = np.nan
    np.testing.assert_allclose(flow_px(1 / z_m, K, T_start, T_end), expected, rtol=2e-6, atol=1e-5)


def test_flow_of_a_sideways_step_is_the_disparity() -> None:
    """A camera that moves right by b sees a point at depth z move left by f b / z."""
    z_m = np.full((24, 32), 4.0)
    flow = flow_px(1 / z_m, K, np.eye(4), transform((0, 0, 0), (0.1, 0, 0)))
    np.testing.assert_allclose(flow[..., 0], -K[0, 0] * 0.1 / 4.0, rtol=1e-6)
    np.testing.assert_allclose(flow[..., 1], 0, atol=1e-5)


def test_flow_of_a_forward_step_expands_from_the_centre() -> None:
    """After a step s towards a wall at z, a pixel p lies at c + (p - c) z / (z - s)."""
    flow = flow_px(np.full((24, 32), 1 / 5.0), K, np.eye(4), transform((0, 0, 0), (0, 0, 1.0)))
    np.testing.assert_allclose(flow, (grid() - K[:2, 2]) * (5 / 4 - 1), rtol=1e-5, atol=1e-5)


def test_flow_at_infinity_sees_rotation_only() -> None:
    """With inverse depth 0, translation does not matter and a yaw by a moves the centre by f tan(a)."""
    turned = transform((0, -0.05, 0), (3, -2, 1))  # about optical Y (down), counter-clockwise from above
    flow = flow_px(np.zeros((3, 3)), np.array([[50.0, 0, 1], [0, 50, 1], [0, 0, 1]]), np.eye(4), turned)
    np.testing.assert_allclose(flow[1, 1], [50 * np.tan(0.05), 0], atol=1e-5)


@pytest.mark.parametrize("step_m", [2.0, 3.0])
def test_flow_is_invalid_where_depth_is_or_the_point_is_passed(step_m: float) -> None:
    """NaN in gives NaN out; so does a point that the camera has reached or passed; all others are finite."""
    inverse_depth = np.array([[np.nan, 1 / 2.0], [1 / 10.0, 1 / 25.0]])
    flow = flow_px(inverse_depth, K, np.eye(4), transform((0, 0, 0), (0, 0, step_m)))
    assert np.isnan(flow[0]).all()
    assert np.isfinite(flow[1]).all()


def test_flow_is_finite_where_the_point_leaves_the_image() -> None:
    """A displacement far beyond the border is kept."""
    flow = flow_px(np.full((24, 32), 1.0), K, np.eye(4), transform((0, 0, 0), (5, 0, 0)))
    assert (flow[..., 0] < -100).all()
