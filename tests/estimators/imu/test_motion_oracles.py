"""Motion between poses beside two programs that others wrote: gtsam's preintegration and evo's trajectory metrics."""

import gtsam
import numpy as np
import pytest
from evo.core import metrics, trajectory
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.preintegration import rotation_increments, rotation_rows
from fedora_qa.estimators.imu.samples import InertialSamples
from fedora_qa.estimators.imu.specific_force import translation_rows
from fedora_qa.geometry import so3
from fedora_qa.statistics.trajectory import rotation, translation
from tests.support.motion_world import EXACT, GRAVITY_M_S2, NOISY, RESTLESS, sample_motion

Float64 = NDArray[np.float64]
Preintegrated = gtsam.PreintegratedImuMeasurements

WINDOW_S = 0.5


def by_gtsam(gyro: Float64, force: Float64, step_s: float) -> Preintegrated:
    """Integrate sample by sample, each held for a step, as gtsam does by default."""
    parameters = gtsam.PreintegrationParams.MakeSharedU(GRAVITY_M_S2)
    integrated = Preintegrated(parameters, gtsam.imuBias.ConstantBias())
    for rate, felt in zip(gyro, force, strict=True):
        integrated.integrateMeasurement(felt, rate, step_s)
    return integrated


def window_by_gtsam(rate_hz: float, start_s: float = 0.0, duration_s: float = WINDOW_S) -> Preintegrated:
    """Integrate a window of the restless motion, sampled in the middle of each step."""
    middles_s = start_s + (np.arange(round(duration_s * rate_hz)) + 0.5) / rate_hz
    return by_gtsam(RESTLESS.angular_velocities(middles_s), RESTLESS.specific_forces(middles_s), 1 / rate_hz)


def turned_by(integrated: Preintegrated) -> Rotation:
    return Rotation.from_matrix(integrated.deltaRij().matrix())


def turned_by_us(rate_hz: float) -> Rotation:
    times_s = np.arange(round(WINDOW_S * rate_hz) + 1) / rate_hz
    rates = RESTLESS.angular_velocities(times_s)
    found = rotation_increments(times_s, rates, times_s[:1], times_s[-1:], substeps=len(times_s) - 1)
    return Rotation.from_quat(found[0])


def angle_rad(one: Rotation, other: Rotation) -> float:
    return float((one.inv() * other).magnitude())


def test_gtsam_converges_to_our_rotation() -> None:
    """On the same half second gtsam's rotation comes nearer to ours in step with its samples: their limit is ours."""
    ours = turned_by_us(1000.0)
    coarse, fine = (ours.inv() * turned_by(window_by_gtsam(rate_hz)) for rate_hz in (2000.0, 4000.0))
    limit_rad = 2 * fine.as_rotvec() - coarse.as_rotvec()
    assert 1e-6 < fine.magnitude() < coarse.magnitude() < 1e-2
    assert np.linalg.norm(limit_rad) < 0.02 * fine.magnitude()


def test_closer_to_closed_form_than_gtsam() -> None:
    """From the same samples of one kilohertz, gtsam, which holds each for a step, errs a million times as much."""
    times_s = np.arange(round(WINDOW_S * 1000) + 1) / 1000
    truth = RESTLESS.orientations(times_s[:1]).inv() * RESTLESS.orientations(times_s[-1:])
    held = by_gtsam(RESTLESS.angular_velocities(times_s[:-1]), RESTLESS.specific_forces(times_s[:-1]), 1e-3)
    gtsam_rad, our_rad = (angle_rad(truth[0], found) for found in (turned_by(held), turned_by_us(1000.0)))
    assert our_rad < 1e-9
    assert gtsam_rad > 1e6 * our_rad


def test_second_differences_are_those_of_gtsam() -> None:
    """The change of mean velocity by specific force is that of gtsam's P and V, as far as gtsam converges."""
    step_s, at = 0.005, 20
    samples = sample_motion(duration_s=0.5)
    rows = translation_rows(samples, EXACT)
    row = int(np.flatnonzero(rows.poses == at)[0])
    slopes = np.diff(samples.positions_world_m, axis=0) / step_s
    by_force = slopes[at] - slopes[at - 1] - rows.residuals[row]
    start_s = samples.pose_times_s[at - 1]
    before, after = (window_by_gtsam(64e3, s, step_s) for s in (start_s, start_s + step_s))
    R0, R1 = (RESTLESS.orientations(np.array([s]))[0] for s in (start_s, start_s + step_s))
    change = R0.apply(before.deltaVij()) + (R1.apply(after.deltaPij()) - R0.apply(before.deltaPij())) / step_s
    expected = change - step_s * np.array([0.0, 0.0, GRAVITY_M_S2])
    np.testing.assert_allclose(by_force, expected, rtol=0, atol=3e-5 * np.linalg.norm(expected))


def path_of(times_s: Float64, positions_m: Float64, orientations_xyzw: Float64) -> trajectory.PoseTrajectory3D:
    return trajectory.PoseTrajectory3D(positions_m, orientations_xyzw[:, [3, 0, 1, 2]], times_s)


def path_of_gyro(samples: InertialSamples) -> trajectory.PoseTrajectory3D:
    """Chain the gyro's increments from the first pose on; positions are the poses' own."""
    times_s = samples.pose_times_s
    increments = rotation_increments(
        samples.imu_times_s, samples.angular_velocities_body_rad_s, times_s[:-1], times_s[1:], substeps=6
    )
    chained = [samples.orientations_xyzw[0]]
    for increment in increments:
        chained.append(so3.compose(chained[-1], increment))
    return path_of(times_s, samples.positions_world_m, so3.normalise(np.array(chained)))


def test_residuals_are_relative_errors_of_evo() -> None:
    """Lengths of our rotation residuals are evo's relative pose errors of the integrated gyro, pose by pose."""
    samples = sample_motion(noise=NOISY, duration_s=1.0)
    relative = metrics.RPE(metrics.PoseRelation.rotation_angle_rad, delta=1.0, delta_unit=metrics.Unit.frames)
    poses = path_of(samples.pose_times_s, samples.positions_world_m, samples.orientations_xyzw)
    relative.process_data((poses, path_of_gyro(samples)))
    ours = np.linalg.norm(rotation_rows(samples, NOISY).residuals, axis=1)
    np.testing.assert_allclose(ours, relative.error, atol=1e-7)


def test_distance_and_speed_are_those_of_evo() -> None:
    """Of exact poses, distance and greatest speed agree with evo's, up to the chords that evo sums."""
    samples = sample_motion()
    path = path_of(samples.pose_times_s, samples.positions_world_m, samples.orientations_xyzw)
    moved = translation(samples.pose_times_s, samples.positions_world_m)
    assert moved is not None
    assert moved.length.value == pytest.approx(path.path_length, rel=1e-4)
    assert moved.speed_max.value == pytest.approx(path.get_statistics()["v_max (m/s)"], rel=1e-3)


def test_angle_is_that_of_evo() -> None:
    """The angle turned through is the sum of evo's steps from pose to pose."""
    samples = sample_motion()
    turned = rotation(samples.pose_times_s, samples.orientations_xyzw)
    assert turned is not None
    path = path_of(samples.pose_times_s, samples.positions_world_m, samples.orientations_xyzw)
    still = path_of(samples.pose_times_s, samples.positions_world_m, np.tile([0.0, 0, 0, 1], (len(path.timestamps), 1)))
    relative = metrics.RPE(metrics.PoseRelation.rotation_angle_rad, delta=1.0, delta_unit=metrics.Unit.frames)
    relative.process_data((still, path))
    assert turned.length.value == pytest.approx(float(np.sum(relative.error)), rel=1e-4)
