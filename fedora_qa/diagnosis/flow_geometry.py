"""Hypotheses for flow that deviates from depth and pose, and for flow at pixels or on intervals that have none."""

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.flow_geometry.endpoint import (
    FieldsOff,
    FlowGainFit,
    FlowRatesOff,
    FreeMotionCorrection,
    PoseCorrectionRatios,
)
from fedora_qa.checks.flow_geometry.interval_timestamps import (
    FlowRatesCounted,
    IntervalLengths,
    IntervalOrder,
    IntervalsOffFrames,
    TimestampPattern,
)
from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.diagnosis.designed_cameras import is_chosen
from fedora_qa.diagnosis.flow import (
    DISPLACEMENTS,
    convention_hypotheses,
    frame_period_of,
    gain_hypothesis,
    lengths_of_camera,
    spreads_over,
)
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis, most_probable, only_feature, support, weakened
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz, is_flow_stream
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_comparison import FlowParameterFit, is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial

_EXACT: Final = 0.98
"""Removed share above which an inverse transform is preferred over a fitted error of a parameter."""

_UNRELATED: Final = 0.01
"""Share of the variance of flow that the recomputed flow leaves, from which flow and poses may be of two sequences.
Noise of depth, a tilted camera and a raised scene left 3e-4 and less, depth of another flight 0.05, its poses 0.3 and
more (one file each). The value is not derived."""

_SAME_GAIN: Final = 0.02

_NEARLY_ALL: Final = 0.9
"""Least share of deviating fields for a wrong declaration: it affects all fields, but in some the motion is too
small."""

_IMAGE_STREAMS: Final = ("flow", "depth")
"""Streams whose faults affect a part of the image; faults of poses and cameras affect the whole image."""

_UNCORRECTED: Final = 0.01
"""Share of the expected squared correction below which there is no correction: the flow was generated from the noisy
pose."""

_FIELDS_OF_SINGLE_FRAMES: Final = 3
"""Most fields next to each other that a fault of single frames affects: two exchanged neighbours begin two, and a field
that repeats another is the one behind it."""

_FIELDS_OF_A_JUMP: Final = 2
"""Number of fields of a rate that a jump of the pose and its return affect: those in whose interval they lie."""

_GROWTH_OF_NOISE: Final = 5.4
"""Quantile of 0.999 of the sum of three squares over its expectation: chi^2 of three degrees of freedom, over 3."""

_OF_METADATA: Final = (("metadata", 1), ("flow", -1))
_OF_TIME: Final = (("pose", 1), ("flow", -1))
_STREAMS_OF_PARAMETER: Final = MappingProxyType({
    "intrinsics_focal": _OF_METADATA,
    "intrinsics_centre": _OF_METADATA,
    "extrinsic_rotation": _OF_METADATA,
    "lever_arm": (("metadata", 1), ("pose", 1)),
    "time_offset": _OF_TIME,
    "clock_rate": _OF_TIME,
    "spatial_offset": (("flow", 1),),
})  # fmt: skip
"""Streams in which an error of a parameter has the same effect, with the sign of the fault: a value that is declared
too large has the effect of one that is too small in the flow. The first stream has the larger support."""

_CAUSE_OF_PATTERN: Final = MappingProxyType(
    {"constant": "time_offset", "drift": "clock_rate", "grid": "quantised_time", "unit": "time_unit"}
)
_THOUSANDS: Final = (1e-6, 1e-3, 1e3, 1e6)
_SAME_LENGTH: Final = 0.02


def propose_endpoint(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate of flow against depth and pose, best supported first."""
    statistic = alarm.statistic
    rate = alarm.finding.where.stream or "flow"
    hypotheses = _of_one_rate(rate, statistic.features, facts)
    if alarm.finding.code != "flow_geometry.endpoint.pose_correction":
        return hypotheses
    # Corrections of the poses of one rate are smaller or larger than under the declared noise.
    ratio = statistic.value
    # The statistic is a cube root of squares: its power of 1.5 is a ratio of lengths.
    deviation_percent = 100 * (1 / ratio**1.5 - 1) if ratio else None
    if ratio < statistic.expected:
        ratios = only_feature(statistic.features, PoseCorrectionRatios).of_rate
        uncorrected = {stream: squares < _UNCORRECTED for stream, squares in ratios.items()}
        row = "uncorrected_flow" if uncorrected[rate] else "weakly_corrected_flow"
        from_noisy = support(f"flow_geometry.{row}")
        misdeclared = support("flow_geometry.corrections_beside_noise") - from_noisy / 2
        return (
            Hypothesis("flow_from_noisy_pose", spreads_over(rate, uncorrected), from_noisy),
            Hypothesis("noise_misdeclared", "pose", misdeclared, deviation_percent, "percent"),
        )
    if not hypotheses or hypotheses[0].cause in ("unknown", "noise_misdeclared"):
        misdeclared = support("flow_geometry.corrections_beside_noise")
        return (
            Hypothesis("noise_misdeclared", "pose", misdeclared, deviation_percent, "percent"),
            Hypothesis(ANY_CAUSE, "pose", support("flow_geometry.any_pose_of_corrections")),
            *hypotheses,
        )
    return hypotheses


def _of_one_rate(rate: str, features: Sequence[Feature], facts: Facts) -> tuple[Hypothesis, ...]:
    declared, off = facts.declared, only_feature(features, FlowRatesOff).off
    flow = spreads_over(rate, off)
    extent = only_feature(features, FieldsOff)
    share_off = extent.affected_share
    # Declarations and conventions hold for all fields: where at most half of the fields deviate, single fields are
    # wrong.
    local = share_off <= 0.5
    trials = [feature for feature in features if isinstance(feature, ConventionTrial)]
    # Flow of the same sequence follows the recomputed flow.
    correlation = max((fit.correlation for fit in features if isinstance(fit, FlowGainFit)), default=0.0)
    # So does flow of a part of the motion of the file: of the share of the length that it leaves, the square.
    by_parts = [t.removed_share for t in trials if (t.rate, t.transform) == (rate, "parts_of_motion")]
    follows_parts = float(np.mean(by_parts)) if by_parts else 0.0
    left = min(1.0 - correlation**2, (1.0 - follows_parts) ** 2)
    unrelated = min(left / _UNRELATED, 1.0)
    conventions = [
        replace(hypothesis, support=hypothesis.support * unrelated)
        if hypothesis.cause == "other_sequence"
        else hypothesis
        for hypothesis in convention_hypotheses(
            rate, trials, flow, share_off=share_off, lasts=_lasts(rate, extent, facts)
        )
    ]
    # Flow may as well be made with a camera that is turned against the declared one, the other way round.
    of_flow = support("flow_geometry.second_stream_of_a_parameter")
    conventions += [
        replace(h, stream=flow, support=of_flow * h.support, magnitude=None if h.magnitude is None else -h.magnitude)
        for h in conventions
        if (h.cause, h.stream) == ("extrinsic_rotation", "metadata")
    ]
    # Fields that repeat another, or that begin at depth that does, deviate for that reason, unless a transform gives
    # them exactly: the field of a lower rate repeats as well.
    repeated = (extent.repeats_of_flow + extent.repeats_of_depth) / max(extent.count, 1)
    if max((hypothesis.support for hypothesis in conventions), default=0.0) < _EXACT:
        conventions = weakened(conventions, max(1 - repeated, 0.0))
    for stream, repeats in ((flow, extent.repeats_of_flow), ("depth", extent.repeats_of_depth)):
        if repeats:
            of_repeats = 1.0 if local else support("flow_geometry.repeats_of_most_off")
            frozen = of_repeats * repeats / extent.count  # fields that repeat no other field deviate as well
            conventions.append(Hypothesis("frozen_frames", stream, frozen, float(repeats), "samples"))
    # Causes of a fitted gain, and of a fitted error of a parameter.
    parameters: list[Hypothesis] = []
    for fit in features:
        if isinstance(fit, FlowGainFit):
            share, error = fit.removed_share * fit.correlation, fit.standard_error
            parameters.append(
                gain_hypothesis(
                    flow,
                    fit.gain,
                    error,
                    share,
                    fit.interval_s,
                    _SAME_GAIN,
                    frame_period_of(facts, off),
                    lengths_of_camera(facts),
                )
            )
        elif isinstance(fit, FlowParameterFit):
            share = fit.removed_share
            if fit.parameter == "spatial_offset":
                share, conventions = _of_shift(fit, conventions, flow)
            for stream, sign in _STREAMS_OF_PARAMETER[fit.parameter]:
                named_stream, size = flow if stream == "flow" else stream, sign * fit.value
                parameters.append(Hypothesis(fit.parameter, named_stream, share, size, fit.unit, fit.standard_error))
                share = support("flow_geometry.second_stream_of_a_parameter") * fit.removed_share
    # Cameras and poses are common to all pixels: a part of the image is wrong in an image stream only.
    if extent.in_part:
        conventions = [hypothesis for hypothesis in conventions if hypothesis.cause != "other_sequence"]
        parameters = [hypothesis for hypothesis in parameters if hypothesis.stream in (*_IMAGE_STREAMS, flow)]
    # A declaration is rarely wrong where its numbers are round, or where only some fields deviate.
    trusted = support("flow_geometry.trusted_declaration")
    parameters = [
        replace(hypothesis, support=hypothesis.support * trusted)
        if hypothesis.stream == "metadata"
        and (is_chosen(declared.cameras["depth"], hypothesis.cause) or share_off < _NEARLY_ALL)
        else hypothesis
        for hypothesis in parameters
    ]
    # A gain is a fitted number like the parameters, not an exact transform: it does not reduce their support.
    if max((hypothesis.support for hypothesis in conventions if hypothesis.cause != "flow_gain"), default=0) > _EXACT:
        parameters = weakened(parameters, support("flow_geometry.fit_beside_exact_transform"))
    correction = next((feature for feature in features if isinstance(feature, FreeMotionCorrection)), None)
    poses: list[Hypothesis] = []
    foreign: tuple[Hypothesis, ...] = ()
    if correction is not None and not is_noisy(declared.pose) and not extent.in_part:
        poses = _of_the_poses(correction, extent.count, flow, local=local, unrelated=unrelated)
        best = max((hypothesis.support for hypothesis in conventions), default=0.0)
        if local and max(best, correction.removed_share, follows_parts) < _EXACT:
            # Neither a transform of the fields nor another motion through the depth of the file gives them: each leaves
            # nothing but rounding where it is the cause.
            for_a_while = support("flow_geometry.another_sequence_for_a_while")
            foreign = (Hypothesis("other_sequence", flow, for_a_while),)
    any_pose = tuple(hypothesis for hypothesis in poses if hypothesis.cause == ANY_CAUSE)
    named_poses = (hypothesis for hypothesis in poses if hypothesis.cause != ANY_CAUSE)
    named = most_probable([*conventions, *parameters, *named_poses])
    return ((*named, *foreign) or (Hypothesis("unknown", flow, support("flow_geometry.unknown")),)) + any_pose


def _lasts(rate: str, extent: FieldsOff, facts: Facts) -> bool:
    """Whether the fields that deviate follow each other, and are more than exchanged neighbours affect."""
    if extent.count <= _FIELDS_OF_SINGLE_FRAMES or rate not in facts.clocks:
        return False
    times_ns = facts.clocks[rate].times_ns
    between = int(np.count_nonzero((times_ns >= extent.first_ns) & (times_ns <= extent.last_ns)))
    return between == extent.count < len(times_ns)


def _of_shift(fit: FlowParameterFit, conventions: list[Hypothesis], flow: str) -> tuple[float, list[Hypothesis]]:
    """Return the support of a fitted shift, and the conventions without shifts by whole pixels that it replaces."""
    whole = [h for h in conventions if (h.cause, h.stream) == (fit.parameter, flow)]
    replaced = [h for h in whole if fit.smooth_share >= min(h.support, _EXACT)]
    supports = [
        support("flow_geometry.fitted_shift") * fit.removed_share,
        support("flow_geometry.fitted_shift_of_surfaces") * fit.smooth_share,
        *(h.support for h in replaced),
    ]
    return max(supports), [h for h in conventions if h not in replaced]


def _of_the_poses(
    correction: FreeMotionCorrection, fields_off: int, flow: str, *, local: bool, unrelated: float
) -> list[Hypothesis]:
    """Return the causes for which a rigid correction makes the fields agree, with ``ANY_CAUSE`` of the pose last.

    Where few fields deviate, single poses are wrong. Where most deviate, the cause is undeclared noise, or poses or
    flow of another sequence; the growth of the corrections separates these.
    """
    share, noise = correction.removed_share, noise_likeness(correction.growth)
    if local:
        # A jump affects two fields of a rate: the more fields deviate, the smaller the share that it explains.
        in_a_jump = min(_FIELDS_OF_A_JUMP / fields_off, 1.0)
        teleport = support("flow_geometry.jump_of_the_pose") * share * in_a_jump
        hypotheses = [Hypothesis("teleport", "pose", teleport, correction.shift_m, "m"),
                      Hypothesis("frozen_frames", "pose", support("flow_geometry.frozen_poses") * share)]  # fmt: skip
        any_pose = support("flow_geometry.any_pose")
    else:
        other = support("flow_geometry.another_sequence") * (1.0 - noise) * share * unrelated
        misdeclared = support("flow_geometry.undeclared_noise") * noise * share
        hypotheses = [Hypothesis("noise_misdeclared", "pose", misdeclared),
                      *(Hypothesis("other_sequence", stream, other) for stream in ("pose", flow))]  # fmt: skip
        any_pose = support("flow_geometry.any_pose") * max(noise, support("flow_geometry.any_pose_without_noise"))
    best = max(hypothesis.support for hypothesis in hypotheses)
    return [*hypotheses, Hypothesis(ANY_CAUSE, "pose", any_pose * best)]


def noise_likeness(growth: float) -> float:
    """Return the agreement of corrections with pose noise, 0 to 1, from the growth of their sum."""
    # 5.4 = chi2_3^-1(0.999) / 3: the growth of independent corrections stays below, that of another motion exceeds it.
    return min(1.0, _GROWTH_OF_NOISE / max(growth, 1.0))


def propose_validity(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for wrong pixels, or for wrong intervals of one rate."""
    features = alarm.statistic.features
    values = next((feature for feature in features if isinstance(feature, WrongFlowValues)), None)
    if values is not None:
        flow = spreads_over(
            alarm.finding.where.stream or "flow", {stream: stream in values.streams for stream in facts.flow_streams}
        )
        rule = alarm.finding.code.rpartition(".")[2]
        encoding_of_depth = support("flow_geometry.encoding_of_depth")
        causes: tuple[tuple[str, str, float], ...]
        if rule == "infinite":
            causes = (("invalid_encoding", "flow", support("flow_geometry.infinite_flow")),)
        elif values.unfounded and values.missing:  # values without depth, and depth without values
            causes = DISPLACEMENTS
        elif rule == "missing" and values.missing_with_depth:
            causes = (("invalid_encoding", "depth", support("flow_geometry.missing_with_depth")),
                      ("nan_in_stream", "flow", encoding_of_depth))  # fmt: skip
        elif rule == "missing":
            causes = (("nan_in_stream", "flow", support("flow_geometry.missing_flow")),
                      ("invalid_encoding", "depth", encoding_of_depth))  # fmt: skip
        # More than half of the unfounded values belong to points behind the camera: the motion exceeds the depth.
        elif 2 * values.behind > values.unfounded:
            blamed = "pose" if values.deep else "depth"
            causes = (("unit_mm_m", blamed, support("flow_geometry.points_behind_camera")),
                      (ANY_CAUSE, blamed, support("flow_geometry.any_fault_behind_camera")))  # fmt: skip
        else:
            causes = (("invalid_encoding", "flow", support("flow_geometry.encoding_of_flow")),
                      ("invalid_encoding", "depth", encoding_of_depth))  # fmt: skip
            if 2 * values.fills <= values.unfounded:  # flow that varies, so it was generated from a depth
                factor = support("flow_geometry.encoding_of_varied_flow")
                causes = (("nan_in_stream", "depth", support("flow_geometry.lost_depth")),
                          *((cause, stream, factor * weight) for cause, stream, weight in causes))  # fmt: skip
        return tuple(
            Hypothesis(cause, flow if stream == "flow" else stream, weight) for cause, stream, weight in causes
        )
    counted = next((feature for feature in features if isinstance(feature, FlowRatesCounted)), None)
    if counted is None:
        return ()
    hypotheses = _of_the_intervals(alarm.finding.where.stream or "flow", features, facts)
    if not all(counted.counted.values()):
        return hypotheses
    # Every rate has such intervals: one fault of the flow as a whole.
    return tuple(replace(h, stream="flow") if stream_family(h.stream) == "flow" else h for h in hypotheses)


def _of_the_intervals(stream: str, features: Sequence[Feature], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of moved timestamps, after those of missing, doubled, exchanged or wrongly long intervals."""
    # Pattern of the differences of timestamps from frames; colour frames decide which stream deviates.
    of_frames: list[Hypothesis] = []
    relation = next((feature for feature in features if isinstance(feature, IntervalsOffFrames)), None)
    if relation is not None and relation.beyond_all_frames:
        of_frames = [
            Hypothesis("truncated", "depth", support("flow_geometry.depth_ends_early")),
            Hypothesis("time_offset", stream, support("flow_geometry.offset_beyond_frames")),
        ]
    elif relation is not None:
        if relation.at_missing_frame:
            of_frames.append(Hypothesis("dropped_samples", "depth", support("flow_geometry.frames_missing")))
        # Flow with the timestamps of colour frames is correct. Without them flow is suspected first: it has fewer
        # timestamps.
        flow_is_suspected = not relation.at_missing_frame and not relation.on_colour_frames
        for pattern in features:
            if (
                isinstance(pattern, TimestampPattern)
                and pattern.removed_share > 0
                and not _is_own_beat(pattern, stream)
            ):
                which = "suspected" if flow_is_suspected is (pattern.stream != "depth") else "other"
                weight = support(f"flow_geometry.pattern_of_{which}_stream") * pattern.removed_share
                cause = _CAUSE_OF_PATTERN[pattern.pattern]
                unit = CAUSES[cause].unit
                of_frames.append(Hypothesis(cause, pattern.stream, weight, pattern.magnitude, unit))
    # Missing, doubled, exchanged or wrongly long intervals.
    for feature in features:
        if isinstance(feature, IntervalOrder):
            counts = {
                "dropped_samples": feature.gaps,
                "duplicated_samples": feature.overlaps,
                "unsorted": (feature.moved + 1) // 2,  # an exchange moves two rows
            }
            total, disorder = max(sum(counts.values()), 1), support("flow_geometry.disordered_intervals")
            hypotheses = [
                Hypothesis(of_count, stream, disorder * count / total, float(count), "samples")
                for of_count, count in counts.items()
                if count
            ]
            return (*sorted(hypotheses, key=lambda hypothesis: -hypothesis.support), *of_frames)
        if isinstance(feature, IntervalLengths):
            length_ns = feature.median_ns
            # ``flow/<n>hz`` has intervals of 1 / n s: the name of a stream states the length of its intervals.
            rates_hz = map(flow_rate_hz, facts.flow_streams)
            if any(abs(length_ns - NS_PER_S / rate) < _SAME_LENGTH * length_ns for rate in rates_hz):
                mixed = Hypothesis("flow_rate_mixed", stream, support("flow_geometry.length_of_another_rate"))
                return (mixed, *of_frames)
            # Measured length of an interval over the length that the stream's name states.
            lengths = length_ns * flow_rate_hz(stream) / NS_PER_S
            is_unit = lengths > 0 and any(abs(lengths / factor - 1) < _SAME_LENGTH for factor in _THOUSANDS)
            row = "length_in_another_unit" if is_unit else "length_of_no_unit"
            return (
                Hypothesis("time_unit", stream, support(f"flow_geometry.{row}")),
                *of_frames,
                Hypothesis("dropped_samples", stream, support("flow_geometry.length_beside_missing")),
            )
    return tuple(of_frames)


def _is_own_beat(pattern: TimestampPattern, stream: str) -> bool:
    """Whether a grid of flow is the length of its intervals: those that abut keep to it however late they are."""
    of_flow = pattern.pattern == "grid" and stream_family(pattern.stream) == "flow"
    if not of_flow or not is_flow_stream(stream):
        return False
    return NS_PER_MS * pattern.magnitude > (1.0 - _SAME_LENGTH) * NS_PER_S / flow_rate_hz(stream)
