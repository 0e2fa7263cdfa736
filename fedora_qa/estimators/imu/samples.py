"""Samples of IMU and pose, rows that compare them, declared noise, and the error of rounded samples.

Samples that hardly change while they are rounded to a step have a mean error. Rounding x to multiples of a step s errs
by a sawtooth of x, ``e(x) = s/pi sum_k (-1)^k/k sin(2 pi k x / s)``. Its mean over samples is the characteristic
function of their values at the frequencies k / s, and Gaussian noise of standard deviation sigma multiplies each term
by ``exp(-2 pi^2 k^2 sigma^2 / s^2)`` (B. Widrow, I. Kollar, Quantization Noise, Cambridge 2008, chapters 3 and 4). So
samples that move by several steps, or have noise of half a step, average the error out; constant ones keep one error,
half a step at most.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import STANDARD_GRAVITY_M_S2
from fedora_qa.estimators.imu.bias_walk import SegmentWalk
from fedora_qa.geometry import so3

Float64 = NDArray[np.float64]

_HARMONICS: Final = 8
"""Terms of the sawtooth that are summed. The others have ``6 / pi^2 sum_(k > 8) 1/k^2 = 7%`` of the variance of
rounding, alternate from sample to sample, and are part of its white noise."""

TIMESTAMP_SIGMA_S: Final = 1e-6 / np.sqrt(12)
"""Timestamps are whole microseconds: the true instant is uniform within half a microsecond of them."""

_SMOOTHING_S: Final = 0.02
"""Width of the mean over IMU samples before derivatives are taken, where noise is declared."""

RICHARDSON: Final = 15.0
"""Divisor of the difference between a coarse and a fine result, for the error of the fine one: an error of fourth order
grows by 16 when every second sample is left out, and the difference is 15 times the error."""

_WIDEST_STEP: Final = 2.5
"""Steps of the IMU wider than this many median steps are gaps: a spline across them has no support."""

_SHORTEST_SEGMENT_S: Final = 0.5
_SHORTEST_SEGMENT_IN_NOISE_S: Final = 2.0
_LONGEST_SEGMENT_S: Final = 5.0
_MOST_SEGMENTS: Final = 8


@dataclass(frozen=True, slots=True)
class InertialNoise:
    """Declared noise, in the units of the metadata of a file, and declared gravity.

    Attributes
    ----------
    gyro_density, accel_density
        Densities of white noise, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).
    gyro_walk, accel_walk
        Densities of the random walks of the biases, rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz).
    position_sigma_m, rotation_sigma_rad
        Standard deviation of white noise of the poses on each axis, m and rad.
    position_rounding_m, rotation_rounding_rad
        Step of the numbers in which poses are stored, m and rad.
    gravity_m_s2
        Gravity, m/s^2.
    gyro_steps, accel_steps
        Steps to which the samples of each axis were rounded, rad/s and m/s^2; 0 where they were not.
    gyro_sigma, accel_sigma
        Standard deviation of the white noise of a sample before it was rounded, rad/s and m/s^2.
    """

    gyro_density: float = 0.0
    accel_density: float = 0.0
    gyro_walk: float = 0.0
    accel_walk: float = 0.0
    position_sigma_m: float = 0.0
    rotation_sigma_rad: float = 0.0
    position_rounding_m: float = 0.0
    rotation_rounding_rad: float = 0.0
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    gyro_steps: tuple[float, ...] = (0.0, 0.0, 0.0)
    accel_steps: tuple[float, ...] = (0.0, 0.0, 0.0)
    gyro_sigma: float = 0.0
    accel_sigma: float = 0.0

    @property
    def smoothing_s(self) -> float:
        """Width, s, of the mean over samples before derivatives are taken: 0 where no noise is declared.

        Noise of the derivatives would bias a fit towards 0. For the width s the mean attenuates a motion of angular
        frequency w by (w s)^2/24, which is 0.6% at 3 Hz.
        """
        return _SMOOTHING_S if max(self.gyro_density, self.accel_density) > 0 else 0.0

    @property
    def shortest_segment_s(self) -> float:
        """Least length, s, of the segments that a sequence is cut into.

        Neighbouring rows share the noise of a pose, and a cut between segments ignores this. Alone, a segment of length
        T determines a bias of the accelerometer to ``27 sigma / (T^2 sqrt(n))`` from its n positions (quadratic term of
        a least-squares parabola). Without noise of the poses many short segments are better: their spread is then
        estimated best.
        """
        return (
            _SHORTEST_SEGMENT_IN_NOISE_S
            if max(self.position_sigma_m, self.rotation_sigma_rad) > 0
            else _SHORTEST_SEGMENT_S
        )


@dataclass(frozen=True, slots=True)
class InertialSamples:
    """Finite samples with strictly increasing times, in seconds from a common origin near their first.

    Attributes
    ----------
    imu_times_s, angular_velocities_body_rad_s, specific_forces_body_m_s2
        (M,) s, (M, 3) rad/s, (M, 3) m/s^2.
    pose_times_s, positions_world_m, orientations_xyzw
        (P,) s, (P, 3) m, (P, 4) body to world, of any nonzero length.
    R_world_imu
        (M, 3, 3) orientation at the instants of the IMU, interpolated between the poses; NaN in gaps of the poses.
        None where it is not interpolated yet, as in samples whose timestamps were moved.
    turn_xyzw
        (4,) by which the world was turned: stored orientations are those without it.
    """

    imu_times_s: Float64
    angular_velocities_body_rad_s: Float64
    specific_forces_body_m_s2: Float64
    pose_times_s: Float64
    positions_world_m: Float64
    orientations_xyzw: Float64
    R_world_imu: Float64 | None = None
    turn_xyzw: Float64 = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))

    def at_lever(self, lever_body_m: Float64) -> "InertialSamples":
        """Return the samples with positions of a point (3,) of the body, m, in place of its origin."""
        if not np.any(lever_body_m):
            return self
        R_world_body = so3.matrices_from_quaternions(self.orientations_xyzw)
        return replace(self, positions_world_m=self.positions_world_m + R_world_body @ lever_body_m)

    def between(self, start_s: float, stop_s: float) -> "InertialSamples":
        """Return the samples of an interval of time, both ends included; the origin of time stays.

        Parameters
        ----------
        start_s, stop_s
            First and last instant, s.

        Returns
        -------
        InertialSamples
            Views of the samples of both streams.
        """
        imu = slice(*np.searchsorted(self.imu_times_s, (start_s, np.nextafter(stop_s, np.inf))))
        pose = slice(*np.searchsorted(self.pose_times_s, (start_s, np.nextafter(stop_s, np.inf))))
        return InertialSamples(
            self.imu_times_s[imu],
            self.angular_velocities_body_rad_s[imu],
            self.specific_forces_body_m_s2[imu],
            self.pose_times_s[pose],
            self.positions_world_m[pose],
            self.orientations_xyzw[pose],
            None if self.R_world_imu is None else self.R_world_imu[imu],
            self.turn_xyzw,
        )

    def with_imu_samples(self, rows: NDArray[np.intp]) -> "InertialSamples":
        """Return the samples with some rows (m,) of the IMU only; all poses stay."""
        return replace(
            self,
            imu_times_s=self.imu_times_s[rows],
            angular_velocities_body_rad_s=self.angular_velocities_body_rad_s[rows],
            specific_forces_body_m_s2=self.specific_forces_body_m_s2[rows],
            R_world_imu=None if self.R_world_imu is None else self.R_world_imu[rows],
        )

    def with_imu_earlier(self, offset_s: float, drift: float) -> "InertialSamples":
        """Return the samples with an offset and a drift removed from the timestamps of the IMU.

        Parameters
        ----------
        offset_s
            By how much the timestamps are too late at time 0, s.
        drift
            By how much their offset grows, s/s.

        Returns
        -------
        InertialSamples
            With corrected timestamps of the IMU and without ``R_world_imu``.
        """
        # The fault is t' = (1 + drift) t + offset; this solves for t.
        return replace(self, imu_times_s=(self.imu_times_s - offset_s) / (1.0 + drift), R_world_imu=None)

    def with_poses_earlier(self, drift: float) -> "InertialSamples":
        """Return the samples with an offset removed from the timestamps of the poses, which grows by ``drift`` s/s."""
        return replace(self, pose_times_s=self.pose_times_s / (1.0 + drift), R_world_imu=None)

    def with_rates_mapped(self, mapping: Float64) -> "InertialSamples":
        """Return the samples with the angular velocities w replaced by ``mapping @ w``, with a (3, 3) matrix."""
        return replace(self, angular_velocities_body_rad_s=self.angular_velocities_body_rad_s @ mapping.T)


@dataclass(frozen=True, slots=True)
class RowEffects:
    """The parts of ``ComparisonRows`` that follow from the samples alone, without the noise model.

    Attributes
    ----------
    poses
        (n,) index of the pose that each row belongs to.
    residuals
        (n, 3) rad or m/s, in the world.
    jacobians
        (n, 3, P) derivatives of the residuals by the parameters.
    """

    poses: NDArray[np.intp]
    residuals: Float64
    jacobians: Float64


@dataclass(frozen=True, slots=True)
class ComparisonRows:
    """Residuals of a comparison of IMU and poses with all that a fit needs, one row for each comparison.

    Attributes
    ----------
    poses
        (n,) index of the pose, among those given, that the row belongs to.
    times_s
        (n,) time of the row, s.
    spans_s
        (n,) length of time that the row compares, s.
    residuals, model_errors
        (n, 3) rad or m/s, in the world; (n, 3) estimate of the error of the integration itself, in the same unit.
    jacobians, bias_jacobians
        (n, 3, P) and (n, 3, 3): derivatives of the residuals by the parameters and by a bias of the sensor.
    covariance_bands
        (3, u + 1, n): covariance of the residuals on each axis, as bands in the upper form of
        ``scipy.linalg.solveh_banded``; axes are independent.
    scatter
        The same rows with the residuals and jacobians that the noise of the IMU alone gives, see ``with_scatter``;
        None where no such noise is declared.
    rounding_bias
        (3,) bound on the mean error by which samples of the sensor were rounded, on each of its axes, in its unit.
    walk
        Random walk of the bias at the rows, which ``covariance_bands`` do not contain; None where none is declared.
    """

    poses: NDArray[np.intp]
    times_s: Float64
    spans_s: Float64
    residuals: Float64
    model_errors: Float64
    jacobians: Float64
    bias_jacobians: Float64
    covariance_bands: Float64
    scatter: "ComparisonRows | None" = None
    rounding_bias: Float64 = field(default_factory=lambda: np.zeros(3))
    walk: SegmentWalk | None = None

    @property
    def error_bounds(self) -> Float64:
        """Bounds (n, 3) on the error of the integration and on that by a mean error of rounding, in their unit."""
        bounds: Float64 = np.abs(self.model_errors) + np.abs(self.bias_jacobians) @ self.rounding_bias
        return bounds

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def sigmas(self) -> Float64:
        """Standard deviation (n, 3) of each residual, in its unit."""
        variances = self.covariance_bands[:, -1].T
        if self.walk is not None:
            variances = variances + self.by_bias(self.walk.variances)
        sigmas: Float64 = np.sqrt(variances)
        return sigmas

    @property
    def bridge_variances(self) -> Float64:
        """Variance (n, 3) that the walk adds to each residual, given the biases at both ends of the segment."""
        return np.zeros_like(self.residuals) if self.walk is None else self.by_bias(self.walk.bridge_variances)

    @property
    def sigmas_between_ends(self) -> Float64:
        """Standard deviation (n, 3) of each residual, given the biases at both ends of the segment."""
        sigmas: Float64 = np.sqrt(self.covariance_bands[:, -1].T + self.bridge_variances)
        return sigmas

    @property
    def end_jacobians(self) -> Float64:
        """Derivatives (n, 3, 6) of the residuals by the biases at both ends of the segment; (n, 3, 0) without walk."""
        if self.walk is None:
            return np.empty((len(self), 3, 0))
        return np.concatenate([of_end[:, None, None] * self.bias_jacobians for of_end in self.walk.shares.T], axis=-1)

    def by_bias(self, variances: Float64) -> Float64:
        """Return the variances (n, 3) of residuals by those (n,) of a bias that are alike on its three axes."""
        of_residuals: Float64 = np.square(self.bias_jacobians).sum(axis=-1) * variances[:, None]
        return of_residuals

    def select(self, rows: NDArray[np.bool_]) -> "ComparisonRows":
        """Return the rows where a mask (n,) is True. Covariances across omitted rows are set to zero."""
        bands = self.covariance_bands[:, :, rows].copy()
        upper = bands.shape[1] - 1
        indices = np.flatnonzero(rows)
        for lag in range(1, upper + 1):
            separated = indices[lag:] - indices[:-lag] != lag if len(indices) > lag else np.empty(0, np.bool_)
            bands[:, upper - lag, lag:][:, separated] = 0.0
        return ComparisonRows(
            self.poses[rows], self.times_s[rows], self.spans_s[rows], self.residuals[rows], self.model_errors[rows],
            self.jacobians[rows], self.bias_jacobians[rows], bands,
            None if self.scatter is None else self.scatter.select(rows), self.rounding_bias,
            None if self.walk is None else self.walk.select(rows),
        )  # fmt: skip


def covered(imu_times_s: Float64, starts_s: Float64, stops_s: Float64) -> NDArray[np.bool_]:
    """Return which intervals lie within the span of the IMU and touch no gap of it.

    Parameters
    ----------
    imu_times_s
        (M,) timestamps, s, strictly increasing, M > 1.
    starts_s, stops_s
        (n,) ends of the intervals, s.

    Returns
    -------
    ndarray of bool
        (n,).
    """
    steps_s = np.diff(imu_times_s)
    # Steps that count as gaps.
    wide = np.flatnonzero(steps_s > _WIDEST_STEP * float(np.median(steps_s)))
    inside = (starts_s >= imu_times_s[0]) & (stops_s <= imu_times_s[-1])
    gaps_before_start = np.searchsorted(imu_times_s[wide + 1], starts_s, side="right")
    gaps_before_stop = np.searchsorted(imu_times_s[wide], stops_s, side="left")
    # An interval touches a gap that begins before the interval stops and ends after the interval starts.
    without_gap: NDArray[np.bool_] = inside & (gaps_before_start == gaps_before_stop)
    return without_gap


def segments_of(times_s: Float64, shortest_s: float) -> list[slice]:
    """Cut rows into segments of about equal length in time.

    There are eight segments, unless they would be much shorter than ``shortest_s`` or longer than 5 s. There are never
    more segments than rows.

    Parameters
    ----------
    times_s
        (n,) of the rows, s, increasing.
    shortest_s
        Least length of a segment, s.

    Returns
    -------
    list of slice
        Rows of each segment, in order; no segment is empty.
    """
    if not len(times_s):
        return []
    span_s = float(times_s[-1] - times_s[0])
    wanted = max(1, round(span_s / float(np.clip(span_s / _MOST_SEGMENTS, shortest_s, _LONGEST_SEGMENT_S))))
    count = min(wanted, len(times_s))
    # Equal lengths of time; segments without a row vanish.
    edges = np.searchsorted(times_s, times_s[0] + span_s * np.arange(1, count) / count)
    bounds = np.unique(np.concatenate(([0], edges, [len(times_s)])))
    return [slice(int(a), int(b)) for a, b in pairwise(bounds)]


def timestamp_scatter(speeds: Float64) -> Float64:
    """Return the standard deviation (n,) that rounded timestamps give to samples of a motion at ``speeds`` (n,).

    It is never less than at the rms speed. Without this floor samples that do not move, frozen ones too, would outweigh
    all others.
    """
    # sigma = speed sigma_t.
    rms = float(np.sqrt(np.mean(np.square(speeds)))) if len(speeds) else 0.0
    scatter: Float64 = np.maximum(speeds, rms) * TIMESTAMP_SIGMA_S
    return scatter


def smoothed(times_s: Float64, values: Float64, width_s: float) -> Float64:
    """Return the moving mean of samples over a width in time.

    Parameters
    ----------
    times_s
        (n,) timestamps, s, increasing.
    values
        (n, k) samples.
    width_s
        Width of the mean, s.

    Returns
    -------
    ndarray of float64
        (n, k); ``values`` themselves where the width is shorter than two median steps.
    """
    half = int(width_s / float(np.median(np.diff(times_s))) / 2) if len(times_s) > 1 else 0
    size = 2 * half + 1  # odd: an even one would shift by half a sample
    if size == 1:
        return values
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to load, and only poses and the IMU need it

    mean: Float64 = uniform_filter1d(values, size, axis=0, mode="nearest")
    return mean


def rounding_bias(samples: InertialSamples, values: Float64, steps: Sequence[float], sigma: float) -> Float64:
    """Return a bound on the mean error by which samples of the IMU were rounded, on each axis.

    Parameters
    ----------
    samples
        Of a segment of time.
    values
        (M, 3) its angular velocities or specific forces.
    steps
        Step of each axis; 0 where it was not rounded.
    sigma
        Standard deviation of the noise of a sample before it was rounded.

    Returns
    -------
    ndarray of float64
        (3,) in the unit of the values.
    """
    if not any(steps):
        return np.zeros(3)
    course = smoothed(samples.imu_times_s, values, _SMOOTHING_S)
    return np.array([mean_rounding_bound(course[:, axis], step, sigma) for axis, step in enumerate(steps)])


def every_second(count: int) -> NDArray[np.intp]:
    """Return every second index below ``count``, and the last one, so that the span stays the same."""
    return np.unique(np.append(np.arange(0, count, 2), count - 1))


def mean_rounding_bound(values: Float64, step: float, noise: float) -> float:
    """Return a bound on the mean error of samples that were rounded to a step.

    The phases of the terms against each other are taken as the worst ones, as values are known to a step only. Values
    that stay within a step give the bound of half a step.

    Parameters
    ----------
    values
        (n,) a smooth course of the samples, as their moving mean.
    step
        Step, in the unit of the values; 0 where they were not rounded.
    noise
        Standard deviation of the Gaussian noise that the samples had before they were rounded, in the same unit.

    Returns
    -------
    float
        In the unit of the values.
    """
    if step <= 0 or not len(values):
        return 0.0
    k = np.arange(1, _HARMONICS + 1)
    shares = np.abs(np.exp(2j * np.pi * k[:, None] * (values / step)).mean(axis=1))
    # |mean e| <= s/pi sum_k 1/k |phi(2 pi k / s)| exp(-2 pi^2 k^2 sigma^2 / s^2), and s/2.
    terms = shares / k * np.exp(-2 * np.square(np.pi * k * noise / step))
    return min(step / 2, step / np.pi * float(terms.sum()))
