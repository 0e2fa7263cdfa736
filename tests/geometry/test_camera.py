"""Relative camera motion and its covariance, against compositions by scipy and against sampled noise."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.geometry.camera import RigidMotion, camera_motion, motion_covariance

vectors = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)
far_vectors = st.lists(st.floats(-200.0, 200.0), min_size=3, max_size=3).map(np.array)


def transform(rotation_vector: np.ndarray, translation: np.ndarray) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), translation
    return T


@given(vectors, far_vectors, vectors, far_vectors, vectors, vectors)
def test_motion_carries_points_from_one_camera_to_the_other(
    turn0: np.ndarray, place0: np.ndarray, turn1: np.ndarray, place1: np.ndarray, mount: np.ndarray, arm: np.ndarray
) -> None:
    """X1 = R X0 + t equals the way through the world, for any mounting off the body's axes and origin."""
    T_world_body0, T_world_body1, T_body_camera = (
        transform(turn0, place0),
        transform(turn1, place1),
        transform(mount, arm),
    )
    motion = camera_motion(T_world_body0[:3, :3], place0, T_world_body1[:3, :3], place1, T_body_camera)
    T_1_0 = np.linalg.inv(T_world_body1 @ T_body_camera) @ T_world_body0 @ T_body_camera
    point = np.array([0.3, -0.7, 2.0])
    np.testing.assert_allclose(motion.R @ point + motion.t_m, T_1_0[:3, :3] @ point + T_1_0[:3, 3], atol=1e-10)


@given(vectors, vectors, vectors, vectors)
def test_twist_between_motions_corrects_one_into_the_other(
    turn: np.ndarray, shift: np.ndarray, other_turn: np.ndarray, other_shift: np.ndarray
) -> None:
    """`corrected` undoes `twist_from`."""
    motion = RigidMotion(Rotation.from_rotvec(turn).as_matrix(), shift)
    other = RigidMotion(Rotation.from_rotvec(other_turn).as_matrix(), other_shift)
    reached = other.corrected(motion.twist_from(other))
    np.testing.assert_allclose(reached.R, motion.R, atol=1e-9)
    np.testing.assert_allclose(reached.t_m, motion.t_m, atol=1e-9)


def test_covariance_is_that_of_sampled_noise() -> None:
    """20000 noisy pairs of poses give the predicted covariance of the twist, to 4% of its scale."""
    rng = np.random.default_rng(3)
    turn0, turn1 = Rotation.from_rotvec([0.3, -0.5, 1.1]), Rotation.from_rotvec([0.35, -0.3, 1.4])
    place0, place1 = np.array([10.0, 5.0, 2.0]), np.array([10.8, 4.5, 2.2])
    T_body_camera = transform(np.array([0.4, -1.0, 0.7]), np.array([0.5, -0.3, 0.2]))
    position_sigma_m, rotation_sigma_rad = 0.02, 0.003
    true = camera_motion(turn0.as_matrix(), place0, turn1.as_matrix(), place1, T_body_camera)
    predicted = motion_covariance(
        turn0.as_matrix(), place0, turn1.as_matrix(), place1, T_body_camera,
        position_sigma_m=position_sigma_m, rotation_sigma_rad=rotation_sigma_rad,
    )  # fmt: skip
    count = 20_000
    noisy0, noisy1 = (
        (turn * Rotation.from_rotvec(rotation_sigma_rad * rng.standard_normal((count, 3)))).as_matrix()
        for turn in (turn0, turn1)
    )
    jitter0, jitter1 = position_sigma_m * rng.standard_normal((2, count, 3))
    twists = np.array([
        camera_motion(noisy0[i], place0 + jitter0[i], noisy1[i], place1 + jitter1[i], T_body_camera).twist_from(true)
        for i in range(count)
    ])  # fmt: skip
    scale = np.sqrt(np.diag(predicted))
    np.testing.assert_allclose(np.cov(twists.T) / np.outer(scale, scale), predicted / np.outer(scale, scale), atol=0.04)
