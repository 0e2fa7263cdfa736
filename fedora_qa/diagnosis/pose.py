"""Hypotheses for alarms of the checks of the poses."""

from math import sqrt

from fedora_qa.checks.declared_noise import MeasuredNoise
from fedora_qa.checks.pose.continuity import PairedSteps, PoseJump, PoseTransform
from fedora_qa.checks.pose.orientation import RoundedComponents
from fedora_qa.conventions import MM_PER_M
from fedora_qa.diagnosis.features import only_feature
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.motion import axes_cause, defect_hypotheses, noise_hypotheses
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.sample_defects import LinearInterpolation


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
        return (Hypothesis("frozen_frames", "pose", support("pose.repeats_counted"), statistic.value, "samples"),)
    if alarm.finding.code == "pose.continuity.interpolated":
        strength = support("pose.straight_lines_on_grid" if of_timestamps else "pose.straight_lines")
        lines = (feature for feature in statistic.features if isinstance(feature, LinearInterpolation))
        interpolated = (Hypothesis("interpolated_pose", "pose", strength, line.knot_rate_hz, "Hz") for line in lines)
        return (*of_timestamps, *interpolated)

    # Transforms under which there is no jump, and a jump with its return.
    strength = support("pose.transform")
    transforms: list[Hypothesis] = []
    for feature in statistic.features:
        match feature:
            case PoseTransform("length_unit"):
                transforms.append(Hypothesis("unit_mm_m", "pose", strength, MM_PER_M, "1"))
            case PoseTransform("axes", axes):
                transforms.append(Hypothesis(axes_cause(axes), "pose", strength))
            case PoseTransform("component_order"):
                transforms.append(Hypothesis("quaternion_order", "pose", strength))
            case PoseTransform("inverse"):
                transforms.append(Hypothesis("quaternion_inverted", "pose", strength))
            case PoseTransform("north_east_down"):
                transforms.append(Hypothesis("frame_convention", "pose", strength))
            case PairedSteps(length_m, standard_error_m):
                paired = support("pose.paired_steps")
                transforms.append(Hypothesis("lever_arm", "pose", paired, length_m, "m", standard_error_m))
    # A jump that a transform, a lever arm or a repeated pose explains is not a jump of the body itself.
    beside_repeats = any(isinstance(f, PoseJump) and f.beside_repeated_samples for f in statistic.features)
    explained = bool(transforms) or beside_repeats
    repeats = support("pose.jump_at_repeats" if beside_repeats else "pose.jump_without_repeats")
    teleport = support("pose.jump_explained" if explained else "pose.jump")
    # A teleport has a length; a jump of the orientation has none.
    in_metres = statistic.unit == "m"
    return (
        *of_timestamps,
        *transforms,
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
    hypotheses = noise_hypotheses(alarm, "pose", {"unit_mm_m": MM_PER_M})
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
