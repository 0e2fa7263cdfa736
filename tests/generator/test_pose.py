import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.flight import Flight, FlightOptions
from fedora_generator.imu import PoseOptions, PoseSensor

FLIGHT = Flight(
    FlightOptions(position_m=(5, 6, 7), velocity_m_s=(1, 2, 0), yaw_rate_deg_s=90.0, attitude_deg=(0, 70, 10))
)
TIMES_US = np.arange(0, 20_000_001, 5_000, dtype=np.int64)


def rng() -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(3))


def test_without_noise_the_pose_is_the_flight() -> None:
    """Noise-free positions are the flight's own, orientations turn body into world."""
    poses = PoseSensor(PoseOptions(), rng()).sample(FLIGHT, TIMES_US)
    states = FLIGHT.states_at(TIMES_US / 1e6)
    np.testing.assert_array_equal(poses.positions_world_m, states.positions_world_m)
    matrices = Rotation.from_quat(poses.orientations_xyzw).as_matrix()
    np.testing.assert_allclose(matrices, states.R_world_body, atol=1e-14)


def test_noise_is_declared_white_and_on_the_body_side() -> None:
    """q_true^-1 * q is Exp of a normal vector of the declared sigma per body axis; positions likewise in the world."""
    options = PoseOptions(position_sigma_m=5e-3, rotation_sigma_rad=3.5e-3)
    poses = PoseSensor(options, rng()).sample(FLIGHT, TIMES_US)
    states = FLIGHT.states_at(TIMES_US / 1e6)
    truth = Rotation.from_matrix(states.R_world_body)
    turned_rad = (truth.inv() * Rotation.from_quat(poses.orientations_xyzw)).as_rotvec()
    tolerance = 5 / np.sqrt(2 * TIMES_US.size)
    assert np.all(np.abs(turned_rad.std(axis=0) / 3.5e-3 - 1) < tolerance)
    moved_m = poses.positions_world_m - states.positions_world_m
    assert np.all(np.abs(moved_m.std(axis=0) / 5e-3 - 1) < tolerance)
    lag_one = np.mean(turned_rad[1:] * turned_rad[:-1], axis=0) / 3.5e-3**2
    assert np.all(np.abs(lag_one) < 5 / np.sqrt(TIMES_US.size))


def test_quaternions_are_unit_and_continuous() -> None:
    """Noisy quaternions are of unit length to rounding, and the sign does not jump over several whole turns."""
    poses = PoseSensor(PoseOptions(rotation_sigma_rad=0.01), rng()).sample(FLIGHT, TIMES_US)
    q = poses.orientations_xyzw
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=4e-16)
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0)


def test_rotation_noise_leaves_position_noise_as_it_was() -> None:
    """The two noises have random streams of their own."""
    alone = PoseSensor(PoseOptions(position_sigma_m=1.0), rng()).sample(FLIGHT, TIMES_US[:9])
    both = PoseSensor(PoseOptions(position_sigma_m=1.0, rotation_sigma_rad=1.0), rng()).sample(FLIGHT, TIMES_US[:9])
    np.testing.assert_array_equal(alone.positions_world_m, both.positions_world_m)


def test_negative_sigma_is_refused() -> None:
    """A negative sigma is an error that names the option."""
    with pytest.raises(ValueError, match="rotation_sigma_rad"):
        PoseOptions(rotation_sigma_rad=-0.1)
