"""Hypotheses for declarations that are missing, impossible, or contradict the file."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fedora_qa.checks.metadata.cameras import FocalLengths, PrincipalPoint, RectificationRule, StereoFocalLength
from fedora_qa.checks.metadata.complete import DeclarationDefect
from fedora_qa.checks.metadata.units import UnitLabel
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.declared_intrinsics import (
    hypothesis_of_unit,
    normalised_intrinsics,
    resized_images,
    support_of_resizing,
    transposed,
    transposed_hypothesis,
)
from fedora_qa.diagnosis.declared_mountings import brings_centres_together
from fedora_qa.diagnosis.hypothesis import Hypothesis, only_feature, over_all_rates, support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.sequence.facts import Facts

_CAUSE_OF_UNIT: Final[Mapping[str, str]] = MappingProxyType(
    {"mm": "unit_mm_m", "m": "unit_mm_m", "rad/s": "unit_deg_rad"}
)
"""Cause of values in another unit than this one, by the expected unit."""


def propose_complete(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the cause that a declaration's problem names; without a problem the group of the metadata is missing."""
    for feature in alarm.statistic.features:
        if isinstance(feature, DeclarationDefect):
            problem = feature.problem
            return (Hypothesis(problem.cause, problem.stream, support("metadata.declaration_problem")),)
    return (Hypothesis("missing_stream", "metadata", support("metadata.no_metadata")),)


def propose_units(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the faults of the values that follow from a label if the label is correct."""
    return over_all_rates(alarm.statistic, _of_label)


def _of_label(statistic: Statistic) -> tuple[Hypothesis, ...]:
    hypotheses: list[Hypothesis] = []
    supported = support("metadata.label")
    for label in (feature for feature in statistic.features if isinstance(feature, UnitLabel)):
        stream = statistic.where.stream or ""
        if label.time_factor is not None:
            hypotheses.append(Hypothesis("time_unit", stream, supported, label.time_factor, "1"))
        cause = _CAUSE_OF_UNIT.get(label.expected)
        if label.scale and cause:
            # ``scale`` leads from the labelled to the expected unit: values are too large by its reciprocal.
            hypotheses.append(Hypothesis(cause, stream, supported, 1 / label.scale, "1"))
        if is_flow_stream(stream) and label.label == "px/s":
            hypotheses.append(Hypothesis("flow_unit", stream, supported))
    return tuple(hypotheses)


def propose_cameras(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a declared camera that is impossible or contradicts the images."""
    statistic = alarm.statistic
    match alarm.finding.code.rpartition(".")[2]:
        case "focal_lengths_not_positive":
            wrong = Hypothesis("intrinsics_focal", "metadata", support("metadata.focal_length_not_positive"))
            mirrored = (
                Hypothesis("mirrored", feature.camera, support("metadata.focal_length_negative"))
                for feature in statistic.features
                if isinstance(feature, FocalLengths) and min(feature.fx_px, feature.fy_px) < 0
            )
            return wrong, *mirrored
        case "principal_point_outside":
            distance_px = only_feature(statistic.features, PrincipalPoint).from_centre_px
            outside = Hypothesis("intrinsics_centre", "metadata", support("metadata.centre_outside"), distance_px, "px")
            of_size = (
                Hypothesis("intrinsics_focal", "metadata", support_of_resizing(facts, fault.camera), fault.magnitude,
                           "percent")
                for fault in resized_images(facts)
            )  # fmt: skip
            return *of_size, outside
        case "size":
            return (Hypothesis("wrong_shape", "metadata", support("metadata.size_of_camera")),)
        case "T_body_camera_rigid" | "T_body_camera_handedness" as rule:
            name = "metadata.not_rigid" if rule == "T_body_camera_rigid" else "metadata.mirrors"
            return (Hypothesis("frame_convention", "metadata", support(name)),)
        case "depth_to_events_centre":
            return (_of_centres_apart(statistic, facts),)
        case "disparity_focal" | "disparity_baseline":
            return (_of_stereo(statistic),)
        case "rectify_map" | "rectify_map_defined":
            return (_of_rectify_map(statistic),)
    return (_of_form(facts),)


def _of_form(facts: Facts) -> Hypothesis:
    """Return the cause of a K that is not [fx 0 cx; 0 fy cy; 0 0 1]."""
    if transposed(facts).magnitude:
        return transposed_hypothesis(facts)
    if of_units := normalised_intrinsics(facts):
        return hypothesis_of_unit(of_units[0])
    return Hypothesis("unknown", "metadata", support("metadata.form_of_K"))


def _of_stereo(statistic: Statistic) -> Hypothesis:
    """Return the cause of a matrix of disparity that contradicts the declared cameras."""
    for feature in statistic.features:
        if isinstance(feature, StereoFocalLength):
            supported = support("metadata.disparity_focal")
            return Hypothesis("intrinsics_focal", "metadata", supported, feature.longer_percent, "percent")
    return Hypothesis("unknown", "metadata", support("metadata.disparity_baseline"))


def _of_centres_apart(statistic: Statistic, facts: Facts) -> Hypothesis:
    """Return a mounting that brings the centres of depth and events together once it is inverted; else a wrong arm."""
    if brings_centres_together(facts):
        return Hypothesis("frame_convention", "metadata", support("metadata.inverted_mounting"))
    return Hypothesis("lever_arm", "metadata", support("metadata.centres_apart"), statistic.value, "m")


def _of_rectify_map(statistic: Statistic) -> Hypothesis:
    """Return the cause of the rule that gives the entries of a map that rectifies events."""
    rules = {feature.rule for feature in statistic.features if isinstance(feature, RectificationRule)}
    if rules & {"exchanged_coordinates", "exchanged_pixels"}:
        return Hypothesis("axes_swapped", "metadata", support("metadata.map_axes"))
    # Another pinhole camera, or none that fits: the declared cameras may be those that are wrong.
    name = "metadata.map_by_common_error" if rules - {"other_pinhole", "none"} else "metadata.map_of_other_cameras"
    return Hypothesis("rectification_misdeclared", "metadata", support(name))


def propose_profile(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of a file that differs from its declared profile."""
    stream = alarm.finding.where.stream or ""
    wrong_profile = Hypothesis("unknown", "metadata", support("metadata.wrong_profile"))
    match alarm.finding.code.rpartition(".")[2]:
        case "stream":
            return (Hypothesis("missing_stream", stream, support("metadata.promised_stream")),)
        case "width" | "height":
            return (Hypothesis("wrong_shape", "metadata", support("metadata.other_size_than_paper")),)
        case "field_of_view":
            return (Hypothesis("intrinsics_focal", "metadata", support("metadata.other_view_than_paper")),)
        case "period":
            return (Hypothesis("clock_rate", stream, support("metadata.other_period_than_paper")),)
        case "model":
            other_model = support("metadata.other_model_than_paper")
            return Hypothesis("event_model_misdeclared", "events", other_model), wrong_profile
        case "threshold_on" | "threshold_off":
            return (Hypothesis("threshold_misdeclared", "events", support("metadata.other_threshold_than_paper")),)
    return (wrong_profile,)
