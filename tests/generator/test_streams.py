"""What is sampled piece by piece is what is sampled at once."""

from dataclasses import astuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.imu import Imu, ImuOptions, PoseOptions, PoseSensor
from fedora_generator.rates import pieces

FLIGHT = Flight(
    FlightOptions(position_m=(0.0, 0.0, 2.0), terms=(HarmonicTerm(axis="yaw", amplitude=20.0, frequency_hz=1.3),))
)
NOISY_IMU = ImuOptions(gyro_noise_density=1e-3, accel_noise_density=1e-2, gyro_bias_walk=1e-4, accel_bias_walk=1e-3)
NOISY_POSE = PoseOptions(position_sigma_m=0.01, rotation_sigma_rad=0.01)
TIMES_US = np.arange(60, dtype=np.int64) * 1000

cuts = st.lists(st.integers(0, len(TIMES_US)), max_size=6).map(sorted)


@settings(max_examples=30)
@given(cuts)
def test_imu_and_pose_do_not_depend_on_the_cuts(where: list[int]) -> None:
    """Bit for bit, noise and walking biases included, empty pieces too."""
    for whole, sensor in (
        (Imu(NOISY_IMU, np.random.default_rng(5)).sample(FLIGHT, TIMES_US), Imu(NOISY_IMU, np.random.default_rng(5))),
        (
            PoseSensor(NOISY_POSE, np.random.default_rng(5)).sample(FLIGHT, TIMES_US),
            PoseSensor(NOISY_POSE, np.random.default_rng(5)),
        ),
    ):
        parts = [astuple(sensor.sample(FLIGHT, piece)) for piece in np.split(TIMES_US, where)]
        for at_once, *in_pieces in zip(astuple(whole), *parts, strict=True):
            np.testing.assert_array_equal(np.concatenate(in_pieces), at_once)


@given(st.integers(0, 200_000))
def test_pieces_are_the_whole(count: int) -> None:
    """In order, none longer than its bound."""
    times = np.arange(count, dtype=np.int64)
    parts = pieces(times)
    np.testing.assert_array_equal(np.concatenate(parts), times)
    assert max(map(len, parts)) <= 1 << 16
