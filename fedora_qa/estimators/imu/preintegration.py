"""Rotation between poses from the gyro, and its residuals against the poses.

An increment is the integral of a cubic spline through the samples plus the coning term of each substep,
``h^2/12 w0 x w1``, of fourth order (J. Bortz, IEEE Trans. AES 7 (1971) 61; P. Savage, J. Guidance 21 (1998) 19). At
10.7 rad/s and 1 kHz its error is 2e-10 rad over half a second; that of a midpoint rule is 1e-5 rad.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from fedora_qa.estimators.fitting.grouped_fit import FitParameters
from fedora_qa.estimators.imu.samples import (
    RICHARDSON,
    ComparisonRows,
    InertialNoise,
    InertialSamples,
    RowEffects,
    covered,
    every_second,
    rounding_bias,
    smoothed,
    timestamp_scatter,
)
from fedora_qa.geometry import so3
from fedora_qa.geometry.motion import WIDEST_GAP_STEPS

Float64 = NDArray[np.float64]

_ROUNDING_RAD: Final = 1e-15
"""A few units in the last place of quaternions near 1."""

ROTATION_PARAMETERS: Final = FitParameters(
    names=("time_offset", "clock_rate", "pose_clock_rate", "bias_x", "bias_y", "bias_z",
           "tilt_x", "tilt_y", "tilt_z", "scale"),
    groups={"time_offset": (0,), "clock_rate": (1,), "pose_clock_rate": (2,), "bias": (3, 4, 5), "tilt": (6, 7, 8),
            "scale": (9,)},
    largest=(1.0, 0.1, 0.1, 10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 1.0),
    useful=(1e-3, 5e-4, 5e-4, 0.02, 0.02, 0.02, *[float(np.radians(1.0))] * 3, 0.02),
)  # fmt: skip
"""Fitted parameters: offset of the timestamps of the IMU, s; rates by which the clocks of the IMU and of the poses run
fast, s/s; bias, rad/s; rotation of the axes of the gyro against the body, rad; gain less 1.

A fast clock of the poses also reduces the angular velocity between poses: this separates the two clocks."""


def rotation_increments(
    times_s: Float64, angular_velocities_rad_s: Float64, starts_s: Float64, stops_s: Float64, *, substeps: int
) -> Float64:
    """Return the rotations of the body over intervals, integrated from its angular velocity.

    Parameters
    ----------
    times_s, angular_velocities_rad_s
        (M,) timestamps, s, strictly increasing, and (M, 3) rad/s in the body frame; M > 1.
    starts_s, stops_s
        (n,) ends of the intervals, s, within the span of the samples.
    substeps
        Number of equal steps that each interval is cut into; one for each sample is enough.

    Returns
    -------
    ndarray of float64
        (n, 4) unit quaternions with ``R(stop) = R(start) R(increment)``.
    """
    spline = CubicSpline(times_s, angular_velocities_rad_s)
    return _increments(spline, spline.antiderivative(), starts_s, stops_s, substeps)


def _increments(rate: CubicSpline, integral: PPoly, starts_s: Float64, stops_s: Float64, substeps: int) -> Float64:
    edges_s = starts_s[:, None] + (stops_s - starts_s)[:, None] * np.arange(substeps + 1) / substeps
    rates, integrals = rate(edges_s), integral(edges_s)
    steps_s = np.diff(edges_s, axis=1)[..., None]
    before, after = rates[:, :-1], rates[:, 1:]
    cross = np.empty_like(before)  # np.cross takes several times as long
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., i] = before[..., j] * after[..., k] - before[..., k] * after[..., j]
    # Rotation vector of a substep: integral of w + h^2/12 w0 x w1 (Savage 1998, coning of two samples).
    coning = steps_s**2 / 12 * cross
    parts = so3.exp_quaternion(np.diff(integrals, axis=1) + coning)
    total = parts[:, 0]
    for step in range(1, substeps):
        total = so3.compose(total, parts[:, step])
    return total


def without_rotation_faults(samples: InertialSamples, values: Float64) -> InertialSamples:
    """Return the samples with faults of ``ROTATION_PARAMETERS`` removed, except for the bias.

    The bias stays, as the residuals are linear in it.

    Parameters
    ----------
    samples
        With the faults.
    values
        (P,) sizes of the faults, in the order and units of ``ROTATION_PARAMETERS``.

    Returns
    -------
    InertialSamples
        With corrected timestamps of IMU and poses, and corrected axes and gain of the gyro.
    """
    # The fault is w' = (1 + scale) Exp(tilt) w; this is its inverse.
    mapping = so3.exp(-values[6:9]) / (1.0 + values[9])
    return samples.with_imu_earlier(*values[:2]).with_poses_earlier(values[2]).with_rates_mapped(mapping)


def rotation_rows(samples: InertialSamples, noise: InertialNoise) -> ComparisonRows:
    """Return the comparison of the gyro with consecutive poses.

    Parameters
    ----------
    samples
        Samples of both streams.

    Returns
    -------
    ComparisonRows
        One row for each interval between neighbouring poses that the IMU covers; residuals in rad.

    Notes
    -----
    The residual of an interval is ``R_k+1 Log(increment^-1 q_k^-1 q_k+1)``, rad, in the world frame. There it is the
    difference ``R_k+1 n_k+1 - R_k n_k`` of the errors n of the poses, for any rotation of the body between them.
    Neighbours share one of these errors with opposite sign, so that over a long time all but the first and the last
    cancel. In the body frame they would not cancel. The covariance of the residuals contains these errors, the white
    noise of the gyro, and rounded timestamps.
    """
    compared = _compare(samples)
    imu_times_s, poses = samples.imu_times_s, compared.poses
    starts_s, stops_s = samples.pose_times_s[poses], samples.pose_times_s[poses + 1]
    # Error of fourth order, from every second sample and half the substeps (Richardson): (fine - coarse) / 15.
    sparse = every_second(len(imu_times_s))
    gyro, substeps = samples.angular_velocities_body_rad_s[sparse], _substeps(imu_times_s, stops_s - starts_s)
    coarse = rotation_increments(imu_times_s[sparse], gyro, starts_s, stops_s, substeps=substeps // 2)
    model_errors = so3.log_quaternion(so3.compose(so3.inverse(coarse), compared.increments)) / RICHARDSON
    jacobians = _jacobians(samples, noise, compared)
    return ComparisonRows(
        poses=poses,
        times_s=starts_s,
        spans_s=stops_s - starts_s,
        residuals=compared.residuals,
        model_errors=np.einsum("nij,nj->ni", compared.R_world_end, model_errors),
        jacobians=jacobians,
        bias_jacobians=jacobians[..., 3:6],
        covariance_bands=_covariance(samples, noise, compared),
        rounding_bias=rounding_bias(samples, samples.angular_velocities_body_rad_s, noise.gyro_steps, noise.gyro_sigma),
    )


def rotation_residuals(samples: InertialSamples, noise: InertialNoise) -> tuple[Float64, Float64]:
    """Return the residuals (n, 3) and covariance bands (3, 2, n) of ``rotation_rows`` alone.

    Parameters
    ----------
    samples
        Samples of both streams.
    noise
        As declared.
    """
    compared = _compare(samples)
    return compared.residuals, _covariance(samples, noise, compared)


def rotation_effects(samples: InertialSamples, noise: InertialNoise) -> RowEffects:
    """Return the residuals and jacobians of ``rotation_rows`` alone.

    Parameters
    ----------
    samples
        Samples of both streams.
    noise
        As declared; gives the width of the mean before derivatives are taken.

    Returns
    -------
    RowEffects
        Residuals in rad, in the world; jacobians by ``ROTATION_PARAMETERS``.
    """
    compared = _compare(samples)
    return RowEffects(compared.poses, compared.residuals, _jacobians(samples, noise, compared))


@dataclass(frozen=True, slots=True)
class _GyroComparison:
    """Gyro and poses over the compared steps.

    Attributes
    ----------
    poses
        (n,) pose at which each compared step starts.
    residuals
        (n, 3) rad, in the world.
    rate, integral
        Splines of the gyro and of its integral.
    increments
        (n, 4) rotation of each compared step by the gyro.
    by_pose
        (P - 1, 4) rotation of every step by the poses.
    R_world_end
        (n, 3, 3) orientation at the end of each compared step.
    """

    poses: NDArray[np.intp]
    residuals: Float64
    rate: CubicSpline
    integral: PPoly
    increments: Float64
    by_pose: Float64
    R_world_end: Float64


def _compare(samples: InertialSamples) -> _GyroComparison:
    imu_times_s = samples.imu_times_s
    starts_s, stops_s = samples.pose_times_s[:-1], samples.pose_times_s[1:]
    steps_s = stops_s - starts_s
    # Wider gaps between poses are left out: the number of substeps follows from the median gap.
    widest_s = WIDEST_GAP_STEPS * float(np.median(steps_s)) if len(steps_s) else 0.0
    poses = np.flatnonzero(covered(imu_times_s, starts_s, stops_s) & (steps_s <= widest_s))
    starts_s, stops_s = starts_s[poses], stops_s[poses]
    rate = CubicSpline(imu_times_s, samples.angular_velocities_body_rad_s)
    integral = rate.antiderivative()
    increments = _increments(rate, integral, starts_s, stops_s, _substeps(imu_times_s, stops_s - starts_s))
    by_pose = so3.compose(so3.inverse(samples.orientations_xyzw[:-1]), samples.orientations_xyzw[1:])
    R_world_end = so3.matrices_from_quaternions(samples.orientations_xyzw[poses + 1])
    # r = Log(increment^-1 q_k^-1 q_k+1), in the body frame at the end of the step.
    residuals = so3.log_quaternion(so3.compose(so3.inverse(increments), by_pose[poses]))
    residuals = np.einsum("nij,nj->ni", R_world_end, residuals)
    return _GyroComparison(poses, residuals, rate, integral, increments, by_pose, R_world_end)


def _jacobians(samples: InertialSamples, noise: InertialNoise, compared: _GyroComparison) -> Float64:
    """Return the derivatives (n, 3, P) of the residuals by ``ROTATION_PARAMETERS``."""
    starts_s, stops_s = samples.pose_times_s[compared.poses], samples.pose_times_s[compared.poses + 1]
    rate, integral = compared.rate, compared.integral
    if noise.smoothing_s > 0:
        gyro = smoothed(samples.imu_times_s, samples.angular_velocities_body_rad_s, noise.smoothing_s)
        rate = CubicSpline(samples.imu_times_s, gyro)
        integral = rate.antiderivative()
    # The measured rate is (1 + scale) Exp(tilt) w(t - offset - drift t) + bias. A parameter changes an increment by the
    # integral of the change of the rate, and the residual by minus that.
    w0, w1 = rate(starts_s), rate(stops_s)
    turn = integral(stops_s) - integral(starts_s)
    # Integral of t w'(t) dt = [t w] - integral of w dt, by parts.
    drift = stops_s[:, None] * w1 - starts_s[:, None] * w0 - turn
    unit = np.broadcast_to(np.eye(3), (len(w0), 3, 3))
    changes = np.concatenate(
        (
            -(w1 - w0)[..., None],
            -drift[..., None],
            (drift + turn)[..., None],
            (stops_s - starts_s)[:, None, None] * unit,
            -so3.cross_matrices(turn),
            turn[..., None],
        ),
        axis=-1,
    )
    # A change arises anywhere in the interval: on the mean, half of the interval's turn remains to its end, to first
    # order.
    R_end_mean = unit - 0.5 * so3.cross_matrices(turn)
    jacobians: Float64 = compared.R_world_end @ (-R_end_mean @ changes)
    return jacobians


def _covariance(samples: InertialSamples, noise: InertialNoise, compared: _GyroComparison) -> Float64:
    """Return the bands (3, 2, n) of the covariance, rad^2, alike on each axis: every source of noise is isotropic."""
    poses, steps_s = compared.poses, np.diff(samples.pose_times_s)
    rates = np.linalg.norm(so3.log_quaternion(compared.by_pose), axis=-1) / steps_s
    # For each pose, the larger rate of the two steps beside it.
    rates = np.maximum(np.append(rates, 0.0), np.insert(rates, 0, 0.0))
    variances = (
        noise.rotation_sigma_rad**2 + timestamp_scatter(rates) ** 2 + noise.rotation_rounding_rad**2 + _ROUNDING_RAD**2
    )
    # The residual is n_k+1 - n_k plus white noise of the gyro, of variance density^2 dt: neighbours share -var(n).
    own = variances[poses] + variances[poses + 1] + noise.gyro_density**2 * steps_s[poses]
    shared = np.zeros(len(poses))
    shared[1:] = np.where(np.diff(poses) == 1, -variances[poses[1:]], 0.0)
    return np.tile(np.array([shared, own]), (3, 1, 1))


def _substeps(imu_times_s: Float64, steps_s: Float64) -> int:
    """Return the number of substeps: about one for each sample, and even, so that half as many estimate the error."""
    if not len(steps_s):
        return 2
    samples = float(np.median(steps_s)) / float(np.median(np.diff(imu_times_s)))
    return 2 * int(np.clip(np.ceil(samples / 2 - 1e-6), 1, 32))
