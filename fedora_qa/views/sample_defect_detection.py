"""Detection of defects of samples, by which all checks of estimates from them test their samples."""

from collections.abc import Callable
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import displaced_part, rounding_grid_ns, slewed_part
from fedora_qa.estimators.fitting.robust import robust_sigma
from fedora_qa.estimators.imu.curvature import (
    CurvatureEvenness,
    find_interpolation,
    find_straight_lines,
    lone_samples,
)
from fedora_qa.estimators.imu.repeated_samples import longest_hold, repeated_samples
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, SampledCurve, VectorSamples
from fedora_qa.estimators.imu.white_noise import noise_evenness, noise_level, noisiest_part, slow_noise
from fedora_qa.features import Feature
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import StoredStep
from fedora_qa.sequence.window import ImuSamples, PoseSamples
from fedora_qa.views.motion_samples import (
    NOISE_ORDER,
    RADIANS_PER_COMPONENT,
    measured_pose_sigmas,
    position_floor_m,
    sample_step,
    stored_resolution,
)
from fedora_qa.views.sample_defects import (
    OTHER_WEIGHT,
    ClippedSamples,
    ComponentNoise,
    ExcessNoise,
    FilteredNoise,
    HeldComponent,
    LinearInterpolation,
    LoneSamples,
    NoiseAtTimes,
    NoiseOfPart,
    NoWeight,
    PoseValues,
    RepeatedSamples,
    SampleClockDrift,
    SampleClockGrid,
    SampleClockOffset,
    SmoothInterpolation,
)

Float64 = NDArray[np.float64]

LEAST_EVENNESS: Final = 0.2
"""Least evenness of a sampled motion: the curvature of a smooth motion does not change fivefold within a step, nor does
the median of noise."""

_ORDER_OF_CUBICS: Final = 4
"""Order of differences in which cubic curves vanish between their knots."""

_CLIPPED: Final = 0.02
"""Least share of samples at the limit of a sensor for a clip. Float64 samples of a motion repeat none by chance."""

_DISTINCT: Final = 0.9
"""Least share of distinct samples below the limits: rounding and frozen samples leave fewer."""

_LEAST_NOISE_EVENNESS: Final = 0.2
"""Least ratio of noise by the median of differences to that by their 90% quantile for noise that every sample has. It
is 1 for normal noise; below 0.2, half of the samples have less than a fifth of what disturbs a tenth of them. The value
is not derived."""

_SAME_NOISE: Final = 0.25
"""Largest relative difference of two measurements of one noise: each is known to a tenth from a hundred samples."""

_LEAST_LENGTH_NOISE: Final = 1e-7
"""Least scatter of lengths that counts as noise: that of quaternions in single precision is smaller."""

_EXCESS_NOISE: Final = 1.2
"""Ratio of measured to declared sigma above which poses are noisier than declared: sigma is measured to a few
percent."""


def interpolations_of(poses: PoseSamples) -> dict[PoseValues, CurvatureEvenness]:
    """Return the most uneven curvature of positions, and of orientations, over strides of several samples.

    Orientations between which a body turns evenly about one axis, as by slerp, lie on straight lines of rotations.
    Where the curvature is even, that of a part in which samples lie on straight lines within rounding. Without any
    curvature there is none.
    """
    curves: tuple[tuple[PoseValues, SampledCurve, Float64], ...] = (
        ("positions", VectorSamples(poses.positions_world_m), poses.positions_world_m),
        ("orientations", OrientationSamples(poses.orientations_xyzw), poses.orientations_xyzw),
    )
    interpolations: dict[PoseValues, CurvatureEvenness] = {}
    for name, curve, values in curves:
        # Rotations are twice as large as the components of their quaternions.
        factor = RADIANS_PER_COMPONENT if name == "orientations" else 1.0
        resolution = factor * stored_resolution(values)
        step = factor * sample_step(poses.times_ns, values, curve).size
        whole = find_interpolation(poses.times_ns, curve, resolution=resolution, step=step)
        part = None
        if not is_interpolated(whole):
            part = find_straight_lines(poses.times_ns, curve, resolution=resolution, step=step)
        if evenness := part or whole:
            interpolations[name] = evenness
    return interpolations


def is_interpolated(interpolation: CurvatureEvenness | None) -> bool:
    """Whether the curvature is too uneven for a sampled motion."""
    return interpolation is not None and interpolation.evenness < LEAST_EVENNESS


def rate_hz(poses: PoseSamples) -> float:
    """Return the rate of the poses, Hz."""
    return NS_PER_S / float(np.median(np.diff(poses.times_ns)))


def frozen_poses(poses: PoseSamples) -> NDArray[np.intp]:
    """Return the indices (n,) of poses that repeat the one before while the body moves."""
    samples = poses.positions_world_m, poses.orientations_xyzw
    return repeated_samples(*samples, roundings=[stored_resolution(values) for values in samples])


def frozen_imu(imu: ImuSamples, roundings: tuple[float, float]) -> NDArray[np.intp]:
    """Return the indices (n,) of IMU samples that repeat the one before while others change.

    Parameters
    ----------
    imu
        All finite samples of the file.
    roundings
        Units of rounding of angular velocities, rad/s, and specific forces, m/s^2 (``imu_roundings``).
    """
    return repeated_samples(imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2, roundings=roundings)


def held_imu(imu: ImuSamples, frozen: NDArray[np.intp]) -> tuple[Feature, ...]:
    """Return the repeats of an IMU most of whose samples equal the one before, as those of a lower rate that are held.

    Held samples are late by half of the time for which they are held, which is no offset of the clock.
    """
    return (RepeatedSamples("imu", len(frozen)),) if 2 * len(frozen) > len(imu.times_ns) else ()


def held_components(samples: NDArray[np.float64], rounding: float) -> tuple[HeldComponent, ...]:
    """Return the components of a sensor, with samples of shape (N, 3), that are held for a while.

    A component that never varies, as of a motion in a plane, is not held.
    """
    runs = (longest_hold(values, rounding=rounding) for values in samples.T)
    return tuple(HeldComponent(run.stop - run.start) for run in runs if run.stop)


def filtered_noise(
    stream: str, times_ns: NDArray[np.int64], curve_of: Callable[[slice], SampledCurve], declared: float
) -> tuple[FilteredNoise, ...]:
    """Return what a filter left of the declared noise of a stream; nothing where the noise is white.

    A mean over the last n samples leaves 1 / n of the variance, and is late by (n - 1) / 2 samples. A filter of first
    order that takes the share a of each new sample leaves a / (2 - a), and is late by (1 - a) / a samples. Of the share
    v that is left both are late by (1 / v - 1) / 2.

    Parameters
    ----------
    stream
        ``imu`` or ``pose``.
    times_ns
        (N,) timestamps, ns.
    curve_of
        The samples of some rows.
    declared
        Standard deviation of the declared noise, in the unit of the curve.
    """
    level = noise_level(times_ns, curve_of(slice(None)), order=NOISE_ORDER)
    if level is None or not level.sigma < declared:
        return ()
    sigma = slow_noise(times_ns, curve_of, order=NOISE_ORDER, declared=declared)
    if sigma is None:
        return ()
    kept = min((sigma / declared) ** 2, 1.0)
    period_s = float(np.median(np.diff(times_ns))) / NS_PER_S
    return (FilteredNoise(stream, kept, period_s * (1.0 / kept - 1.0) / 2.0),)


def smooth_interpolation(poses: PoseSamples) -> tuple[SmoothInterpolation, ...]:
    """Return the lower rate between whose poses positions lie on cubic curves; nothing where they lie on none."""
    positions_m = poses.positions_world_m
    curves = find_interpolation(
        poses.times_ns,
        VectorSamples(positions_m),
        resolution=stored_resolution(positions_m),
        order=_ORDER_OF_CUBICS,
    )
    if curves is None or not is_interpolated(curves):
        return ()
    return (SmoothInterpolation("pose", rate_hz(poses) / curves.stride),)


def noise_of_part(times_ns: NDArray[np.int64], samples: NDArray[np.float64]) -> tuple[NoiseOfPart, ...]:
    """Return the part of the samples of a sensor, shape (N, 3), that has most noise; none where no part has more."""
    part = noisiest_part(times_ns, VectorSamples(samples), order=NOISE_ORDER)
    if part is None:
        return ()
    first, stop = part.rows
    return (NoiseOfPart(float(times_ns[first]), inf if stop is None else float(times_ns[stop]), part.ratio),)


def clipped_samples(samples: NDArray[np.float64]) -> tuple[Feature, ...]:
    """Return the clip of a sensor, with samples of shape (N, 3); nothing where samples repeat without a limit, too.

    A sensor at its limit repeats one number, and no number below it. Rounded or frozen samples repeat others.
    """
    shares = [0.0]
    for values in samples.T:
        counts = np.unique(values, return_counts=True)[1]
        below = counts[1:-1]
        # An axis that never changes may be that of a level flight.
        if len(below) and len(below) > _DISTINCT * int(below.sum()):
            shares.append(max(int(counts[0]), int(counts[-1])) / len(values))
    largest = max(shares)
    return (ClippedSamples(largest),) if largest > _CLIPPED else ()


def weightless(forces_m_s2: NDArray[np.float64], gravity_m_s2: float) -> tuple[Feature, ...]:
    """Return the lack of weight of specific forces, shape (N, 3), or their excess."""
    ratio = float(np.median(np.linalg.norm(forces_m_s2, axis=1))) / gravity_m_s2 if gravity_m_s2 > 0 else 1.0
    if 1 / OTHER_WEIGHT < ratio < OTHER_WEIGHT:
        return ()
    return (NoWeight(ratio, steadiness_of(forces_m_s2)),)


def steadiness_of(forces_m_s2: NDArray[np.float64]) -> float:
    """Return the length of the mean specific force over the rms length, of forces of shape (N, 3)."""
    rms_m_s2 = float(np.sqrt(np.mean(np.sum(np.square(forces_m_s2), axis=1))))
    mean_m_s2 = float(np.linalg.norm(np.mean(forces_m_s2, axis=0)))
    return mean_m_s2 / rms_m_s2 if rms_m_s2 > 0 else 0.0


def lone_poses(poses: PoseSamples) -> LoneSamples | None:
    """Return the positions that single poses have beside the motion; None where there are none, or a run of them."""
    rows, distances_m = lone_samples(poses.times_ns, VectorSamples(poses.positions_world_m))
    return LoneSamples("pose", len(rows), float(distances_m.max())) if len(rows) else None


def timestamp_defects(facts: Facts, *streams: str) -> tuple[Feature, ...]:
    """Return the defects that follow from timestamps alone, at most one of each stream.

    Such a defect disturbs all estimates from the stream.
    """
    features: list[Feature] = []
    for stream in streams:
        times_ns = facts.clocks[stream].times_ns
        if period_ns := rounding_grid_ns(times_ns, resolution_ns=NS_PER_US):
            features.append(SampleClockGrid(stream, period_ns))
        elif slewed := slewed_part(times_ns, resolution_ns=NS_PER_US):
            features.append(SampleClockDrift(stream, slewed.drift))
        elif displaced := displaced_part(times_ns, resolution_ns=NS_PER_US):
            if displaced.drift:
                features.append(SampleClockDrift(stream, displaced.drift))
            else:
                features.append(SampleClockOffset(stream, displaced.offset_ns))
    return tuple(features)


def component_noise(poses: PoseSamples, step: float, rotation_rad: float, declared_rad: float) -> ComponentNoise | None:
    """Return the noise of the components of quaternions, where lengths scatter as it makes them.

    A quaternion holds half angles. Independent noise of a standard deviation s in its four components changes its
    length by s, and the rotation about each axis by 2 s.

    Parameters
    ----------
    poses
        All finite poses of the file, as stored.
    step
        Coarsest step to which a component was rounded; 0 for none. Rounding is no noise that was added.
    rotation_rad, declared_rad
        Measured and declared noise of the orientation about each axis, rad.
    """
    lengths = np.linalg.norm(poses.orientations_xyzw, axis=1)
    sigma = float(robust_sigma(lengths)) if len(lengths) else 0.0
    # Independent noises add in squares: what exceeds the declaration is left to the components.
    excess_rad = max(rotation_rad**2 - declared_rad**2, 0.0) ** 0.5
    if sigma > max(_LEAST_LENGTH_NOISE, step) and abs(excess_rad / (2.0 * sigma) - 1.0) < _SAME_NOISE:
        return ComponentNoise("pose", sigma)
    return None


def _is_noise_at_times(facts: Facts, poses: PoseSamples) -> bool:
    """Whether positions, by more than rounding and a fast motion explain, leave a smooth motion at times only."""
    curve = VectorSamples(poses.positions_world_m)
    level = noise_level(poses.times_ns, curve, order=NOISE_ORDER)
    stored = facts.steps.get("path/pose/position", StoredStep())
    # Positions in coarse steps change at times, too.
    step_m = max(stored.component(i).size for i in range(3))
    if level is None or level.sigma <= level.motion + max(position_floor_m(poses), step_m):
        return False
    return noise_evenness(poses.times_ns, curve, order=NOISE_ORDER) < _LEAST_NOISE_EVENNESS


def pose_defects(facts: Facts, poses: PoseSamples, model: PoseModel) -> tuple[Feature, ...]:
    """Return the defects of the poses themselves, which disturb estimates from them.

    Defects of timestamps are tested first. A coarse grid has the effects of straight lines, repeats and noise, so these
    are then not tested. Noise is not tested where straight lines, repeats or lone poses were detected. Noise of
    components is more than its excess over the declaration, which is then not stated.

    Parameters
    ----------
    facts
        With the clock of the poses.
    poses
        All finite poses of the file.
    model
        Declared noise of the poses.

    Returns
    -------
    tuple
        Empty where no defect is detected.
    """
    # Defects of timestamps also cause the features of the other defects.
    of_timestamps = timestamp_defects(facts, "pose")
    if of_timestamps:
        return of_timestamps
    features: list[Feature] = []
    interpolated = [each for each in interpolations_of(poses).values() if is_interpolated(each)]
    if interpolated:
        features.append(LinearInterpolation("pose", rate_hz(poses) / interpolated[0].stride))
    frozen = frozen_poses(poses)
    if len(frozen):
        features.append(RepeatedSamples("pose", len(frozen)))
    if not features and (lone := lone_poses(poses)):
        features.append(lone)
    if not features and _is_noise_at_times(facts, poses):
        features.append(NoiseAtTimes("pose"))
    if not features:
        position_m, rotation_rad = measured_pose_sigmas(poses)
        stored = facts.steps.get("path/pose/orientation", StoredStep())
        step = max(stored.component(i).size for i in range(4))
        if noise := component_noise(poses, step, rotation_rad, model.rotation_sigma_rad):
            return (noise,)
        exceeds = (
            position_m > _EXCESS_NOISE * model.position_sigma_m
            or rotation_rad > _EXCESS_NOISE * model.rotation_sigma_rad
        )
        # With exact poses declared any rounding would exceed the declared noise.
        if exceeds and max(model.position_sigma_m, model.rotation_sigma_rad) > 0:
            features.append(ExcessNoise("pose"))
    return tuple(features)
