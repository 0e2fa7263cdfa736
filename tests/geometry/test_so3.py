"""Rotations against scipy and against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.geometry import so3

VECTORS = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


def random_rotations(count: int, seed: int = 0) -> Rotation:
    return Rotation.random(count, rng=np.random.default_rng(seed))


def test_quaternions_and_matrices_agree_with_scipy() -> None:
    """Matrices of random quaternions are scipy's, and lead back to the same rotation."""
    rotations = random_rotations(500)
    R = so3.matrices_from_quaternions(rotations.as_quat())
    np.testing.assert_allclose(R, rotations.as_matrix(), atol=4e-15)
    back = so3.quaternions_from_matrices(R)
    np.testing.assert_allclose(back, rotations.as_quat(canonical=True), atol=2e-15)


@pytest.mark.parametrize("axis", np.vstack((np.eye(3), -np.eye(3), [[1.0, 1.0, 0.0], [1.0, -2.0, 3.0]])))
@pytest.mark.parametrize("short_of_pi_rad", [0.0, 1e-12, 1e-8, 1e-3])
def test_half_turns_keep_all_digits(axis: np.ndarray, short_of_pi_rad: float) -> None:
    """The logarithm is right to 1e-15 near pi, where the trace of the matrix no longer changes."""
    vector = axis / np.linalg.norm(axis) * (np.pi - short_of_pi_rad)
    back = so3.log(so3.exp(vector))
    error = min(np.linalg.norm(back - vector), np.linalg.norm(back + vector) if short_of_pi_rad == 0 else np.inf)
    assert error < 4e-15


@pytest.mark.parametrize("angle_rad", [1e-150, 1e-12, 1e-8, 1e-5, 0.99e-3, 1.01e-3, 0.1])
def test_tiny_rotations_keep_relative_precision(angle_rad: float) -> None:
    """Exp and log of quaternions are right to 1e-15 of the angle itself, on both sides of the switch to series."""
    vector = np.array([0.6, -0.48, 0.64]) * angle_rad
    quaternion = so3.exp_quaternion(vector)
    np.testing.assert_allclose(quaternion[:3], np.sin(angle_rad / 2) * vector / angle_rad, rtol=1e-15)
    np.testing.assert_allclose(so3.log_quaternion(quaternion), vector, rtol=1e-15)


@given(VECTORS)
def test_exp_is_scipys(vector: np.ndarray) -> None:
    """The exponential agrees with scipy for any rotation vector."""
    np.testing.assert_allclose(so3.exp(vector), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)


@given(VECTORS, VECTORS)
def test_products_follow_matrices(left: np.ndarray, right: np.ndarray) -> None:
    """R(compose(a, b)) = R(a) R(b), and the inverse undoes."""
    a, b = so3.exp_quaternion(left), so3.exp_quaternion(right)
    product = so3.compose(a, b)
    np.testing.assert_allclose(so3.matrices_from_quaternions(product), so3.exp(left) @ so3.exp(right), atol=1e-14)
    undone = so3.compose(so3.inverse(a), product)
    np.testing.assert_allclose(so3.matrices_from_quaternions(undone), so3.exp(right), atol=1e-14)


@given(VECTORS, st.floats(0.1, 10.0))
def test_sign_and_length_of_a_quaternion_change_no_rotation(vector: np.ndarray, length: float) -> None:
    """q, -q and 3q have the same logarithm and matrix."""
    q = so3.exp_quaternion(vector)
    np.testing.assert_allclose(so3.log_quaternion(-length * q), so3.log_quaternion(q), atol=1e-14)
    np.testing.assert_allclose(so3.matrices_from_quaternions(-length * q), so3.exp(vector), atol=1e-14)


def test_leading_axes_are_kept() -> None:
    """Every function works on any number of leading axes, down to none."""
    vectors = random_rotations(6).as_rotvec().reshape(2, 3, 3)
    R = so3.exp(vectors)
    assert R.shape == (2, 3, 3, 3)
    np.testing.assert_allclose(so3.log(R), vectors, atol=1e-14)
    np.testing.assert_allclose(so3.log(R[1, 2]), vectors[1, 2], atol=1e-14)


def test_nothing_comes_of_nothing() -> None:
    """A quaternion of length 0 and one with NaN give NaN, and disturb no neighbour."""
    orientations = np.array([[0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    rotation_vectors = so3.log_quaternion(so3.normalise(orientations))
    assert np.isnan(rotation_vectors[:2]).all()
    np.testing.assert_array_equal(rotation_vectors[2], 0.0)


@given(VECTORS, VECTORS)
def test_cross_matrices_multiply_like_a_cross_product(a: np.ndarray, b: np.ndarray) -> None:
    """[a]x b = a x b."""
    np.testing.assert_allclose(so3.cross_matrices(a) @ b, np.cross(a, b), atol=1e-14)


def test_yaw_pitch_and_roll_are_scipys() -> None:
    """Angles of random rotations are those of ZYX, and lead back to the same rotation."""
    rotations = random_rotations(500)
    angles = so3.angles_from_quaternions(rotations.as_quat())
    np.testing.assert_allclose(angles, rotations.as_euler("ZYX"), atol=1e-13)
    back = Rotation.from_quat(so3.quaternions_from_angles(angles))
    np.testing.assert_allclose((back.inv() * rotations).magnitude(), 0.0, atol=1e-14)
