"""Second differences of position against specific force and gravity, and their residuals.

In ``p'' = R f + g`` the interpolated orientation R of the poses transforms specific force into the world, so that the
gyro is not used. A cubic spline through R f + g is integrated twice. The second differences of that curve are compared
with those of the positions. No velocity is needed.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from fedora_qa.conventions import NS_PER_S
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
from fedora_qa.geometry.motion import interpolate_poses

Float64 = NDArray[np.float64]

_ROUNDING: Final = 4.0
"""Units in the last place by which rounding may change a position."""

_FEWEST_KNOTS: Final = 4
"""Least number of knots of the cubic spline that is integrated here; fewer give a parabola or a line."""

_GRAVITY_STEP_S: Final = 0.5
"""Positions with noise of 5 mm give gravity to 5 mm sqrt(6) / (0.5 s)^2 = 0.05 m/s^2 over two such steps, to a tenth
of it over a hundred."""

TRANSLATION_PARAMETERS: Final = FitParameters(
    names=("time_offset", "clock_rate", "pose_clock_rate", "bias_x", "bias_y", "bias_z", "gravity", "slope_x",
           "slope_y", "lever_x", "lever_y", "lever_z"),
    groups={"time_offset": (0,), "clock_rate": (1,), "pose_clock_rate": (2,), "gravity": (6,), "bias": (3, 4, 5),
            "slope": (7, 8), "lever": (9, 10, 11)},
    largest=(1.0, 0.1, 0.1, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0),
    useful=(1e-3, 5e-4, 5e-4, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.1, 0.1, 0.1),
)  # fmt: skip
"""Fitted parameters: offset of the timestamps of the IMU, s; rates by which the clocks of the IMU and of the poses run
fast, s/s; bias in the body frame, m/s^2; excess of gravity over its declaration, and horizontal part of gravity in the
world, m/s^2; position of the IMU in the body frame, m."""


_DOWN_AND_LEVEL: Final = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
"""Accelerations in the world, as columns: by 1 m/s^2 more gravity, and by 1 m/s^2 of its horizontal part, x and y."""


def without_translation_faults(samples: InertialSamples, values: Float64) -> InertialSamples:
    """Return the samples with offset and drift of the timestamps removed.

    Parameters
    ----------
    samples
        With the faults.
    values
        (P,) sizes of the faults, in the order and units of ``TRANSLATION_PARAMETERS``. Only the first three are
        used, as residuals are linear in all others.

    Returns
    -------
    InertialSamples
        With corrected timestamps of IMU and poses.
    """
    return samples.with_imu_earlier(*values[:2]).with_poses_earlier(values[2])


def with_orientations(samples: InertialSamples) -> InertialSamples:
    """Return the samples with the orientation at the instants of the IMU, interpolated between the poses.

    Halves of these samples then share one interpolation.
    """
    return replace(samples, R_world_imu=_orientations(samples))


def translation_rows(samples: InertialSamples, noise: InertialNoise) -> ComparisonRows:
    """Return the comparison of specific force with the second differences of consecutive positions.

    Parameters
    ----------
    samples
        Samples of both streams.
    noise
        Noise and gravity as declared.

    Returns
    -------
    ComparisonRows
        One row for each pose that the IMU covers from the pose before to the pose after; residuals in m/s, in the
        world.

    Notes
    -----
    The residual at a pose is the change of mean velocity from the interval before the pose to the interval after it: by
    position, less by force. Its covariance contains position noise with the weights (1, -2, 1), the white noise of the
    accelerometer, the noise of the orientations that turn the force, and rounded timestamps.
    """
    samples = with_orientations(samples)
    times_s, columns = samples.pose_times_s, len(TRANSLATION_PARAMETERS.names)
    effects = translation_effects(samples, noise)
    poses = effects.poses
    if not len(poses):
        return ComparisonRows(
            np.empty(0, np.intp), np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3)),
            np.empty((0, 3, columns)), np.empty((0, 3, 3)), np.empty((3, 3, 0)),
        )  # fmt: skip
    accelerations, finite = _in_world(samples, noise.gravity_m_s2)
    by_force = _second_differences(times_s, samples.positions_world_m.T, poses) - effects.residuals
    # Error of interpolation and integration, from every second sample and pose (Richardson): (fine - coarse) / 15.
    imu, pose = every_second(len(samples.imu_times_s)), every_second(len(times_s))
    sparse = InertialSamples(
        samples.imu_times_s[imu],
        samples.angular_velocities_body_rad_s[imu],
        samples.specific_forces_body_m_s2[imu],
        times_s[pose],
        samples.positions_world_m[pose],
        samples.orientations_xyzw[pose],
    )
    coarse_accelerations, coarse_finite = _in_world(sparse, noise.gravity_m_s2)
    model_errors = np.zeros_like(by_force)
    if np.count_nonzero(coarse_finite) >= 2:
        coarse = integrated_twice(sparse.imu_times_s[coarse_finite], coarse_accelerations[coarse_finite].T, times_s)
        model_errors = (by_force - _second_differences(times_s, coarse, poses)) / RICHARDSON
    return ComparisonRows(
        poses=poses,
        times_s=times_s[poses],
        spans_s=(times_s[poses + 1] - times_s[poses - 1]) / 2,
        residuals=effects.residuals,
        model_errors=model_errors,
        jacobians=effects.jacobians,
        bias_jacobians=effects.jacobians[..., 3:6],
        covariance_bands=_covariance(samples, noise, poses, accelerations[finite]),
        rounding_bias=rounding_bias(samples, samples.specific_forces_body_m_s2, noise.accel_steps, noise.accel_sigma),
    )


def translation_residuals(samples: InertialSamples, noise: InertialNoise) -> tuple[Float64, Float64]:
    """Return the residuals (n, 3) and covariance bands (3, 3, n) of ``translation_rows`` alone.

    Parameters
    ----------
    samples
        Samples of both streams.
    noise
        Noise and gravity as declared.
    """
    times_s = samples.pose_times_s
    accelerations, finite = _in_world(samples, noise.gravity_m_s2)
    imu_times_s, accelerations = samples.imu_times_s[finite], accelerations[finite]
    poses = _compared_poses(imu_times_s, times_s)
    if not len(poses):
        return np.empty((0, 3)), np.empty((3, 3, 0))
    by_force = _second_differences(times_s, integrated_twice(imu_times_s, accelerations.T, times_s), poses)
    by_position = _second_differences(times_s, samples.positions_world_m.T, poses)
    return by_position - by_force, _covariance(samples, noise, poses, accelerations)


def translation_effects(samples: InertialSamples, noise: InertialNoise) -> RowEffects:
    """Return the residuals and jacobians of ``translation_rows`` alone.

    Parameters
    ----------
    samples
        Samples of both streams.
    noise
        As declared; gravity, and the width of the mean before derivatives are taken, follow from it.

    Returns
    -------
    RowEffects
        Residuals in m/s, in the world; jacobians by ``TRANSLATION_PARAMETERS``.
    """
    samples = with_orientations(samples)
    times_s, columns = samples.pose_times_s, len(TRANSLATION_PARAMETERS.names)
    accelerations, finite = _in_world(samples, noise.gravity_m_s2)
    imu_times_s = samples.imu_times_s[finite]
    poses = _compared_poses(imu_times_s, times_s)
    if not len(poses):
        return RowEffects(poses, np.empty((0, 3)), np.empty((0, 3, columns)))
    # Curves (27, M) that are integrated twice: acceleration, and its derivatives by TRANSLATION_PARAMETERS or parts of
    # these. The measured force is f(t - offset - drift t) + bias, true gravity is g + gravity. The curve of the
    # positions then differs from that of the force by the double integral of the jerk, of the jerk times t, of -R, and
    # of a constant. A sensor at lever l also measures alpha x l + w x (w x l). Where the clock of the poses runs fast
    # by d, the motion of the poses is slower, and p'' is smaller by the share 2 d.
    R = _orientations(samples)
    both = np.concatenate((samples.specific_forces_body_m_s2, samples.angular_velocities_body_rad_s), axis=1)
    both = smoothed(samples.imu_times_s, both, noise.smoothing_s)
    slopes = CubicSpline(samples.imu_times_s, both)(samples.imu_times_s, 1)
    W = so3.cross_matrices(both[:, 3:])
    curves = np.empty((27, len(samples.imu_times_s)))
    curves[:3] = accelerations.T
    curves[3:6] = np.einsum("nij,nj->in", R, slopes[:, :3])
    curves[6:9] = samples.imu_times_s * curves[3:6]
    curves[9:18] = R.reshape(-1, 9).T
    # alpha x l + w x (w x l) = ([alpha]x + [w]x [w]x) l, transformed into the world.
    curves[18:] = (R @ (so3.cross_matrices(slopes[:, 3:]) + W @ W)).reshape(-1, 9).T
    changes = _second_differences(times_s, integrated_twice(imu_times_s, curves[:, finite], times_s), poses)
    by_force, jerk, jerk_times_t = changes[:, 0:3], changes[:, 3:6], changes[:, 6:9]
    jacobians = np.empty((len(poses), 3, columns))
    # A delay reduces the force by offset times jerk. The residual is position less force, hence the sign plus.
    jacobians[..., 0], jacobians[..., 1], jacobians[..., 2] = jerk, jerk_times_t, -jerk_times_t - 2 * by_force
    jacobians[..., 3:6] = -changes[:, 9:18].reshape(-1, 3, 3)
    jacobians[..., 6:9] = _DOWN_AND_LEVEL * ((times_s[poses + 1] - times_s[poses - 1]) / 2)[:, None, None]
    jacobians[..., 9:12] = -changes[:, 18:27].reshape(-1, 3, 3)
    by_position = _second_differences(times_s, samples.positions_world_m.T, poses)
    return RowEffects(poses, by_position - by_force, jacobians)


def upright(samples: InertialSamples) -> InertialSamples:
    """Return the samples in a world that is turned so that gravity points along -Z, as measured by samples and poses.

    Gravity is the second difference of the positions, over steps of ``_GRAVITY_STEP_S``, less that of the twice
    integrated ``R f``: the median of all steps.

    Parameters
    ----------
    samples
        In a world with any axes.

    Returns
    -------
    InertialSamples
        The same where the two streams share too little.
    """
    accelerations, finite = _in_world(samples, 0.0)
    imu_times_s = samples.imu_times_s[finite]
    if len(imu_times_s) < _FEWEST_KNOTS:
        return samples
    shared = (samples.pose_times_s >= imu_times_s[0]) & (samples.pose_times_s <= imu_times_s[-1])
    times_s = samples.pose_times_s[shared]
    if len(times_s) < _FEWEST_KNOTS:
        return samples
    falling_m = samples.positions_world_m[shared].T - integrated_twice(imu_times_s, accelerations[finite].T, times_s)
    # Steps of so many poses, from each pose on, and three at least that follow each other.
    steps = min(max(1, round(_GRAVITY_STEP_S / float(np.median(np.diff(times_s))))), (len(times_s) - 1) // 3)
    steps_s = times_s[steps:] - times_s[:-steps]
    slopes = (falling_m[:, steps:] - falling_m[:, :-steps]) / steps_s
    # A change of slope over the mean of the steps beside it is the second derivative.
    changes = (slopes[:, steps:] - slopes[:, :-steps]) / ((steps_s[steps:] + steps_s[:-steps]) / 2)
    gravity = np.median(changes, axis=1)
    axis = np.cross(gravity, [0.0, 0.0, -1.0])
    sine, cosine = float(np.linalg.norm(axis)), -float(gravity[2])
    # Gravity along +Z has no axis of its own: any level one takes it to -Z.
    axis = axis / sine if sine > 0 else np.array([1.0, 0.0, 0.0])
    turn = so3.exp_quaternion(axis * np.arctan2(sine, cosine))
    return replace(
        samples,
        positions_world_m=samples.positions_world_m @ so3.matrices_from_quaternions(turn).T,
        orientations_xyzw=so3.compose(turn, samples.orientations_xyzw),
        R_world_imu=None,
        turn_xyzw=so3.compose(turn, samples.turn_xyzw),
    )


def _compared_poses(imu_times_s: Float64, times_s: Float64) -> NDArray[np.intp]:
    """Return the poses that instants of the IMU (M,) cover from the pose before to the pose after, of times (P,)."""
    if len(imu_times_s) < 2 or len(times_s) < 3:
        return np.empty(0, np.intp)
    return 1 + np.flatnonzero(covered(imu_times_s, times_s[:-2], times_s[2:]))


def _in_world(samples: InertialSamples, gravity_m_s2: float) -> tuple[Float64, NDArray[np.bool_]]:
    """Return ``R f + g`` (M, 3), m/s^2, at the instants of the IMU, and where it is finite (M,).

    It is not finite in gaps of the poses.
    """
    R = _orientations(samples)
    accelerations = np.einsum("nij,nj->ni", R, samples.specific_forces_body_m_s2)
    accelerations[:, 2] -= gravity_m_s2
    return accelerations, np.isfinite(accelerations).all(axis=-1)


def _orientations(samples: InertialSamples) -> Float64:
    if samples.R_world_imu is not None:
        return samples.R_world_imu
    R, _ = interpolate_poses(
        np.rint(samples.pose_times_s * NS_PER_S).astype(np.int64),
        samples.positions_world_m,
        samples.orientations_xyzw,
        at_ns=np.rint(samples.imu_times_s * NS_PER_S).astype(np.int64),
    )
    return R


def _second_differences(times_s: Float64, values: Float64, poses: NDArray[np.intp]) -> Float64:
    """Return the change of slope (n, k) of k curves (k, P) at n poses."""
    # (p_k+1 - p_k) / T_k - (p_k - p_k-1) / T_k-1, with steps T.
    slopes = np.diff(values, axis=1) / np.diff(times_s)
    differences: Float64 = (slopes[:, poses] - slopes[:, poses - 1]).T
    return differences


def _covariance(
    samples: InertialSamples, noise: InertialNoise, poses: NDArray[np.intp], accelerations: Float64
) -> Float64:
    """Return the bands (3, 3, n) of the covariance, m^2/s^2.

    Position noise enters with the weights 1/T, -2/T, 1/T for steps T, white noise of the acceleration with a triangle.
    """
    times_s, positions_m = samples.pose_times_s, samples.positions_world_m
    steps_s = np.diff(times_s)
    speeds = np.linalg.norm(np.gradient(positions_m, times_s, axis=0), axis=-1)
    rounding_m = _ROUNDING * np.spacing(np.maximum(np.abs(positions_m).max(axis=-1), 1e-3))
    variances = (
        noise.position_sigma_m**2 + timestamp_scatter(speeds) ** 2 + rounding_m**2 + noise.position_rounding_m**2
    )
    # An error e of the orientation changes the force f by e x f. With e of sigma on each axis the variance along axis i
    # is sigma^2 (|f|^2 - f_i^2), on average over the samples. Gravity is vertical and disturbs the horizontal axes
    # only.
    upward = np.array([0.0, 0.0, noise.gravity_m_s2])
    squares = np.mean(np.square(accelerations + upward), axis=0)
    turned_squared = noise.rotation_sigma_rad**2 * (squares.sum() - squares)
    # These errors are taken as constant over a step of the poses: their density is their mean square times the step.
    density_squared = (noise.accel_density**2 + turned_squared * float(np.median(steps_s)))[:, None]
    before, after = 1 / steps_s[poses - 1], 1 / steps_s[poses]
    middle = -(before + after)
    bands = np.zeros((3, 3, len(poses)))
    bands[:, 2] = before**2 * variances[poses - 1] + middle**2 * variances[poses] + after**2 * variances[poses + 1]
    # A second difference weights acceleration by a triangle of height 1. The square of a triangle integrates to a third
    # of its base, the product of two triangles a step apart to a sixth of the step.
    bands[:, 2] += density_squared * (steps_s[poses - 1] + steps_s[poses]) / 3
    left, right = poses[:-1], poses[1:]
    neighbours = middle[:-1] * before[1:] * variances[left] + after[:-1] * middle[1:] * variances[right]
    bands[:, 1, 1:] = np.where(right - left == 1, neighbours + density_squared * steps_s[left] / 6, 0.0)
    bands[:, 0, 2:] = np.where(poses[2:] - poses[:-2] == 2, after[:-2] * before[2:] * variances[poses[:-2] + 1], 0.0)
    return bands


def integrated_twice(times_s: Float64, values: Float64, at_s: Float64) -> Float64:
    """Return the double integrals of many cubic splines with the same knots.

    The result is that of ``scipy.interpolate.CubicSpline(...).antiderivative(2)``, but no polynomials are built: the
    integrals over an interval are closed forms of its two values and slopes (cubic Hermite interpolation).

    Parameters
    ----------
    times_s
        (M,) knots, s, strictly increasing, M > 1. Beyond them the outermost cubics are continued.
    values
        (k, M) of the k curves at the knots.
    at_s
        (n,) instants, s.

    Returns
    -------
    ndarray of float64
        (k, n) double integrals from the first knot on, in the unit of the curves times s^2.

    Sources
    -------
    C. de Boor, A Practical Guide to Splines, Springer 2001, chapter IV (slopes; the not-a-knot condition).
    """
    if len(times_s) < _FEWEST_KNOTS:
        twice: Float64 = CubicSpline(times_s, values, axis=1).antiderivative(2)(at_s)
        return twice
    steps_s = np.diff(times_s)
    slopes = _spline_slopes(steps_s, values)
    # An interval of length h with values p0, p1 and slopes m0, m1 has the single integral
    # h (p0 + p1)/2 + h^2 (m0 - m1)/12 and the double one h^2 (7 p0 + 3 p1)/20 + h^3 (m0/20 - m1/30).
    left, right, left_slopes, right_slopes = values[:, :-1], values[:, 1:], slopes[:, :-1], slopes[:, 1:]
    once, twice = np.zeros_like(values), np.zeros_like(values)
    np.cumsum(steps_s * ((left + right) / 2 + steps_s / 12 * (left_slopes - right_slopes)), axis=1, out=once[:, 1:])
    within = steps_s * (7 / 20 * left + 3 / 20 * right + steps_s * (left_slopes / 20 - right_slopes / 30))
    np.cumsum(steps_s * (once[:, :-1] + within), axis=1, out=twice[:, 1:])
    knot = np.clip(np.searchsorted(times_s, at_s, side="right") - 1, 0, len(times_s) - 2)
    beyond_s, step_s = at_s - times_s[knot], steps_s[knot]
    # Double integrals of the four Hermite basis polynomials, from 0 to the fraction w of the interval.
    w = beyond_s / step_s
    of_right, of_right_slope = w**4 / 4 - w**5 / 10, w**5 / 20 - w**4 / 12
    of_left, of_left_slope = w**2 / 2 - of_right, w**3 / 6 - w**4 / 6 + w**5 / 20
    partial = (of_left * left[:, knot] + of_right * right[:, knot]) + step_s * (
        of_left_slope * left_slopes[:, knot] + of_right_slope * right_slopes[:, knot]
    )
    integrals: Float64 = twice[:, knot] + once[:, knot] * beyond_s + step_s**2 * partial
    return integrals


def _spline_slopes(steps_s: Float64, values: Float64) -> Float64:
    """Return the slopes (k, M) of not-a-knot splines at their knots, for steps (M - 1,) and values (k, M).

    Second derivatives are continuous everywhere, third derivatives at the second knot and at the last but one.
    """
    chords = np.diff(values, axis=1) / steps_s
    before, after = steps_s[:-1], steps_s[1:]
    bands = np.empty((3, len(steps_s) + 1))
    # h_i m_i-1 + 2 (h_i-1 + h_i) m_i + h_i-1 m_i+1 = 3 (h_i c_i-1 + h_i-1 c_i) for slopes m, chords c and
    # steps h (de Boor 2001, chapter IV).
    bands[1, 1:-1] = 2 * (before + after)
    bands[0, 2:], bands[2, :-2] = before, after
    right = np.empty_like(values)
    right[:, 1:-1] = 3 * (after * chords[:, :-1] + before * chords[:, 1:])
    # Not-a-knot: the third derivative is continuous at the second knot and at the last but one.
    first, last = steps_s[0] + steps_s[1], steps_s[-1] + steps_s[-2]
    bands[1, 0], bands[0, 1] = steps_s[1], first
    bands[1, -1], bands[2, -2] = steps_s[-2], last
    right[:, 0] = (steps_s[0] + 2 * first) * steps_s[1] * chords[:, 0] + steps_s[0] ** 2 * chords[:, 1]
    right[:, 0] /= first
    right[:, -1] = steps_s[-1] ** 2 * chords[:, -2] + (2 * last + steps_s[-1]) * steps_s[-2] * chords[:, -1]
    right[:, -1] /= last
    slopes: Float64 = solve_banded((1, 1), bands, right.T, overwrite_ab=True, overwrite_b=True, check_finite=False).T
    return slopes
