"""Recomputed flow against points carried through the world by scipy; its derivative; its rounding bound."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.geometry.rigid_flow import depths_by_flow, moved_points, rigid_flow, rounding_px, twist_jacobian
from fedora_qa.sequence.stored_step import StoredStep

K = np.array([[620.0, 1.5, 351.2], [0.0, 611.0, 262.7], [0.0, 0.0, 1.0]])
small_vectors = st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=3).map(np.array)
T_BODY_CAMERA = np.eye(4)
T_BODY_CAMERA[:3, :3] = Rotation.from_rotvec([0.3, -1.2, 0.8]).as_matrix()
T_BODY_CAMERA[:3, 3] = (0.2, -0.1, 0.4)
PIXELS = np.random.default_rng(0).uniform([0, 0], [720, 540], (60, 2))
DEPTHS_M = np.random.default_rng(1).uniform(0.5, 30.0, 60)


def through_the_world(turn: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, RigidMotion]:
    """Flow of the pixels by scipy alone, and the motion under test."""
    attitude0, place0 = Rotation.from_rotvec([0.1, 0.4, -0.9]), np.array([100.0, -50.0, 20.0])
    attitude1, place1 = attitude0 * Rotation.from_rotvec(turn), place0 + shift
    rays = np.column_stack((PIXELS, np.ones(len(PIXELS)))) @ np.linalg.inv(K).T
    in_body0 = (rays * DEPTHS_M[:, None]) @ T_BODY_CAMERA[:3, :3].T + T_BODY_CAMERA[:3, 3]
    in_body1 = attitude1.inv().apply(attitude0.apply(in_body0) + place0 - place1)
    optical1 = (in_body1 - T_BODY_CAMERA[:3, 3]) @ T_BODY_CAMERA[:3, :3]
    projected = optical1 @ K.T
    flow = projected[:, :2] / projected[:, 2:] - PIXELS
    flow[optical1[:, 2] <= 0] = np.nan
    return flow, camera_motion(attitude0.as_matrix(), place0, attitude1.as_matrix(), place1, T_BODY_CAMERA)


@given(small_vectors, small_vectors)
def test_flow_is_that_of_points_in_the_world(turn: np.ndarray, shift: np.ndarray) -> None:
    """For any small motion of a camera mounted off the body's axes."""
    flow, motion = through_the_world(turn, shift)
    recomputed = rigid_flow(K, motion, PIXELS[:, 0], PIXELS[:, 1], DEPTHS_M)
    np.testing.assert_allclose(recomputed, flow, rtol=1e-9, atol=1e-8)


def test_flow_of_points_in_the_world_tells_their_depths() -> None:
    """The depths come back from the flow that they make, where the camera moves aside."""
    flow, motion = through_the_world(np.array([0.02, -0.05, 0.1]), np.array([0.1, 0.15, -0.05]))
    found_m = depths_by_flow(K, motion, PIXELS[:, 0], PIXELS[:, 1], flow)
    np.testing.assert_allclose(found_m, DEPTHS_M, rtol=1e-7)


def test_flow_has_no_value_where_there_is_none() -> None:
    """NaN depth, and points that end behind the camera; finite right before it."""
    backwards = RigidMotion(np.eye(3), np.array([0.0, 0.0, -2.0]))
    flow = rigid_flow(K, backwards, np.zeros(4), np.zeros(4), np.array([np.nan, 1.0, 2.0, 2.0 + 1e-9]))
    assert np.isfinite(flow).all(axis=1).tolist() == [False, False, False, True]


@given(small_vectors, small_vectors)
def test_jacobian_is_the_derivative_by_the_twist(turn: np.ndarray, shift: np.ndarray) -> None:
    """Central differences over corrected motions."""
    motion = RigidMotion(Rotation.from_rotvec(turn).as_matrix(), shift)
    points1_m = np.stack(moved_points(K, motion, PIXELS[:, 0], PIXELS[:, 1], DEPTHS_M), axis=-1)
    before = points1_m[:, 2] > 0.2
    jacobian = twist_jacobian(K, points1_m[before])
    step = 1e-6
    for axis, unit in enumerate(np.eye(6) * step):
        ahead, behind = (
            rigid_flow(K, motion.corrected(twist), PIXELS[before, 0], PIXELS[before, 1], DEPTHS_M[before])
            for twist in (unit, -unit)
        )
        np.testing.assert_allclose(jacobian[..., axis], (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("distance_m", [0.1, 2.0, 30.0])
def test_single_precision_lies_within_the_bound(distance_m: float) -> None:
    """Flow made from float32 depth, in float32 throughout, and stored as float32, stays within the stated rounding."""
    motion = RigidMotion(
        Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix(), distance_m * np.array([0.02, 0.01, 0.03])
    )
    rng = np.random.default_rng(7)
    columns, rows = rng.integers(0, 720, 2000).astype(float), rng.integers(0, 540, 2000).astype(float)
    depths_mm = rng.uniform(0.8, 1.2, 2000) * distance_m * 1000
    single = np.float32
    x = (columns.astype(single) - single(K[0, 2])) / single(K[0, 0])
    y = (rows.astype(single) - single(K[1, 2])) / single(K[1, 1])
    X0 = np.stack((x, y, np.ones_like(x))) * (depths_mm.astype(single) / single(1000))
    X1 = motion.R.astype(single) @ X0 + motion.t_m.astype(single)[:, None]
    u = single(K[0, 0]) * X1[0] / X1[2] + single(K[0, 2]) - columns.astype(single)
    v = single(K[1, 1]) * X1[1] / X1[2] + single(K[1, 2]) - rows.astype(single)
    no_skew = np.array([[K[0, 0], 0.0, K[0, 2]], [0.0, K[1, 1], K[1, 2]], [0.0, 0.0, 1.0]])
    depths_m = (depths_mm.astype(single) / single(1000)).astype(float)
    stored = np.stack((u, v), axis=-1).astype(float)
    error = np.abs(stored - rigid_flow(no_skew, motion, columns, rows, depths_m))
    bound = rounding_px(no_skew, motion, columns, rows, depths_m, stored)
    assert np.all(error <= bound)
    assert bound.max() < 2e-3


@pytest.mark.parametrize("flow_step_px", [1 / 64, 1 / 128, 1e-3])
@pytest.mark.parametrize("depth_step_m", [1e-3, 1e-4])
def test_stored_steps_lie_within_the_bound(flow_step_px: float, depth_step_m: float) -> None:
    """Exact flow and depth that are rounded to steps differ by no more than the bound, and by a good part of it."""
    motion = RigidMotion(Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix(), np.array([0.2, 0.1, 0.3]))
    rng = np.random.default_rng(11)
    columns, rows = rng.integers(0, 720, 5000).astype(float), rng.integers(0, 540, 5000).astype(float)
    depths_m = rng.uniform(3.0, 30.0, 5000)
    flow_px = rigid_flow(K, motion, columns, rows, depths_m)
    stored_px = flow_step_px * np.rint(flow_px / flow_step_px)
    stored_m = depth_step_m * np.rint(depths_m / depth_step_m)
    error = np.abs(stored_px - rigid_flow(K, motion, columns, rows, stored_m))
    steps = StoredStep(flow_step_px), StoredStep(depth_step_m)
    bound = rounding_px(K, motion, columns, rows, stored_m, stored_px, *steps)
    assert np.all(error <= bound)
    assert np.max(error / bound) > 0.5


def test_each_component_of_flow_and_its_depth_add_their_own_step() -> None:
    """In closed form for a camera that moves aside: half a step of flow, and f t / Z^2 times half that of depth."""
    motion = RigidMotion(np.eye(3), np.array([0.2, 0.0, 0.0]))
    columns, rows, depths_m = np.full(3, 300.0), np.full(3, 200.0), np.array([2.0, 5.0, 10.0])
    flow_px = rigid_flow(K, motion, columns, rows, depths_m)
    exact = rounding_px(K, motion, columns, rows, depths_m, flow_px)
    by_component = StoredStep(1 / 64, components=(StoredStep(1 / 64), StoredStep(1e-3)))
    of_flow = rounding_px(K, motion, columns, rows, depths_m, flow_px, by_component)
    np.testing.assert_allclose(of_flow - exact, np.broadcast_to([1 / 128, 5e-4], (3, 2)), rtol=2e-3)
    of_depth = rounding_px(K, motion, columns, rows, depths_m, flow_px, depth_step_m=StoredStep(1e-3))
    np.testing.assert_allclose((of_depth - exact)[:, 0], 5e-4 * K[0, 0] * 0.2 / depths_m**2, rtol=2e-3)
    np.testing.assert_allclose((of_depth - exact)[:, 1], 0.0, atol=1e-12)
    finer = rounding_px(K, motion, columns, rows, depths_m, flow_px, StoredStep(1e-12), StoredStep(1e-12))
    np.testing.assert_allclose(finer, exact, rtol=1e-8)


@pytest.mark.parametrize("z_m", [5e-324, 1e-310, 1e-300])
def test_a_point_in_the_plane_of_the_camera_has_no_pixel(z_m: float) -> None:
    """Its flow is not finite, or beyond any image; nobody hears of an overflow on the way."""
    still = RigidMotion(np.eye(3), np.array([0.0, 1.0, 0.0]))
    flow = rigid_flow(K, still, np.array([K[0, 2]]), np.array([K[1, 2]]), np.array([z_m]))
    assert not np.any(np.isfinite(flow[:, 1]) & (np.abs(flow[:, 1]) < 1e9))
