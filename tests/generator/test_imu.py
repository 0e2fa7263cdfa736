import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.imu import Imu, ImuOptions

TIMES_US = np.arange(0, 20_000_001, 1_000, dtype=np.int64)
HOVER = Flight(FlightOptions(position_m=(0, 0, 2)))
SWAYING = Flight(
    FlightOptions(
        position_m=(0, 0, 2),
        velocity_m_s=(3, 0, 0),
        yaw_rate_deg_s=60.0,
        terms=(
            HarmonicTerm(axis="y", amplitude=0.5, frequency_hz=0.7),
            HarmonicTerm(axis="pitch", amplitude=12.0, frequency_hz=1.1),
            HarmonicTerm(axis="roll", amplitude=20.0, frequency_hz=0.4, phase_deg=30.0),
        ),
    )
)


def rng() -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(7))


def test_at_rest_the_accelerometer_reads_plus_g_on_z() -> None:
    """Hovering level: specific force (0, 0, +g), no rotation."""
    samples = Imu(ImuOptions(gravity_m_s2=9.8), rng()).sample(HOVER, TIMES_US[:3])
    np.testing.assert_array_equal(samples.specific_forces_body_m_s2, np.tile([0, 0, 9.8], (3, 1)))
    np.testing.assert_array_equal(samples.angular_velocities_body_rad_s, 0)


def test_nose_down_moves_gravity_to_minus_x() -> None:
    """Pitched 30 deg nose down at rest: f = R^T (0, 0, g) = (-g sin 30, 0, g cos 30)."""
    tilted = Flight(FlightOptions(position_m=(0, 0, 2), attitude_deg=(123.0, 30.0, 0.0)))
    samples = Imu(ImuOptions(gravity_m_s2=10.0), rng()).sample(tilted, TIMES_US[:1])
    np.testing.assert_allclose(samples.specific_forces_body_m_s2, [[-5.0, 0.0, 10 * np.cos(np.pi / 6)]], atol=1e-14)


def test_integrating_the_samples_gives_the_flight_back() -> None:
    """An independent integrator of the noise-free strapdown equations arrives at the flight's own pose."""
    options = ImuOptions()

    def derivative(time_s: float, state: np.ndarray) -> np.ndarray:
        attitude = Rotation.from_quat(state[:4])
        times_us = np.array([round(time_s * 1e6)], dtype=np.int64)
        sample = Imu(options, rng()).sample(SWAYING, times_us)
        spin = Rotation.from_quat(state[:4]).as_quat()
        x, y, z = sample.angular_velocities_body_rad_s[0]
        rate = 0.5 * np.array([[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]]) @ spin
        acceleration = attitude.apply(sample.specific_forces_body_m_s2[0]) - [0, 0, options.gravity_m_s2]
        return np.concatenate([rate, state[7:10], acceleration])

    begin, end = (SWAYING.states_at(np.array([time_s])) for time_s in (0.0, 0.5))
    start = np.concatenate([begin.orientations_xyzw[0], begin.positions_world_m[0], begin.velocities_world_m_s[0]])
    final = solve_ivp(derivative, (0, 0.5), start, rtol=1e-7, atol=1e-7, max_step=0.02).y[:, -1]
    np.testing.assert_allclose(final[4:7], end.positions_world_m[0], atol=2e-5)
    np.testing.assert_allclose(Rotation.from_quat(final[:4]).as_matrix(), end.R_world_body[0], atol=2e-5)


def test_white_noise_has_the_declared_sigma() -> None:
    """Sample sigma is density * sqrt(rate), within five standard errors, mean zero, on every axis."""
    options = ImuOptions(gyro_noise_density=1.7e-4, accel_noise_density=2e-3, rate_hz=1000.0)
    clean, noisy = (Imu(each, rng()).sample(SWAYING, TIMES_US) for each in (ImuOptions(), options))
    for noise, density in (
        (noisy.angular_velocities_body_rad_s - clean.angular_velocities_body_rad_s, 1.7e-4),
        (noisy.specific_forces_body_m_s2 - clean.specific_forces_body_m_s2, 2e-3),
    ):
        sigma, count = density * np.sqrt(1000.0), len(TIMES_US)
        assert np.all(np.abs(noise.std(axis=0) / sigma - 1) < 5 / np.sqrt(2 * count))
        assert np.all(np.abs(noise.mean(axis=0)) < 5 * sigma / np.sqrt(count))


def test_bias_walks_from_zero_by_walk_times_root_dt() -> None:
    """The bias is 0 at the first sample and its increments have sigma walk * sqrt(dt), also over uneven gaps."""
    times_us = np.cumsum(np.tile([1_000, 4_000], 10_000)).astype(np.int64)
    samples = Imu(ImuOptions(gyro_bias_walk=2e-5), rng()).sample(HOVER, times_us)
    bias = samples.angular_velocities_body_rad_s
    assert np.all(bias[0] == 0)
    increments = np.diff(bias, axis=0)
    for start, gap_s in ((0, 4e-3), (1, 1e-3)):
        expected = 2e-5 * np.sqrt(gap_s)
        assert increments[start::2].std() / expected == pytest.approx(1.0, abs=5 / np.sqrt(2 * 30_000))


def test_noises_have_streams_of_their_own() -> None:
    """Adding an accelerometer noise and lengthening the recording leave the gyro's draws as they were."""
    short = Imu(ImuOptions(gyro_noise_density=1.0), rng()).sample(HOVER, TIMES_US[:50])
    longer = Imu(ImuOptions(gyro_noise_density=1.0, accel_noise_density=1.0), rng()).sample(HOVER, TIMES_US[:80])
    np.testing.assert_array_equal(short.angular_velocities_body_rad_s, longer.angular_velocities_body_rad_s[:50])


@pytest.mark.parametrize("bad", [{"rate_hz": 0.0}, {"gyro_noise_density": -1.0}, {"accel_bias_walk": float("nan")}])
def test_impossible_noise_is_refused(bad: dict[str, float]) -> None:
    """A zero rate, a negative density or a NaN is an error that names the option."""
    with pytest.raises(ValueError, match=next(iter(bad))):
        ImuOptions(**bad)
