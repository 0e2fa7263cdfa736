"""Hypotheses for alarms of the checks of poses, and those that IMU and poses share: defects, noise, axes."""

from collections.abc import Iterable, Sequence
from math import sqrt

import numpy as np

from fedora_qa.checks.declared_noise import MeasuredNoise
from fedora_qa.checks.pose.continuity import PairedSteps, PartBetweenJumps, PoseJump, PoseTransform
from fedora_qa.checks.pose.orientation import RoundedComponents
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis import length_units
from fedora_qa.diagnosis.hypothesis import Hypothesis, only_feature, support
from fedora_qa.estimators.imu.conventions import Axes
from fedora_qa.faults.fault import signed_length
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.sample_defects import (
    ComponentNoise,
    ExcessNoise,
    HeldComponent,
    LinearInterpolation,
    LoneSamples,
    NoiseAtTimes,
    RepeatedSamples,
    SampleClockDrift,
    SampleClockGrid,
    SampleClockOffset,
)

SAME_FACTOR = 0.2
"""Largest relative difference of a ratio of noise from the factor of a unit that counts as that unit: noise is measured
to a few percent."""


def defect_hypotheses(features: Sequence[Feature]) -> tuple[Hypothesis, ...]:
    """Return the causes of the defects among the features, in their order."""
    hypotheses: list[Hypothesis] = []
    of_timestamps = support("motion.timestamps")
    for feature in features:
        match feature:
            case SampleClockGrid(stream, period_ns):
                hypotheses.append(Hypothesis("quantised_time", stream, of_timestamps, period_ns / NS_PER_MS, "ms"))
            case SampleClockDrift(stream, drift):
                hypotheses.append(Hypothesis("clock_rate", stream, of_timestamps, 1e6 * drift, "ppm"))
            case SampleClockOffset(stream, offset_ns):
                hypotheses.append(Hypothesis("time_offset", stream, of_timestamps, offset_ns / NS_PER_MS, "ms"))
            case LinearInterpolation(stream, knot_rate_hz):
                strength = support("motion.interpolated_samples")
                hypotheses.append(Hypothesis("interpolated_pose", stream, strength, knot_rate_hz, "Hz"))
            case RepeatedSamples(stream, count):
                strength = support("motion.repeated_samples")
                hypotheses.append(Hypothesis("frozen_frames", stream, strength, float(count), "samples"))
            case HeldComponent(count):
                hypotheses.append(
                    Hypothesis("frozen_frames", "imu", support("motion.held_component"), float(count), "samples")
                )
            case LoneSamples(stream, _, largest_m):
                hypotheses.append(Hypothesis("teleport", stream, support("motion.lone_samples"), largest_m, "m"))
            case NoiseAtTimes(stream):
                hypotheses.append(Hypothesis("teleport", stream, support("motion.noise_at_times")))
            case ComponentNoise(stream):
                strength = support("motion.noise_of_components")
                hypotheses.append(Hypothesis("quaternion_not_unit", stream, strength))
            case ExcessNoise(stream):
                hypotheses.append(Hypothesis("noise_misdeclared", stream, support("motion.excess_noise")))
    return tuple(hypotheses)


def noise_hypotheses(alarm: Alarm, stream: str, unit_causes: Iterable[tuple[str, float]]) -> tuple[Hypothesis, ...]:
    """Return the causes of noise that differs from its declaration.

    Parameters
    ----------
    alarm
        Of a statistic with a ``MeasuredNoise`` among its features.
    stream
        Of the samples, ``imu`` or ``pose``.
    unit_causes
        Causes that multiply all values, and so the noise, by a factor, with the factor.

    Returns
    -------
    tuple
        Defects of samples first.
    """
    features = alarm.statistic.features
    defects = defect_hypotheses(features)
    noise = only_feature(features, MeasuredNoise)
    misdeclared = support("motion.noise_beside_defects" if defects else "motion.noise_misdeclared")
    other_sequence = Hypothesis("other_sequence", stream, support("motion.noise_of_other_sequence"))
    if not noise.declared > 0:
        return (*defects, Hypothesis("noise_misdeclared", stream, misdeclared, -100.0, "percent"), other_sequence)
    ratio = noise.sigma / noise.declared
    # The declaration is wrong by declared / sigma - 1, whose relative error is that of sigma.
    error = 100.0 * (1.0 / ratio - 1.0) if ratio > 0 else None
    # d(declared / sigma) = declared / sigma^2 d sigma, in percent.
    standard_error = 100.0 * noise.standard_error / noise.sigma / ratio if ratio > 0 else None
    units = (
        Hypothesis(cause, stream, support("motion.noise_of_unit"), factor, "1")
        for cause, factor in unit_causes
        if abs(ratio / factor - 1.0) < SAME_FACTOR
    )
    return (
        *defects,
        *units,
        Hypothesis("noise_misdeclared", stream, misdeclared, error, "percent", standard_error),
        other_sequence,
    )


def axes_cause(axes: Axes) -> str:
    """Return the cause of axes: an exchange of two, or another convention."""
    matrix = np.array(axes)
    # An exchange of two axes has no negative entry and leaves one axis in place: trace 1. A cyclic one has trace 0.
    return "axes_swapped" if np.all(matrix >= 0) and int(np.trace(matrix)) == 1 else "frame_convention"


def propose_orientation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the cause of quaternions that were rounded, do not have unit length, or are not finite."""
    statistic = alarm.statistic
    if alarm.finding.code == "pose.orientation.length":
        # Lengths that err by no more than the step of the components are wrong by that step.
        if abs(statistic.value) <= only_feature(statistic.features, RoundedComponents).length_bound:
            return (Hypothesis("quantised_values", "pose", support("pose.length_by_rounding")),)
        return (Hypothesis("quaternion_not_unit", "pose", support("pose.length"), statistic.value, "1"),)
    return (Hypothesis("nan_in_stream", "pose", support("pose.not_finite"), statistic.value, "samples"),)


def propose_continuity(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a jump, of repeated samples, or of straight lines."""
    statistic = alarm.statistic
    defects = [feature for feature in statistic.features if not isinstance(feature, LinearInterpolation)]
    of_timestamps = defect_hypotheses(defects)
    if alarm.finding.code == "pose.continuity.frozen":
        return (
            Hypothesis("frozen_frames", "pose", support("pose.repeats_counted"), statistic.value, "samples"),
            Hypothesis("quantised_values", "pose", support("pose.repeats_by_steps")),
        )
    if alarm.finding.code == "pose.continuity.interpolated":
        strength = support("pose.straight_lines_on_grid" if of_timestamps else "pose.straight_lines")
        lines = (feature for feature in statistic.features if isinstance(feature, LinearInterpolation))
        interpolated = (Hypothesis("interpolated_pose", "pose", strength, line.knot_rate_hz, "Hz") for line in lines)
        return (*of_timestamps, *interpolated)

    # Transforms under which there is no jump, and a jump with its return.
    strength = support("pose.transform")
    transforms: list[Hypothesis] = []
    parts = [feature for feature in statistic.features if isinstance(feature, PartBetweenJumps)]
    # Out of a part the factor is the reciprocal of that into it.
    ends = bool(parts) and not any(part.begins for part in parts)
    for feature in statistic.features:
        match feature:
            case PoseTransform("length_unit", _, factor):
                if ratio := length_units.ratio_of_units(1 / factor if ends else factor):
                    transforms.append(Hypothesis("unit_mm_m", "pose", strength, ratio, "1"))
            case PoseTransform("axes", axes):
                transforms.append(Hypothesis(axes_cause(axes), "pose", strength))
            case PoseTransform("component_order"):
                transforms.append(Hypothesis("quaternion_order", "pose", strength))
            case PoseTransform("inverse"):
                transforms.append(Hypothesis("quaternion_inverted", "pose", strength))
            case PoseTransform("north_east_down"):
                transforms.append(Hypothesis("frame_convention", "pose", strength))
            case PairedSteps(arm_body_m, standard_error_m):
                length_m, paired = signed_length(arm_body_m), support("pose.paired_steps")
                transforms.append(Hypothesis("lever_arm", "pose", paired, length_m, "m", standard_error_m))
    # A jump that a transform, a lever arm, a repeated pose or a wrong length explains is not a jump of the body itself.
    beside_repeats = any(isinstance(f, PoseJump) and f.beside_repeated_samples for f in statistic.features)
    lengths: tuple[Hypothesis, ...] = ()
    if any(isinstance(f, PoseJump) and f.beside_wrong_lengths for f in statistic.features):
        lengths = (Hypothesis("quaternion_not_unit", "pose", support("pose.jump_at_wrong_lengths")),)
    explained = bool(transforms or lengths) or beside_repeats
    repeats = support("pose.jump_at_repeats" if beside_repeats else "pose.jump_without_repeats")
    teleport = support("pose.jump_explained" if explained else "pose.jump")
    # A teleport has a length; a jump of the orientation has none.
    in_metres = statistic.unit == "m"
    return (
        *of_timestamps,
        *transforms,
        *lengths,
        Hypothesis("frozen_frames", "pose", repeats),
        Hypothesis(
            "teleport",
            "pose",
            teleport,
            statistic.value if in_metres else None,
            "m",
            statistic.standard_error if in_metres else None,
        ),
    )


def propose_noise(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of noise that differs from its declaration.

    Noise of positions may also be due to a lever arm: noise of the orientation moves a point far from the body's
    origin.
    """
    units = [("unit_mm_m", ratio) for ratio in length_units.DECIMAL_RATIOS]
    hypotheses = noise_hypotheses(alarm, "pose", units)
    if alarm.finding.code != "pose.noise.position":
        return hypotheses
    noise = only_feature(alarm.statistic.features, MeasuredNoise)
    rotation_sigma_rad = (facts.declared.pose or PoseModel()).rotation_sigma_rad
    # Independent noises add in squares: what exceeds the declaration is left to the arm.
    excess_m2 = noise.sigma**2 - noise.declared**2
    if excess_m2 <= 0 or rotation_sigma_rad <= 0:
        return hypotheses
    # An arm l swings about two axes and is measured along three: sigma_p^2 = 2/3 (l sigma_r)^2.
    arm_m = sqrt(1.5 * excess_m2) / rotation_sigma_rad
    return (*hypotheses, Hypothesis("lever_arm", "pose", support("pose.swung_noise"), arm_m, "m"))
