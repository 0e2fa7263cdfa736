"""Poses and IMU samples for the checks of motion: the samples that each window owns, joined at the end.

About 10 kB a window are kept unchanged. A fit over the whole sequence, iterated where timestamps have to move, thus
uses the stored samples, and does not depend on the windows.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, SampledCurve, VectorSamples
from fedora_qa.estimators.imu.samples import TIMESTAMP_SIGMA_S, InertialNoise, InertialSamples
from fedora_qa.estimators.imu.white_noise import noise_level
from fedora_qa.estimators.storage.steps import FEWEST_VALUES, level_step, stored_step
from fedora_qa.geometry import so3
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import ImuModel, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import StoredStep, of_components
from fedora_qa.sequence.window import ImuSamples, PoseSamples, Window

Float64 = NDArray[np.float64]

NOISE_ORDER: Final = 8
"""Order of differences that separate noise from motion: a motion of 3 Hz and 1 rad leaves 5e-11 rad at 200 Hz."""

_MOST_REPEATS: Final = 0.5
"""Largest share of samples of a steady motion that repeat the one before. A motion that is not rounded has none."""

_LEAST_ROUNDING_NOISE: Final = 0.1
"""Least noise of rounded numbers, in steps: about a third of the noise of uniform rounding."""

RADIANS_PER_COMPONENT: Final = 2.0
"""A quaternion holds half angles: an error of a component is half the error of the rotation, rad."""


def owned_poses(window: Window) -> PoseSamples | None:
    """Return the window's own poses, None where it has none."""
    return window.derived(_owned_poses)


def _owned_poses(window: Window) -> PoseSamples | None:
    if not len(window.owned("pose")):
        return None
    poses = window.pose()
    own = poses.times_ns < window.span.stop_ns
    return PoseSamples(poses.times_ns[own], poses.positions_world_m[own], poses.orientations_xyzw[own])


def owned_imu(window: Window) -> ImuSamples | None:
    """Return the window's own IMU samples, None where it has none."""
    return window.derived(_owned_imu)


def _owned_imu(window: Window) -> ImuSamples | None:
    if not len(window.owned("imu")):
        return None
    imu = window.imu()
    own = imu.times_ns < window.span.stop_ns
    return ImuSamples(imu.times_ns[own], imu.angular_velocities_body_rad_s[own], imu.specific_forces_body_m_s2[own])


def join_poses(parts: Sequence[PoseSamples]) -> PoseSamples:
    """Return the finite poses of all windows; quaternions of nonzero length, as stored."""
    if not parts:
        return PoseSamples(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 4)))
    positions_m = np.concatenate([part.positions_world_m for part in parts])
    q = np.concatenate([part.orientations_xyzw for part in parts])
    finite = np.isfinite(positions_m).all(axis=1) & np.isfinite(so3.normalise(q)).all(axis=1)
    return PoseSamples(np.concatenate([part.times_ns for part in parts])[finite], positions_m[finite], q[finite])


def join_imu(parts: Sequence[ImuSamples]) -> ImuSamples:
    """Return the finite IMU samples of all windows."""
    if not parts:
        return ImuSamples(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)))
    rates = np.concatenate([part.angular_velocities_body_rad_s for part in parts])
    forces = np.concatenate([part.specific_forces_body_m_s2 for part in parts])
    finite = np.isfinite(rates).all(axis=1) & np.isfinite(forces).all(axis=1)
    return ImuSamples(np.concatenate([part.times_ns for part in parts])[finite], rates[finite], forces[finite])


def inertial_samples(imu: ImuSamples, poses: PoseSamples, model: ImuModel) -> InertialSamples:
    """Put both streams on one axis of time, in seconds from the IMU's first sample.

    Samples that are declared as means over the interval before them are moved to its middle and sharpened.

    Parameters
    ----------
    imu
        Finite samples, at least one: rad/s and m/s^2 in the body frame.
    poses
        Finite poses of the body in the world, m.
    model
        Declared sampling of the IMU.

    Returns
    -------
    InertialSamples
        Times in s.
    """
    origin_ns = imu.times_ns[0]
    times_s = (imu.times_ns - origin_ns) / NS_PER_S
    rates, forces = imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2
    if model.sampling == "interval_mean" and len(times_s) > 2:
        # A mean over (t - h, t] is the value at t - h / 2, to second order in h.
        times_s = times_s - float(np.median(np.diff(times_s))) / 2
        rates, forces = _sharpened(rates), _sharpened(forces)
    return InertialSamples(
        imu_times_s=times_s,
        angular_velocities_body_rad_s=rates,
        specific_forces_body_m_s2=forces,
        pose_times_s=(poses.times_ns - origin_ns) / NS_PER_S,
        positions_world_m=poses.positions_world_m,
        orientations_xyzw=poses.orientations_xyzw,
    )


def inertial_noise(imu: ImuModel, pose: PoseModel, samples: ImuSamples, poses: PoseSamples) -> InertialNoise:
    """Return the noise of both streams, with the rounding of their stored numbers.

    Parameters
    ----------
    imu, pose
        Declared noise, or what stands for it (``imu_model``, ``pose_model``).
    samples, poses
        Finite samples as stored; their rounding is estimated.

    Returns
    -------
    InertialNoise
        Densities of the gyroscope and accelerometer include the rounding to a step.
    """
    # White noise of density N sampled at rate f has sigma = N sqrt(f) (IEEE Std 952-1997, annex C).
    sample_s = float(np.median(np.diff(samples.times_ns))) / NS_PER_S
    gyro_step, accel_step = (
        sample_step(samples.times_ns, values, VectorSamples(values))
        for values in (samples.angular_velocities_body_rad_s, samples.specific_forces_body_m_s2)
    )
    # Variance step^2 / 12 of a rounded sample, times the sampling interval; the coarsest axis stands for all.
    gyro, accel = (step.size * float(np.sqrt(sample_s / 12)) for step in (gyro_step, accel_step))
    return InertialNoise(
        gyro_density=float(np.hypot(imu.gyro_noise_density, gyro)),
        accel_density=float(np.hypot(imu.accel_noise_density, accel)),
        gyro_walk=imu.gyro_bias_walk,
        accel_walk=imu.accel_bias_walk,
        position_sigma_m=pose.position_sigma_m,
        rotation_sigma_rad=pose.rotation_sigma_rad,
        position_rounding_m=_position_step_m(poses),
        rotation_rounding_rad=_rotation_step_rad(poses),
        gravity_m_s2=imu.gravity,
        gyro_steps=tuple(gyro_step.component(axis).size for axis in range(3)),
        accel_steps=tuple(accel_step.component(axis).size for axis in range(3)),
        gyro_sigma=imu.gyro_noise_density / sample_s**0.5,
        accel_sigma=imu.accel_noise_density / sample_s**0.5,
    )


def pose_model(facts: Facts, poses: PoseSamples) -> PoseModel:
    """Return the noise of the poses: as declared, or as measured where nobody declares any.

    Parameters
    ----------
    facts
        With the declarations.
    poses
        All finite poses of the file.

    Returns
    -------
    PoseModel
        Measured noise is the white part of it, and contains what rounding adds.
    """
    return facts.declared.pose or PoseModel(*measured_pose_sigmas(poses))


def imu_model(facts: Facts, imu: ImuSamples) -> ImuModel:
    """Return the noise of the IMU: as declared, or with measured densities where nobody declares any.

    Parameters
    ----------
    facts
        With the declarations.
    imu
        All finite samples of the file, two at least.

    Returns
    -------
    ImuModel
        Measured densities are those of the white part; walks of the biases are 0.
    """
    if facts.declared.imu is not None:
        return facts.declared.imu
    # White noise of density N sampled at rate f has sigma = N sqrt(f) (IEEE Std 952-1997, annex C).
    root_sample_s = float(np.sqrt(np.median(np.diff(imu.times_ns)) / NS_PER_S))
    levels = (
        noise_level(imu.times_ns, VectorSamples(values), order=NOISE_ORDER)
        for values in (imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2)
    )
    gyro, accel = (0.0 if level is None else level.sigma * root_sample_s for level in levels)
    return ImuModel(gyro_noise_density=gyro, accel_noise_density=accel)


def measured_pose_sigmas(poses: PoseSamples) -> tuple[float, float]:
    """Return the measured noise of positions, m, and orientations, rad; 0 where there are too few samples."""
    levels = (
        noise_level(poses.times_ns, curve, order=NOISE_ORDER)
        for curve in (VectorSamples(poses.positions_world_m), OrientationSamples(poses.orientations_xyzw))
    )
    position_m, rotation_rad = (0.0 if level is None else level.sigma for level in levels)
    return position_m, rotation_rad


def stored_resolution(values: Float64) -> float:
    """Return the spacing of stored numbers at the largest value.

    The spacing is that of float32 where all values are float32 numbers but not all whole numbers, else that of float64.
    """
    if not values.size:
        return 0.0
    largest = float(np.abs(values).max())
    # Whole numbers are float32 numbers as well, with any stored type.
    single = values.astype(np.float32)
    if np.array_equal(single, values) and not np.array_equal(np.rint(values), values):
        return float(np.spacing(np.float32(largest)))
    return float(np.spacing(largest))


def sample_step(times_ns: NDArray[np.int64], values: Float64, curve: SampledCurve) -> StoredStep:
    """Return the step to which samples of a motion were rounded, with that of each component.

    Numbers of few decimals need not be rounded: a flight at constant speed has such positions. Rounding to a step
    leaves noise of ``step / sqrt(12)`` where samples move by steps, and samples that repeat where they move slower. So
    a step counts only where such noise is measured, or most samples repeat the one before.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.
    values
        (N, k) as stored, finite.
    curve
        The same samples, for their noise.

    Returns
    -------
    StoredStep
        In the unit of the values; without size where they were not rounded.
    """
    if len(values) < FEWEST_VALUES:
        return StoredStep(is_identifiable=False)
    stored = stored_step(values, with_unknown_steps=True)
    level = noise_level(times_ns, curve, order=NOISE_ORDER)
    sigma = 0.0 if level is None else level.sigma
    sizes = []
    for i, component in enumerate(values.T):
        size, repeats = stored.component(i).size, np.mean(component[1:] == component[:-1])
        moves = len(np.unique(component)) >= FEWEST_VALUES
        rounded = moves and (sigma > _LEAST_ROUNDING_NOISE * size or repeats > _MOST_REPEATS)
        sizes.append(max(size if rounded else 0.0, level_step(component)))
    # A constant component shows no step; as far as can be known it is stored like the others.
    constant = np.all(values == values[:1], axis=0)
    return of_components(
        [
            StoredStep(
                max(sizes) if is_constant else size,
                stored.component(i).roundoff,
                typical=stored.component(i).typical or stored.typical,
                is_identifiable=stored.component(i).is_identifiable or size > 0,
            )
            for i, (size, is_constant) in enumerate(zip(sizes, constant, strict=True))
        ]
    )


def rounding_step(times_ns: NDArray[np.int64], values: Float64, curve: SampledCurve) -> float:
    """Return the step of stored numbers: that of their type, or the coarsest to which they were rounded before.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns.
    values
        (N, k) as stored.
    curve
        The same samples, for their noise.

    Returns
    -------
    float
        In the unit of the values.
    """
    stored = stored_resolution(values)
    return max(stored, sample_step(times_ns, values, curve).size)


def imu_roundings(imu: ImuSamples) -> tuple[float, float]:
    """Return the unit of rounding of angular velocities (rad/s) and specific forces (m/s^2), of two samples or more.

    Angular velocities follow from the change of orientations from sample to sample, whose components reach 1. So their
    unit of rounding is at least that of 1 in float64 over the sampling interval.
    """
    sample_s = float(np.median(np.diff(imu.times_ns))) / NS_PER_S
    rates, forces = imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2
    rate = rounding_step(imu.times_ns, rates, VectorSamples(rates))
    return max(rate, float(np.spacing(1.0)) / sample_s), rounding_step(imu.times_ns, forces, VectorSamples(forces))


def position_floor_m(poses: PoseSamples) -> float:
    """Return the scatter of exact positions, m, by stored digits and timestamps rounded to 1 us."""
    steps_s = np.diff(poses.times_ns) / NS_PER_S
    speeds_m_s = np.linalg.norm(np.diff(poses.positions_world_m, axis=0), axis=1) / steps_s
    return _rounding_scatter(speeds_m_s, _position_step_m(poses))


def rotation_floor_rad(poses: PoseSamples) -> float:
    """Return the scatter of exact orientations, rad, by stored digits and timestamps rounded to 1 us."""
    # A rotation's speed is the angle between neighbours over their step.
    steps_s = np.diff(poses.times_ns) / NS_PER_S
    pairs = np.arange(len(steps_s))[:, None] + np.arange(2)
    turns_rad = np.linalg.norm(OrientationSamples(poses.orientations_xyzw).relative_vectors(pairs, 0)[:, 1], axis=1)
    return _rounding_scatter(turns_rad / steps_s, _rotation_step_rad(poses))


def _position_step_m(poses: PoseSamples) -> float:
    return rounding_step(poses.times_ns, poses.positions_world_m, VectorSamples(poses.positions_world_m))


def _rotation_step_rad(poses: PoseSamples) -> float:
    step = rounding_step(poses.times_ns, poses.orientations_xyzw, OrientationSamples(poses.orientations_xyzw))
    return RADIANS_PER_COMPONENT * step


def _rounding_scatter(speeds: Float64, resolution: float) -> float:
    """Return the scatter of samples by rounded timestamps and stored digits, from their speeds (n,)."""
    # Independent errors add in squares: rms speed times the scatter of timestamps, and the stored step.
    speed = float(np.sqrt(np.mean(np.square(speeds)))) if len(speeds) else 0.0
    return float(np.hypot(speed * TIMESTAMP_SIGMA_S, resolution))


def location_of(facts: Facts, stream: str, start_ns: int, stop_ns: int | None = None) -> Where:
    """Return where samples from ``start_ns`` to before ``stop_ns`` are (the one sample where None).

    Parameters
    ----------
    facts
        With the clock of the stream.
    stream
        A stream of samples, ``imu`` or ``pose``.
    start_ns, stop_ns
        Ns from the file's origin.

    Returns
    -------
    Where
        Rows whose timestamps are nearest to both ends.
    """
    times_ns = facts.clocks[stream].times_ns
    # Rows are those whose timestamps are nearest to both ends.
    row = int(np.argmin(np.abs(times_ns - start_ns)))
    last = row + 1 if stop_ns is None else max(row + 1, int(np.argmin(np.abs(times_ns - stop_ns))))
    return Where(
        stream=stream,
        start_us=facts.to_file_us(start_ns),
        stop_us=None if stop_ns is None else facts.to_file_us(stop_ns),
        index_start=row,
        index_stop=last,
    )


def why_unusable(facts: Facts, *streams: str) -> str:
    """Return a sentence that names the streams without a usable clock; empty where all have one."""
    unusable = [stream for stream in streams if not facts.clocks[stream].usable]
    return f"most timestamps of {' and '.join(unusable)} do not increase" if unusable else ""


def _sharpened(values: Float64) -> Float64:
    """Return the values in the middle of intervals of which these are the means.

    The mean of a curve over h exceeds its value in the middle by ``h^2/24`` of its second derivative (Taylor).
    """
    second_differences = np.zeros_like(values)
    second_differences[1:-1] = values[2:] - 2 * values[1:-1] + values[:-2]
    return values - second_differences / 24
