"""What the inertial estimators work on: samples of IMU and pose, rows that compare them, and declared noise."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Float64 = NDArray[np.float64]

TIMESTAMP_SIGMA_S: Final = 1e-6 / np.sqrt(12)
"""Timestamps are whole microseconds: the instant meant is uniform within half a microsecond."""

_SMOOTHING_S: Final = 0.02

RICHARDSON: Final = 15.0
"""An error of fourth order grows by 16 when every second sample is left out."""

_WIDEST_STEP: Final = 2.5
"""Steps of the IMU wider than so many median steps are gaps: a spline across them is a guess."""

_SHORTEST_SEGMENT_S: Final = 0.5
_SHORTEST_SEGMENT_IN_NOISE_S: Final = 2.0
_LONGEST_SEGMENT_S: Final = 5.0
_MOST_SEGMENTS: Final = 8


@dataclass(frozen=True, slots=True)
class InertialNoise:
    """Noise as declared, in the units of the file's metadata, and gravity.

    Densities are rad/s/sqrt(Hz) and m/s^2/sqrt(Hz), walks rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz). Rounding is the step
    of the numbers in which poses are stored.
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

    @property
    def smoothing_s(self) -> float:
        """Over how long samples are averaged before derivatives are taken: 0 where no noise is declared.

        Noisy derivatives would bias a fit towards 0. The average bends them by (w s)^2/24, 0.6% at 3 Hz.
        """
        return _SMOOTHING_S if max(self.gyro_density, self.accel_density) > 0 else 0.0

    @property
    def shortest_segment_s(self) -> float:
        """Least length of the segments that a sequence is cut into.

        Neighbouring rows share the noise of a pose, and a cut forgets that: alone, a segment of length T determines a
        bias of the accelerometer to ``27 sigma / (T^2 sqrt(n))`` of its n positions (the quadratic term of a
        least-squares parabola). Without such noise many short segments are better: they determine their spread best.
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
        (M,), (M, 3), (M, 3).
    pose_times_s, positions_world_m, orientations_xyzw
        (P,), (P, 3), (P, 4) body to world, of any nonzero length.
    R_world_imu
        (M, 3, 3) orientation at the IMU's instants, interpolated between the poses, NaN where these have a gap; None:
        not yet interpolated. Samples whose timestamps move have none.
    """

    imu_times_s: Float64
    angular_velocities_body_rad_s: Float64
    specific_forces_body_m_s2: Float64
    pose_times_s: Float64
    positions_world_m: Float64
    orientations_xyzw: Float64
    R_world_imu: Float64 | None = None

    def between(self, start_s: float, stop_s: float) -> "InertialSamples":
        """Return the samples from ``start_s`` to ``stop_s``, both inclusive; the origin of time stays."""
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
        )

    def with_imu_samples(self, rows: NDArray[np.intp]) -> "InertialSamples":
        """Return the samples with some of the IMU's only."""
        return replace(
            self,
            imu_times_s=self.imu_times_s[rows],
            angular_velocities_body_rad_s=self.angular_velocities_body_rad_s[rows],
            specific_forces_body_m_s2=self.specific_forces_body_m_s2[rows],
            R_world_imu=None if self.R_world_imu is None else self.R_world_imu[rows],
        )

    def with_imu_earlier(self, offset_s: float, drift: float) -> "InertialSamples":
        """Return the samples without an offset, and one that grows by ``drift`` s/s, of the IMU's timestamps."""
        # The fault is t' = (1 + drift) t + offset; this solves for t.
        return replace(self, imu_times_s=(self.imu_times_s - offset_s) / (1.0 + drift), R_world_imu=None)

    def with_poses_earlier(self, drift: float) -> "InertialSamples":
        """Return the samples without an offset of the poses' timestamps that grows by ``drift`` s/s."""
        return replace(self, pose_times_s=self.pose_times_s / (1.0 + drift), R_world_imu=None)

    def with_rates_mapped(self, mapping: Float64) -> "InertialSamples":
        """Return the samples with angular velocities multiplied by a (3, 3) matrix."""
        return replace(self, angular_velocities_body_rad_s=self.angular_velocities_body_rad_s @ mapping.T)


@dataclass(frozen=True, slots=True)
class RowEffects:
    """What the samples alone make of rows: ``poses``, ``residuals`` and ``jacobians`` of ``ComparisonRows``."""

    poses: NDArray[np.intp]
    residuals: Float64
    jacobians: Float64


@dataclass(frozen=True, slots=True)
class ComparisonRows:
    """Residuals with all that a fit needs, a row for each comparison between neighbouring poses.

    Attributes
    ----------
    poses
        (n,) index of the pose, among those given, that the row belongs to.
    times_s
        (n,) its time.
    spans_s
        (n,) how long a time the row compares.
    residuals, model_errors
        (n, 3) and an estimate of the integration's own error.
    jacobians, bias_jacobians
        (n, 3, P) and (n, 3, 3): derivatives of the residuals by the parameters and by a bias of the sensor.
    covariance_bands
        (3, u + 1, n) for each axis, in the upper form of ``scipy.linalg.solveh_banded``; axes are independent.
    scatter
        The same rows with residuals and jacobians as the noise of the IMU alone makes them: see ``with_scatter``.
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

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def sigmas(self) -> Float64:
        """Return (n, 3) the standard deviation of each residual."""
        sigmas: Float64 = np.sqrt(self.covariance_bands[:, -1].T)
        return sigmas

    def select(self, rows: NDArray[np.bool_]) -> "ComparisonRows":
        """Return some rows. Covariances across what is left out are taken for zero."""
        bands = self.covariance_bands[:, :, rows].copy()
        upper = bands.shape[1] - 1
        indices = np.flatnonzero(rows)
        for lag in range(1, upper + 1):
            separated = indices[lag:] - indices[:-lag] != lag if len(indices) > lag else np.empty(0, np.bool_)
            bands[:, upper - lag, lag:][:, separated] = 0.0
        return ComparisonRows(
            self.poses[rows], self.times_s[rows], self.spans_s[rows], self.residuals[rows], self.model_errors[rows],
            self.jacobians[rows], self.bias_jacobians[rows], bands,
            None if self.scatter is None else self.scatter.select(rows),
        )  # fmt: skip


def covered(imu_times_s: Float64, starts_s: Float64, stops_s: Float64) -> NDArray[np.bool_]:
    """Return which intervals (n,) lie within the IMU's span and touch no gap of it.

    Parameters
    ----------
    imu_times_s
        (M,) strictly increasing.
    starts_s, stops_s
        (n,) ends of the intervals.
    """
    steps_s = np.diff(imu_times_s)
    # Steps that count as gaps.
    wide = np.flatnonzero(steps_s > _WIDEST_STEP * float(np.median(steps_s)))
    inside = (starts_s >= imu_times_s[0]) & (stops_s <= imu_times_s[-1])
    gaps_before_start = np.searchsorted(imu_times_s[wide + 1], starts_s, side="right")
    gaps_before_stop = np.searchsorted(imu_times_s[wide], stops_s, side="left")
    # An interval touches a gap where one begins before its stop that has not ended before its start.
    without_gap: NDArray[np.bool_] = inside & (gaps_before_start == gaps_before_stop)
    return without_gap


def segments_of(times_s: Float64, shortest_s: float) -> list[slice]:
    """Cut rows into segments: eight, but none much shorter than a length or longer than five seconds.

    There are no more of them than rows, whatever the timestamps.

    Parameters
    ----------
    times_s
        (n,) of the rows, increasing.
    shortest_s
        Least length of a segment.
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
    """Return how far rounded timestamps move samples of a motion at ``speeds`` (n,): never less than at its rms speed.

    The floor keeps samples that do not move, frozen ones too, from outweighing all others.
    """
    rms = float(np.sqrt(np.mean(np.square(speeds)))) if len(speeds) else 0.0
    scatter: Float64 = np.maximum(speeds, rms) * TIMESTAMP_SIGMA_S
    return scatter


def smoothed(times_s: Float64, values: Float64, width_s: float) -> Float64:
    """Return values (n, k) averaged over a width, or as they are where the width is 0 or samples are rarer."""
    half = int(width_s / float(np.median(np.diff(times_s))) / 2) if len(times_s) > 1 else 0
    size = 2 * half + 1  # odd: an even one would shift by half a sample
    mean: Float64 = uniform_filter1d(values, size, axis=0, mode="nearest") if size > 1 else values
    return mean


def every_second(count: int) -> NDArray[np.intp]:
    """Return every second index, and the last, so that the span stays."""
    return np.unique(np.append(np.arange(0, count, 2), count - 1))
