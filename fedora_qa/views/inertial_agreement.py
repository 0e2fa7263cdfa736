"""IMU against pose: both streams, their fit, the trial of other conventions, and features of the result."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.fitting.grouped_fit import group_of
from fedora_qa.estimators.imu.conventions import InertialConvention, explain_forces, explain_rates
from fedora_qa.estimators.imu.noisy_conventions import explain_in_noise
from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, fit_inertial
from fedora_qa.estimators.imu.specific_force import upright
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import ImuSamples, PoseSamples, Window
from fedora_qa.views.motion_samples import (
    imu_model,
    imu_roundings,
    inertial_noise,
    inertial_samples,
    join_imu,
    join_poses,
    measured_pose_sigmas,
    owned_imu,
    owned_poses,
    pose_model,
    why_unusable,
)
from fedora_qa.views.sample_defect_detection import frozen_imu

MotionKind = Literal["rotation", "translation"]

_CERTAIN_SIGMAS: Final = 8.0
"""Standard errors that exceed the limit of any file, for any number of comparisons."""

_FEWEST_POSES: Final = 16

_EXCESS_SIGMAS: Final = 6.0
"""Standard errors by which residuals must exceed noise and model for other conventions to be tried."""

_EDGE_STEPS: Final = 1.5
"""Steps of the poses at either end of a local disturbance that may hold samples of both kinds."""

_LARGEST_SMALL_FAULT: Final = {
    "time_offset": 0.1,
    "clock_rate": 0.02,
    "pose_clock_rate": 0.02,
    "tilt": 0.1,
    "scale": 0.1,
    "bias": 1.0,
    "gravity": 1.0,
    "slope": 1.0,
    "lever": 1.0,
}
"""Largest small fault by group of parameters, in the unit of the fit. Beyond it other conventions are tried."""

_IMPLAUSIBLE: Final = 5.0
"""Multiple of the largest small fault that no sensor has: a rotation of 0.5 rad, a gain wrong by 0.5, an offset of 0.5
s."""


@dataclass(frozen=True, slots=True)
class InertialConventionTrial(Feature):
    """A convention under which IMU and poses agree where they do not as declared.

    Attributes
    ----------
    convention
        The convention, with its residual and that of the declared convention.
    interval_s
        Start and end of the time in which it holds, s; None for the whole sequence.
    kind
        Which samples were compared.
    """

    convention: InertialConvention
    interval_s: tuple[float, float] | None = None
    kind: MotionKind = "rotation"

    @property
    def is_certain(self) -> bool:
        """Whether the disagreement exceeds ``_CERTAIN_SIGMAS`` standard errors: no other measurement is then needed."""
        value, error = self.convention.disagreement
        return value - 1.0 > _CERTAIN_SIGMAS * error


@dataclass(frozen=True, slots=True)
class BiasOfPart(Feature):
    """The bias of a part of the sequence that removes most of the residuals.

    Attributes
    ----------
    kind
        Kind of the comparison.
    bias
        (3,) along the axes of the sensor, rad/s or m/s^2.
    start_ns, stop_ns
        Of the part, ns from the file's origin; infinite where it reaches an end of the sequence.
    explained
        Share of the squares beyond noise that it removes, 0 to 1.
    """

    kind: MotionKind
    bias: tuple[float, float, float]
    start_ns: float
    stop_ns: float
    explained: float


@dataclass(frozen=True, slots=True)
class ConstantForce(Feature):
    """The constant that specific forces lack, where it explains as much as missing gravity or more.

    Attributes
    ----------
    lacking_m_s2
        Along the axes of the sensor.
    steadiness
        Of what is left, as of ``NoWeight``: near 1 for a weight in another unit.
    """

    lacking_m_s2: tuple[float, float, float]
    steadiness: float


@dataclass(frozen=True, slots=True)
class GainOfPart(Feature):
    """Another gain of the gyro in a part of the sequence, which removes more of the residuals than any bias of a part.

    Attributes
    ----------
    gain
        Measured over true value.
    explained
        Share of the squares beyond noise that it removes, 0 to 1.
    """

    gain: float
    explained: float


@dataclass(frozen=True, slots=True)
class DriftingBias(Feature):
    """A bias that changes evenly with time and removes nearly all of the residuals, as no constant one does.

    Attributes
    ----------
    kind
        Kind of the comparison.
    largest
        (3,) the longer one of the biases at both ends, along the axes of the sensor, rad/s or m/s^2.
    explained
        Share of the squares beyond noise that it removes, 0 to 1.
    """

    kind: MotionKind
    largest: tuple[float, float, float]
    explained: float


@dataclass(frozen=True, slots=True)
class OffsetsApart(Feature):
    """One sensor of the IMU is late and the other is not, so that their mean is the delay of neither.

    Attributes
    ----------
    late
        The comparison that has the delay: ``rotation`` for the gyro, ``translation`` for the accelerometer.
    offset_s, standard_error_s
        Delay of that sensor, s, positive where its samples are late, and its standard error.
    """

    late: MotionKind
    offset_s: float
    standard_error_s: float


class StreamsCache:
    """The joined streams of all windows, kept for the other checks that conclude from the same samples.

    The cache stays in its process: a pickled copy is empty.
    """

    def __init__(self) -> None:
        self.streams: InertialStreams | None = None
        self.facts: Facts | None = None

    def __reduce__(self) -> tuple[type["StreamsCache"], tuple[()]]:
        return StreamsCache, ()


@dataclass(frozen=True, slots=True)
class WindowMotion:
    """The samples of IMU and pose of one window.

    Attributes
    ----------
    imu, poses
        Those that the window owns; None where it has none.
    cache
        Holds the joined streams of all windows.
    """

    imu: ImuSamples | None
    poses: PoseSamples | None
    cache: StreamsCache = field(default_factory=StreamsCache, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class InertialStreams:
    """Both streams of a sequence on one axis of time, which starts at ``origin_ns``, with the fits of these streams.

    Attributes
    ----------
    samples, noise
        Both streams in seconds from ``origin_ns``, and their noise, declared or measured, and rounding.
    poses, imu
        As stored, all finite.
    frozen_imu
        Indices of the IMU samples that repeat the one before.
    origin_ns
        First timestamp of the IMU, ns from the file's origin.
    fits, trials
        Fits and trials of conventions, by the kind of comparison.
    """

    samples: InertialSamples
    noise: InertialNoise
    poses: PoseSamples
    imu: ImuSamples
    frozen_imu: NDArray[np.intp]
    origin_ns: int
    fits: dict[MotionKind, InertialFit | None] = field(default_factory=dict, compare=False, repr=False)
    trials: dict[MotionKind, InertialConventionTrial | None] = field(default_factory=dict, compare=False, repr=False)

    def time_ns(self, time_s: float) -> int:
        """Return an instant as ns from the file's origin."""
        return self.origin_ns + round(time_s * NS_PER_S)


def motion_of(window: Window) -> WindowMotion | None:
    """Return the window's own samples of IMU and poses; None where it has neither."""
    return window.derived(_motion_of)


def _motion_of(window: Window) -> WindowMotion | None:
    imu, poses = owned_imu(window), owned_poses(window)
    return None if imu is None and poses is None else WindowMotion(imu, poses)


def streams_of(state: Sequence[WindowMotion], facts: Facts) -> InertialStreams | str:
    """Join the samples of all windows.

    Parameters
    ----------
    state
        Samples by window, in the order of time.
    facts
        With clocks and declared noise of both streams.

    Returns
    -------
    InertialStreams or str
        A sentence that gives the reason where the two streams cannot be compared.
    """
    unusable = why_unusable(facts, "imu", "pose")
    if unusable:
        return unusable
    imu = join_imu([motion.imu for motion in state if motion.imu is not None])
    poses = join_poses([motion.poses for motion in state if motion.poses is not None])
    # Too few samples, or none in common, leave nothing to compare.
    if len(poses.times_ns) < _FEWEST_POSES or len(imu.times_ns) < _FEWEST_POSES:
        return f"fewer than {_FEWEST_POSES} finite samples of pose or IMU"
    if poses.times_ns[0] >= imu.times_ns[-1] or imu.times_ns[0] >= poses.times_ns[-1]:
        return "IMU and pose do not overlap in time"
    # Three checks conclude from the same windows: the cache of the last window holds the streams that the first check
    # joined.
    cache = state[-1].cache
    streams = cache.streams if cache.facts is facts else None
    if streams is None or not (_are_equal(streams.poses, poses) and _are_equal(streams.imu, imu)):
        model = imu_model(facts, imu)
        samples = inertial_samples(imu, poses, model).at_lever(np.array(facts.declared.imu_lever_body_m))
        streams = InertialStreams(
            samples=samples if facts.declared.has_vertical else upright(samples),
            noise=inertial_noise(model, pose_model(facts, poses), imu, poses),
            poses=poses,
            imu=imu,
            frozen_imu=frozen_imu(imu, imu_roundings(imu)),
            origin_ns=int(imu.times_ns[0]),
        )
        cache.streams, cache.facts = streams, facts
    return streams


def _are_equal(first: ImuSamples | PoseSamples, second: ImuSamples | PoseSamples) -> bool:
    return all(np.array_equal(getattr(first, array.name), getattr(second, array.name)) for array in fields(first))


def coverage_of(streams: InertialStreams | str, facts: Facts) -> Coverage:
    """Return how many poses were compared.

    Parameters
    ----------
    streams
        Joined streams, or the reason why there are none.
    facts
        With the clock of the poses.

    Returns
    -------
    Coverage
        Compared poses of all poses.
    """
    compared = 0 if isinstance(streams, str) else len(streams.poses.times_ns)
    return Coverage(compared, len(facts.clocks["pose"].times_ns), "poses")


def fit_of(streams: InertialStreams, kind: MotionKind) -> InertialFit | None:
    """Fit one kind of comparison, once.

    Parameters
    ----------
    streams
        Both streams; they keep the fit.
    kind
        ``rotation`` or ``translation``.

    Returns
    -------
    InertialFit or None
        None where the streams have too little in common.
    """
    if kind not in streams.fits:
        comparison = ROTATION if kind == "rotation" else TRANSLATION
        walk = streams.noise.gyro_walk if kind == "rotation" else streams.noise.accel_walk
        streams.fits[kind] = fit_inertial(streams.samples, streams.noise, comparison, bias_walk=walk)
    return streams.fits[kind]


def convention_trial(streams: InertialStreams, kind: MotionKind, fit: InertialFit) -> InertialConventionTrial | None:
    """Return the convention under which the streams agree, where their disagreement is more than a small fault.

    Conventions of the whole sequence are tried first. If none explains a disagreement that is local, conventions of
    that part alone are tried. The trial is made once.

    Parameters
    ----------
    streams
        Both streams; they keep the trial.
    kind
        ``rotation`` or ``translation``.
    fit
        Of that kind, as declared.

    Returns
    -------
    InertialConventionTrial or None
        None where the streams agree, or agree under no convention.
    """
    if kind in streams.trials:
        return streams.trials[kind]
    streams.trials[kind] = None
    excess = fit.rms - fit.model_rms - fit.expected_rms
    if fit.settled and not _exceeds(fit, 1.0) and excess < _EXCESS_SIGMAS * fit.rms_error:
        return None
    position_m, rotation_rad = measured_pose_sigmas(streams.poses)
    part_s = fit.disturbed or _within(fit.noisy_part, streams.samples)
    for interval_s in (None, part_s) if part_s else (None,):
        samples = streams.samples
        if interval_s is not None:
            step_s = _EDGE_STEPS * float(np.median(np.diff(samples.pose_times_s)))
            # Poses next to an edge of the disturbance are interpolated from samples of both kinds.
            samples = samples.between(interval_s[0] + step_s, interval_s[1] - step_s)
        if len(samples.pose_times_s) < _FEWEST_POSES or len(samples.imu_times_s) < _FEWEST_POSES:
            continue
        if kind == "rotation":
            convention = explain_rates(samples, rotation_rad)
        else:
            by_rates = _convention_of_rates(streams)
            convention = explain_forces(
                samples, streams.noise.gravity_m_s2, position_m, by_rates.angle_signs, by_rates.sensor_axes
            )
        is_noisy = max(streams.noise.position_sigma_m, streams.noise.rotation_sigma_rad) > 0
        if convention is None and is_noisy and (interval_s is None or fit.disturbed is None):
            # Few means of noisy poses show nothing: all samples together do.
            convention = explain_in_noise(samples, streams.noise, ROTATION if kind == "rotation" else TRANSLATION)
        # The declared convention has the complexity 0; it reduces no residual.
        if convention is not None and convention.complexity > 0:
            streams.trials[kind] = InertialConventionTrial(convention, interval_s, kind)
            break
    return streams.trials[kind]


def _within(part_s: tuple[float, float] | None, samples: InertialSamples) -> tuple[float, float] | None:
    """Return the ends of a part within the samples of both streams."""
    if part_s is None:
        return None
    first_s = max(float(samples.imu_times_s[0]), float(samples.pose_times_s[0]))
    last_s = min(float(samples.imu_times_s[-1]), float(samples.pose_times_s[-1]))
    return max(part_s[0], first_s), min(part_s[1], last_s)


def _convention_of_rates(streams: InertialStreams) -> InertialConvention:
    """Return the convention under which angular velocities of the whole sequence agree: the declared one if none."""
    fit = fit_of(streams, "rotation")
    trial = None if fit is None else convention_trial(streams, "rotation", fit)
    return InertialConvention() if trial is None or trial.interval_s is not None else trial.convention


def is_implausible(fit: InertialFit) -> bool:
    """Whether a freed parameter is too large for any sensor, so that the fit turns one motion into another."""
    return _exceeds(fit, _IMPLAUSIBLE)


def _exceeds(fit: InertialFit, multiple: float) -> bool:
    return any(
        parameter.free and abs(parameter.value) > multiple * _LARGEST_SMALL_FAULT[group_of(name)]
        for name, parameter in fit.parameters.items()
    )
