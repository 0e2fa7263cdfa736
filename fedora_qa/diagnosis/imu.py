"""Hypotheses for alarms of the checks of the IMU, and cues to whether IMU or poses deviate."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, hypot, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.imu.agreement import InertialParameter, RepeatsNearby, ResidualSmoothness, UnsettledFit
from fedora_qa.conventions import NS_PER_US, STANDARD_GRAVITY_M_S2
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis, only_feature, support
from fedora_qa.diagnosis.pose import SAME_FACTOR, axes_cause, defect_hypotheses, noise_hypotheses
from fedora_qa.estimators.fitting.grouped_fit import group_of
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.faults.fault import signed_length
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.inertial_agreement import (
    BiasOfPart,
    DriftingBias,
    GainOfPart,
    InertialConventionTrial,
    MotionKind,
    OffsetsApart,
)
from fedora_qa.views.sample_defects import OTHER_WEIGHT, ClippedSamples, HeldComponent, NoiseOfPart, NoWeight

Int64 = NDArray[np.int64]

USUAL_GRAVITIES_M_S2: Final = (9.8, 9.806, 9.8066, STANDARD_GRAVITY_M_S2, 9.807, 9.81)
"""Magnitudes of gravity that simulators and datasets use, m/s^2."""

_USUAL_SIGMAS: Final = 3.0
"""Standard errors within which a measured gravity is a usual one."""

_EXACT_M_S2: Final = 1e-9
"""Largest difference of a declared gravity from a usual one, m/s^2: rounding of float64 only."""

_IN_PLACE, _OUT_OF_PLACE = 0.9, 0.75
"""Shares of coincidences: one clock is correct and the other has an offset where the share of the one is at least the
first number, and that of the other at most the second."""

# The fit is in s and s/s, the causes are in ms and ppm.
_MS, _PPM = 1e3, 1e6

_LEAST_EXPLAINED: Final = 0.5
"""Explained share above which a group of parameters becomes a rival of the freed one."""

_OPPOSITE: Final = ((-1, 0, 0), (0, -1, 0), (0, 0, -1))
"""Axes of a sensor whose values all have the other sign."""

HALF_TURN: Final = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))
"""Axes of a sensor that is turned by half about Z. Those of the body of quaternions z, w, x, y that are taken for x, y,
z, w are alike: ``(z, w, x, y) = -i q k^-1``, so that the body is turned about Z, and the world about X."""

_ALL: Final = 0.98
"""Least share of the residuals that a constant explains where it is the cause. The value is not derived."""

STEADY: Final = 0.9
"""Least length of the mean specific force over its rms length for a weight. The value is not derived: a flight whose
force turns or varies by half of it has 0.87."""

_ROUNDED_S: Final = 1e-6 / sqrt(12.0)
"""Standard deviation of rounding to whole microseconds, s. All timestamps of an even clock have the same rounding
error."""


@dataclass(frozen=True, slots=True)
class TimingCues:
    """Likelihoods of the timestamps, up to a common factor, under an offset of either clock.

    Attributes
    ----------
    imu_offset, pose_offset
        Likelihood if the clock of the IMU, or that of the poses, has the offset.
    """

    imu_offset: float = 1.0
    pose_offset: float = 1.0


def timing_cues_of(facts: Facts) -> TimingCues:
    """Compare the timestamps of IMU and poses with those of all other streams.

    Simulators and good recorders have one grid for all timestamps: the timestamps of frames are also timestamps of IMU
    and poses. After a random offset of a whole number of microseconds, a clock is on the grid with a probability of 1
    us over its period.
    """
    if "imu" not in facts.clocks or "pose" not in facts.clocks:
        return TimingCues()
    imu_ns, pose_ns = (facts.clocks[stream].times_ns for stream in ("imu", "pose"))
    # For each cue the shares to which IMU and pose are in place: frames, beginnings, grid.
    cues: list[tuple[float, float]] = []
    frame_clocks = [clock for stream, clock in facts.clocks.items() if stream not in ("imu", "pose")]
    frames_ns = [clock.times_ns for clock in frame_clocks if clock.usable]
    if frames_ns and len(imu_ns) and len(pose_ns):
        all_ns = np.concatenate(frames_ns)
        cues.append((_share_among(all_ns, imu_ns), _share_among(all_ns, pose_ns)))
        # Streams begin together; one with an offset begins at another time.
        firsts_ns = np.array([times_ns[0] for times_ns in frames_ns])
        cues.append((float(np.mean(firsts_ns == imu_ns[0])), float(np.mean(firsts_ns == pose_ns[0]))))
    cues.append((_on_own_grid(facts, imu_ns), _on_own_grid(facts, pose_ns)))
    for imu_share, pose_share in cues:
        # The IMU is on the grid and the poses are not: the poses have the offset, or the IMU has it and is on the grid
        # by chance.
        if imu_share >= _IN_PLACE and pose_share <= _OUT_OF_PLACE:
            return TimingCues(imu_offset=_chance_of_coincidence(imu_ns))
        if pose_share >= _IN_PLACE and imu_share <= _OUT_OF_PLACE:
            return TimingCues(pose_offset=_chance_of_coincidence(pose_ns))
    return TimingCues()


def gravity_likelihoods(declared_m_s2: float, excess_m_s2: float, error_m_s2: float) -> tuple[float, float]:
    """Return the likelihoods of a deviating gravity under a fault of the sensor, and under a wrong declaration.

    Under a fault of the sensor the declaration is correct, and mostly a usual number. Under a wrong declaration the
    measured gravity is mostly a usual number, within its error.

    Parameters
    ----------
    declared_m_s2
        Declared gravity, m/s^2.
    excess_m_s2
        Measured less declared gravity, m/s^2.
    error_m_s2
        Its standard error, m/s^2.

    Returns
    -------
    sensor
        Likelihood under a fault of the sensor: 1, or less for an unusual number.
    declaration
        Likelihood under a wrong declaration, likewise.
    """
    unusual = support("imu.unusual_gravity")
    sensor = 1.0 if _is_usual(declared_m_s2, _EXACT_M_S2) else unusual
    declaration = 1.0 if _is_usual(declared_m_s2 + excess_m_s2, _USUAL_SIGMAS * error_m_s2) else unusual
    return sensor, declaration


def _share_among(times_ns: Int64, timestamps_ns: Int64) -> float:
    """Return the share of instants, within the span of the timestamps, that equal one of the timestamps."""
    within = times_ns[(times_ns >= timestamps_ns[0]) & (times_ns <= timestamps_ns[-1])]
    if not len(within):
        return 0.0
    # By bisection where timestamps are in order, which is the rule.
    in_order = not np.any(np.diff(timestamps_ns) < 0)
    # The search has no index beyond the end: ``within`` does not exceed the last timestamp.
    coincident = (
        timestamps_ns[np.searchsorted(timestamps_ns, within)] == within if in_order else np.isin(within, timestamps_ns)
    )
    return float(np.mean(coincident))


def _on_own_grid(facts: Facts, timestamps_ns: Int64) -> float:
    """Return whether the timestamps of the stream are multiples of its period: 1 if so, else 0."""
    if len(timestamps_ns) < 2:
        return 0.0
    # The median, because a gap would move the mean of the steps.
    period_us = float(np.median(np.diff(timestamps_ns))) / NS_PER_US
    return float(period_us > 1 and facts.to_file_us(float(timestamps_ns[0])) % period_us == 0)


def _chance_of_coincidence(timestamps_ns: Int64) -> float:
    """Return the probability that a clock with an offset of whole microseconds is on the grid: 1 us over its period."""
    return NS_PER_US / max(float(np.median(np.diff(timestamps_ns))), NS_PER_US) if len(timestamps_ns) > 1 else 1.0


def _is_usual(gravity_m_s2: float, within_m_s2: float) -> bool:
    return min(abs(gravity_m_s2 - usual) for usual in USUAL_GRAVITIES_M_S2) <= within_m_s2


def propose_noise(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of noise that differs from its declaration, or of repeated samples."""
    if alarm.finding.code == "imu.noise.frozen":
        return (Hypothesis("frozen_frames", "imu", support("imu.repeats_counted"), alarm.statistic.value, "samples"),)
    # A gyro written in deg/s has 180 / pi = 57.3 times its noise in rad/s.
    units = [("unit_deg_rad", degrees(1.0))] if alarm.finding.code == "imu.noise.gyro" else []
    return (*_units_of_part(alarm, units), *noise_hypotheses(alarm, "imu", units))


def _units_of_part(alarm: Alarm, units: Sequence[tuple[str, float]]) -> tuple[Hypothesis, ...]:
    """Return the units of a part of the samples, whose noise is as many times that of the others."""
    return tuple(
        Hypothesis(cause, "imu", support("motion.noise_of_unit"), factor, "1")
        for part in alarm.statistic.features
        if isinstance(part, NoiseOfPart)
        for cause, factor in units
        if abs(part.ratio / factor - 1.0) < SAME_FACTOR
    )


def propose_timing(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a deviation of both clocks: defects of the timestamps, then the parameters of the fit.

    Where one sensor of the IMU is late and the other is not, the stated mean is the delay of neither.
    """
    features = alarm.statistic.features
    of_one_sensor = tuple(
        Hypothesis(
            "time_offset",
            "imu",
            support("imu.offset_of_one_sensor"),
            _MS * feature.offset_s,
            "ms",
            _MS * feature.standard_error_s,
        )
        for feature in features
        if isinstance(feature, OffsetsApart)
    )
    return (*defect_hypotheses(features), *(of_one_sensor or _of_parameter(alarm, facts)))


def propose_rotation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a deviation between angular velocities and orientations."""
    return _of_agreement("rotation", alarm, facts)


def propose_translation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a deviation between specific forces and positions."""
    return _of_agreement("translation", alarm, facts)


def _of_agreement(kind: MotionKind, alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    features = alarm.statistic.features
    trials = (feature for feature in features if isinstance(feature, InertialConventionTrial))
    conventions = tuple(hypothesis for trial in trials for hypothesis in convention_hypotheses(kind, trial.convention))
    defects = (*conventions, *defect_hypotheses(features), *_of_part(features))
    rule = alarm.finding.code.rpartition(".")[2]
    if rule == "disagreement":
        return conventions
    declared_m_s2 = (facts.declared.imu or ImuModel()).gravity
    is_of_no_flight = any(
        isinstance(feature, ClippedSamples)
        or (isinstance(feature, NoWeight) and not weighs_as_on_earth(feature, declared_m_s2))
        for feature in features
    )
    if is_of_no_flight:
        # Samples below a limit are right, so that no bias or gain is theirs, nor that of a part. Another flight has its
        # weight: what has none is in another unit, of which no parameter of the fit is one.
        unknown = Hypothesis("unknown", "imu", support("imu.samples_of_no_flight"))
        return (*conventions, *defect_hypotheses(features), *_weight_taken_off(features), unknown)
    if any(isinstance(feature, HeldComponent) for feature in features):
        # A component that keeps its value lacks the whole motion about its axis: parameters of the fit are its effects.
        return (*conventions, *defect_hypotheses(features))
    for feature in features:
        if isinstance(feature, GainOfPart):
            # A gain that changes has no name; the bias that is fitted to the whole is an effect of it.
            unknown = Hypothesis("unknown", "imu", support("imu.gain_of_part") * feature.explained, feature.gain, "1")
            return (*conventions, *defect_hypotheses(features), unknown)
    if rule not in ("residual", "worst"):
        # A fit that did not converge turns one motion into another: its parameters have no meaning.
        other = _other_sequence(1.0) if any(isinstance(feature, UnsettledFit) for feature in features) else ()
        return (*defects, *other, *_of_parameter(alarm, facts))

    # Residuals of another motion are as smooth as that motion; residuals of noise are not. The correlation of
    # neighbours divides the support between the two. Noise may be that of either stream.
    smooth = only_feature(features, ResidualSmoothness).correlation
    if rule == "residual":
        noise = support("imu.residual_noise") * (1 - smooth)
        return (
            *defects,
            Hypothesis("noise_misdeclared", "pose", noise),
            Hypothesis("noise_misdeclared", "imu", noise),
            *_any_cause(support("imu.residual_of_any_cause") * (1 - smooth)),
            *_other_sequence(smooth),
            *_changing_bias(kind, smooth),
        )
    # Causes at one instant: repeated samples, a jump (more often of positions), lost samples.
    teleport = support("imu.worst_translation_jump" if kind == "translation" else "imu.worst_rotation_jump")
    repeats = tuple(
        Hypothesis("frozen_frames", feature.stream, support("imu.worst_at_repeats"), float(feature.count), "samples")
        for feature in features
        if isinstance(feature, RepeatsNearby)
    )
    return (
        *repeats[::-1],
        Hypothesis("teleport", "pose", (1 - smooth) * teleport),
        Hypothesis("dropped_samples", "imu", (1 - smooth) * support("imu.worst_lost_samples")),
        Hypothesis("noise_misdeclared", "pose", (1 - smooth) * support("imu.worst_noise")),
        *_any_cause(support("imu.worst_of_any_cause") * (1 - smooth)),
        *_other_sequence(smooth),
        *_changing_bias(kind, smooth),
        *defects,
    )


def weighs_as_on_earth(weight: NoWeight, declared_m_s2: float) -> bool:
    """Whether samples that do not have the declared weight have that of a body on Earth: the declaration is wrong.

    Parameters
    ----------
    weight
        As measured, in units of the declared gravity.
    declared_m_s2
        Declared gravity, m/s^2.
    """
    return 1 / OTHER_WEIGHT < weight.ratio * declared_m_s2 / STANDARD_GRAVITY_M_S2 < OTHER_WEIGHT


def _weight_taken_off(features: Sequence[Feature]) -> tuple[Hypothesis, ...]:
    """Return gravity that was taken off as a constant: what is left varies, and a bias explains that it has no weight.

    A weight in a larger unit is as steady as any, and one that turns with the body is explained by no bias.
    """
    is_light = any(isinstance(f, NoWeight) and f.ratio < 1 and f.steadiness < STEADY for f in features)
    by_bias = max((f.explained.get("bias", 0.0) for f in features if isinstance(f, InertialParameter)), default=0.0)
    if not is_light or by_bias < _ALL:
        return ()
    return (Hypothesis("gravity_missing", "imu", support("imu.weight_taken_off")),)


def _of_part(features: Sequence[Feature]) -> tuple[Hypothesis, ...]:
    """Return a bias of a part of the sequence, or one that drifts, where it explains nearly all of the residuals."""
    return tuple(
        Hypothesis(
            "gyro_bias" if bias.kind == "rotation" else "accel_bias",
            "imu",
            support("imu.bias_of_part") * bias.explained,
            signed_length(bias.bias if isinstance(bias, BiasOfPart) else bias.largest),
            "rad/s" if bias.kind == "rotation" else "m/s^2",
        )
        for bias in features
        if isinstance(bias, BiasOfPart | DriftingBias)
    )


def _changing_bias(kind: MotionKind, smooth: float) -> tuple[Hypothesis, ...]:
    """Return a bias of the gyro that walks: what it adds is as smooth as another motion, which its gain rules out."""
    if kind != "rotation":
        return ()
    return (Hypothesis("gyro_bias", "imu", support("imu.changing_bias") * smooth),)


def _other_sequence(smooth: float) -> tuple[Hypothesis, ...]:
    strength = support("imu.other_sequence") * smooth
    return tuple(Hypothesis("other_sequence", stream, strength) for stream in ("imu", "pose"))


def _any_cause(strength: float) -> tuple[Hypothesis, ...]:
    """Return any other fault of either stream, of a part or of the whole sequence."""
    return tuple(Hypothesis(ANY_CAUSE, stream, strength) for stream in ("pose", "imu"))


def convention_hypotheses(kind: MotionKind, convention: InertialConvention) -> tuple[Hypothesis, ...]:
    """Return the causes of a convention that differs from the declared one.

    Parameters
    ----------
    kind
        ``rotation`` or ``translation``: which samples were compared.
    convention
        Under which the streams agree. Its share of explained residuals gives the support.

    Returns
    -------
    tuple
        One for each difference from the declared convention.
    """
    declared, strength = InertialConvention(), support("imu.convention") * convention.explained
    hypotheses: list[Hypothesis] = []
    if convention.component_order is not None:
        hypotheses.append(Hypothesis("quaternion_order", "pose", strength))
    if "inverse" in convention.quaternions:
        hypotheses.append(Hypothesis("quaternion_inverted", "pose", strength))
    if kind == "rotation" and convention.axes_of_sensor_alone is not None:
        # Near an attitude of no rotation, an inverse or an angle of the other sign turns as other axes of the gyro do.
        hypotheses.append(Hypothesis(axes_cause(convention.axes_of_sensor_alone), "imu", strength))
    if convention.rate_unit != 1.0:
        hypotheses.append(Hypothesis("unit_deg_rad", "imu", strength, convention.rate_unit, "1"))
    if convention.length_unit != 1.0:
        hypotheses.append(Hypothesis("unit_mm_m", "pose", strength, convention.length_unit, "1"))
    if convention.angle_signs != declared.angle_signs:
        # Positions turned by quarters are then those of a yaw that is counted from another direction.
        return (*hypotheses, Hypothesis("frame_convention", "pose", strength))
    if convention.world_axes != declared.world_axes:
        hypotheses.append(Hypothesis(axes_cause(convention.world_axes), "pose", strength))
    if kind == "translation" and convention.sensor_axes == _OPPOSITE and convention.up == declared.up:
        # All axes reversed are the other sign of the accelerometer.
        return (*hypotheses, Hypothesis("gravity_sign", "imu", strength))
    if convention.sensor_frame != declared.sensor_frame:
        hypotheses.append(Hypothesis("frame_convention", "imu", strength))
    if convention.sensor_axes != declared.sensor_axes or convention.up != declared.up:
        # Either the sensor is rotated, or the body of the poses, which also rotates gravity in the world.
        cause = axes_cause(convention.sensor_axes)
        of_imu, of_pose = Hypothesis(cause, "imu", strength), Hypothesis("frame_convention", "pose", strength)
        if kind == "rotation":
            hypotheses.extend((of_imu, of_pose) if cause == "frame_convention" else (of_imu,))
            if convention.sensor_axes == HALF_TURN:
                hypotheses.append(Hypothesis("quaternion_order", "pose", strength))
            if convention.sensor_axes == _OPPOSITE:
                # The inverse of an attitude turns by -R w: near an attitude of no rotation by the opposite rates.
                hypotheses.append(Hypothesis("quaternion_inverted", "pose", strength))
        else:
            is_world = convention.gravity == "reversed" or convention.up != declared.up
            # The mirrored axes of a sensor alone would be as well those of world and body.
            is_mirrored = np.linalg.det(convention.sensor_axes) < 0
            hypotheses.extend((of_pose,) if is_world else (of_pose, of_imu) if is_mirrored else (of_imu,))
    elif convention.gravity != "declared":
        cause = "gravity_sign" if convention.gravity == "reversed" else "gravity_missing"
        hypotheses.append(Hypothesis(cause, "imu", strength))
    return tuple(hypotheses)


def _of_parameter(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    parameter = only_feature(alarm.statistic.features, InertialParameter)
    gravity_m_s2 = (facts.declared.imu or ImuModel()).gravity
    return parameter_hypotheses(parameter, timing_cues_of(facts), gravity_m_s2)


def parameter_hypotheses(
    parameter: InertialParameter, timing_cues: TimingCues, gravity_m_s2: float
) -> tuple[Hypothesis, ...]:
    """Return the causes of a deviating parameter: those of its group, and of groups that explain the data as well.

    The support is the share of the explainable deviation that the group explains alone. It is reduced for a component
    that is smaller than others of its group's vector, since the largest component gives the size of the fault. A group
    that leaves larger residuals than the parameter's own group is less probable. Where either of two streams could be
    the cause, the timing cues decide.

    Parameters
    ----------
    parameter
        As fitted.
    timing_cues
        Of the file.
    gravity_m_s2
        Declared gravity, m/s^2.

    Returns
    -------
    tuple
        Those of the parameter's own group first.
    """
    kind, group = parameter.kind, group_of(parameter.name)
    own = parameter.explained.get(group, support("imu.parameter_not_freed"))
    smallest = support("imu.smallest_component")
    # Linear in this component over the largest of its vector: 1 for the largest, ``smallest_component`` for 0.
    strength = (smallest + (1.0 - smallest) * parameter.component_ratio) * max(support("imu.parameter_least"), own)
    value, error = parameter.value, parameter.standard_error
    hypotheses = list(_group_hypotheses(kind, group, value, error, strength, timing_cues, gravity_m_s2))
    for rival, explained in parameter.explained.items():
        if rival != group and explained > _LEAST_EXPLAINED:
            # With noise of unknown size, the likelihood of n samples is proportional to S^(-n / 2), where S = 1 -
            # explained is the remaining share of squares. So a rival has (S_own / S_rival)^(n / 2) of the likelihood.
            # Residuals of neighbouring samples are correlated: all count as one sample, n = 1.
            likelihood = sqrt(max(1.0 - own, 0.0) / (1.0 - explained)) if explained < own else 1.0
            of_rival = support("imu.rival_group") * explained * likelihood
            hypotheses += [
                Hypothesis(hypothesis.cause, hypothesis.stream, hypothesis.support)
                for hypothesis in _group_hypotheses(kind, rival, 0.0, 0.0, of_rival, timing_cues, gravity_m_s2)
            ]
    return tuple(hypotheses)


def _group_hypotheses(
    kind: MotionKind,
    group: str,
    value: float,
    error: float,
    strength: float,
    timing_cues: TimingCues,
    gravity_m_s2: float,
) -> tuple[Hypothesis, ...]:
    """Return the causes of a group of parameters, with a value and its error in the unit of the fit."""
    hypotheses: tuple[Hypothesis, ...] = ()
    match group:
        case "time_offset":
            # Two clocks alone do not determine which of them is late, nor which part of a delay is in the timestamps.
            # Rounding to whole us is uniform, sigma = 1 us / sqrt(12), and independent of the errors of the fit.
            error_ms = _MS * hypot(error, _ROUNDED_S)
            of_imu, of_pose = timing_cues.imu_offset * strength, timing_cues.pose_offset * strength
            hypotheses = (
                Hypothesis("time_offset", "imu", of_imu, _MS * value, "ms", error_ms),
                Hypothesis("time_offset", "pose", of_pose, -_MS * value, "ms", error_ms),
            )
        case "clock_rate":
            hypotheses = (Hypothesis("clock_rate", "imu", strength, _PPM * value, "ppm", _PPM * error),)
        case "pose_clock_rate":
            hypotheses = (Hypothesis("clock_rate", "pose", strength, _PPM * value, "ppm", _PPM * error),)
        case "bias" if kind == "rotation":
            hypotheses = (Hypothesis("gyro_bias", "imu", strength, value, "rad/s", error),)
        case "bias":
            hypotheses = (Hypothesis("accel_bias", "imu", strength, value, "m/s^2", error),)
        case "tilt":
            # Another convention, or an exchange of axes, of which a rotation is only a part: specific forces separate
            # these.
            hypotheses = (
                Hypothesis("frame_convention", "imu", strength),
                Hypothesis("axes_swapped", "imu", support("imu.tilt_of_swapped_axes") * strength),
                Hypothesis("frame_convention", "pose", support("imu.tilt_of_poses") * strength),
            )
        case "scale":
            hypotheses = (Hypothesis("unknown", "imu", strength, 100.0 * value, "percent", 100.0 * error),)
        case "gravity":
            sensor, declaration = gravity_likelihoods(gravity_m_s2, value, error)
            of_metadata = support("imu.gravity_of_declaration") * declaration * strength
            hypotheses = (
                Hypothesis("gravity_magnitude", "imu", sensor * strength, value, "m/s^2", error),
                # An excess of the sensor has the effect of a declaration that is too small by the same amount.
                Hypothesis("gravity_magnitude", "metadata", of_metadata, -value, "m/s^2", error),
            )
        case "slope":
            # A world that is not level, or a rotated sensor; both are rarer than a bias, which has the same effect in
            # level flight.
            hypotheses = (
                Hypothesis("frame_convention", "pose", support("imu.slope_of_world") * strength),
                Hypothesis("frame_convention", "imu", support("imu.slope_of_sensor") * strength),
            )
        case "lever":
            # The IMU is displaced from the body's origin, or the point of the poses is, by the opposite vector.
            hypotheses = (
                Hypothesis("lever_arm", "imu", strength, value, "m", error),
                Hypothesis("lever_arm", "pose", strength, -value, "m", error),
            )
    return hypotheses
