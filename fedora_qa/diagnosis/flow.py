"""Hypotheses for flow against events, between its rates and against frames; and what all checks of flow share."""

from collections.abc import Mapping, Sequence
from math import log2
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.flow_events.sharpness import SharpestFlow
from fedora_qa.checks.flow_photometric.rate_statistics import RateResidual, TemplateExplanation
from fedora_qa.checks.flow_rates.composition import COPIES, RatePairsOff
from fedora_qa.conventions import MS_PER_S
from fedora_qa.diagnosis.hypothesis import Hypothesis, most_probable, support, support_of_extent, weakened
from fedora_qa.diagnosis.measured_sizes import MS_PER_PERCENT_OF_S
from fedora_qa.faults.units import LENGTHS, frame_period_s, length_of_flow_px
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial

CAUSES_OF_TRANSFORM: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({
    "negated": ("flow_sign",),
    "transposed_axes": ("axes_swapped",),
    "flipped_v": ("frame_convention",),
    "flipped_u": ("frame_convention",),
    "quarter_turn": ("frame_convention",),
    "quarter_turn_back": ("frame_convention",),
    "negated_transposed_axes": ("frame_convention",),
    "north_east_down": ("frame_convention",),
    "other_mounting": ("frame_convention",),
    "turned_mounting": ("extrinsic_rotation",),
    "another_unit": ("flow_unit",),
    "scaled": ("flow_gain",),
    "scaled_by_axis": ("flow_gain",),
    # Flow of the turning or of the way alone, or of each by another factor, has no cause of the list.
    "parts_of_motion": (),
    "shifted_pixels": ("spatial_offset",),
    "rescaled_by_interval": ("flow_unit",),
    "times_interval": ("flow_unit",),
    "times_milliseconds": ("flow_unit",),
    "divided_by_interval": ("flow_unit",),
    "mirrored_columns": ("mirrored",),
    "mirrored_rows": ("mirrored",),
    "neighbouring_interval": ("flow_interval_shifted", "swapped_frames"),
    "shifted_interval": ("flow_interval_shifted",),
    "neighbouring_frame": ("swapped_frames",),
    "delayed": ("time_offset",),
    "field_of_another_rate": ("flow_rate_mixed",),
    "exchanged_frames": ("swapped_frames",),
    "repeated_field": ("frozen_frames",),
    "repeated_frame": ("frozen_frames",),
    "ray_lengths": ("depth_ray_not_z",),
    "metric_unit": ("unit_mm_m",),
    # A part of the image that moves as the poses with their noise do, while the rest moves as without it.
    "as_posed": ("flow_from_noisy_pose",),
    "triangulated_depth": ("other_sequence",),
    "conjugated_quaternion": ("quaternion_inverted",),
    "reordered_quaternion": ("quaternion_order",),
})  # fmt: skip
"""Causes that a transform of flow, frames, depth or poses would undo, for all checks of flow.

A transform without a row has the name of its cause ("mirrored").
"""

CAUSES_OF_TWO_TRANSFORMS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {f"{name}_in_another_unit": ("flow_unit", *CAUSES_OF_TRANSFORM[name]) for name in FLOW_AXES}
)
"""Causes that are there together where one transform after the other removes the deviation; the first has the size."""

_SUPPORT_OF_TRANSFORM: Final = MappingProxyType({"triangulated_depth": support("flow.triangulated_depth")})
"""Factor on the removed share; 1 for transforms without a row."""

_APART: Final = frozenset({*FLOW_AXES, "times_milliseconds"})
"""Transforms of which another one of the same cause removes little."""

_UNSIGNED: Final = ("swapped_frames",)
"""Causes whose size is a distance without a sign."""

_OF_DISPLACED_FLOW: Final = (
    "flow_interval_shifted", "flow_rate_mixed", "mirrored", "spatial_offset", "frozen_frames", "swapped_frames",
    "time_offset", "other_sequence",
)  # fmt: skip
_OF_DISPLACED_DEPTH: Final = (
    "mirrored", "spatial_offset", "frozen_frames", "swapped_frames", "time_offset", "other_sequence",
)  # fmt: skip
DISPLACEMENTS: Final = (
    *((cause, "flow", support("flow.displacement")) for cause in _OF_DISPLACED_FLOW),
    *((cause, "depth", support("flow.displacement")) for cause in _OF_DISPLACED_DEPTH),
)
"""Causes that displace flow against depth: cause, stream, and a small support that adds to stronger evidence."""

_SHARPNESS_GAIN_TOLERANCE: Final = 0.1
"""Largest relative difference of a gain from a sign or a unit that counts as such."""

_CAUSES_BETWEEN_RATES: Final = (
    "flow_gain", "flow_unit", "flow_sign", "flow_interval_shifted", "flow_rate_mixed", "axes_swapped",
    "frame_convention", "mirrored", "spatial_offset", "swapped_frames", "frozen_frames", "other_sequence",
    "time_offset", "intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "nan_in_stream", "clock_rate",
    "time_unit", "unsorted", "duplicated_samples",
)  # fmt: skip
"""Causes of a deviation between rates, also those whose inverse transform was not tried."""

_EXCHANGED: Final = 0.25
"""Share of the fields that are late, and of those that are early, from which frames next to each other are exchanged:
half of all are late then. The value is not derived."""

_FEWEST_FRACTIONS: Final = 64.0
"""Least number of fractions of a pixel in codes of flow: KITTI has 64 and DSEC 128. The value is not derived."""

_SAME_PERIOD: Final = 0.02
"""Largest relative difference of two periods that count as equal: rates of flow are further apart."""

_RESIDUAL_GAIN_TOLERANCE: Final = 0.1
"""Largest relative difference, near the capture range, of a gain from a sign or a unit that counts as such."""

_FEW_FIELDS: Final = 0.5
"""Largest share of deviating fields for a fault of single frames."""

_LARGEST_SHIFT_PX: Final = 10.0
"""Largest shift, px, for which the slopes of a flow predict its values."""

_LINEAR: Final = 1 / 3
"""Share of the largest size of a fault up to which tiles, with a capture range of 3 to 4 px, follow its template."""

_FAULT_OF_TEMPLATE: Final = MappingProxyType({
    "focal": ("intrinsics_focal", "percent", 30.0),
    "centre": ("intrinsics_centre", "px", 100.0),
    "mounting": ("extrinsic_rotation", "deg", 15.0),
    "time": ("time_offset", "ms", 50.0),
})  # fmt: skip
"""Cause, unit and largest size; beyond it the template, a derivative, does not apply."""

_NEARLY_ALL: Final = 0.9
"""Least share of the squared residuals that a template of one number explains for it to apply at any size. The value is
not derived: of flow that was made 54 and 71 ms late it explained 0.61 to 0.98, least at the longest intervals."""

_DISPLACED_AGAINST_FRAMES: Final = tuple(
    (cause, stream)
    for stream, causes in (
        ("flow", ("flow_gain", "flow_unit", "flow_sign", "flow_interval_shifted", "flow_rate_mixed", "axes_swapped",
                  "frame_convention", "mirrored", "spatial_offset", "swapped_frames", "frozen_frames",
                  "time_offset", "other_sequence")),
        ("rgb", ("mirrored", "spatial_offset", "time_offset", "swapped_frames", "frozen_frames", "other_sequence")),
    )
    for cause in causes
)  # fmt: skip
"""Causes that displace the flow against the frames: cause and stream."""


def spreads_over(stream: str, off: Mapping[str, bool]) -> str:
    """Return ``flow`` where every rate deviates, otherwise the one rate: an equal deviation of all rates is one fault.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``, the rate of the alarm.
    off
        Whether each rate deviates, by stream.
    """
    return "flow" if all(off.values()) else stream


def convention_hypotheses(
    rate: str, trials: Sequence[ConventionTrial], flow: str, *, share_off: float, lasts: bool = False
) -> list[Hypothesis]:
    """Return the mean removed share of each inverse transform, over the fields of one rate on which it was tried.

    Parameters
    ----------
    rate
        Only trials of this rate count.
    trials
        Of any rates.
    flow
        Stream that is named for trials of the flow: ``flow`` or one rate.
    share_off
        Share of fields that deviate, 0 to 1. Faults of single frames affect few fields, other faults most.
    lasts
        As of ``support_of_extent``.

    Returns
    -------
    list[Hypothesis]
        One for each cause and stream, in the order of the trials.
    """
    by_transform: dict[tuple[str, str, str], list[ConventionTrial]] = {}
    for trial in trials:
        if trial.rate == rate:
            together = CAUSES_OF_TWO_TRANSFORMS.get(trial.transform)
            for cause in together or CAUSES_OF_TRANSFORM.get(trial.transform, (trial.transform,)):
                alone = together or trial.transform in _APART
                by_transform.setdefault((cause, trial.stream, trial.transform if alone else ""), []).append(trial)
    hypotheses: dict[tuple[str, str], Hypothesis] = {}
    for (cause, stream, _), group in by_transform.items():
        supports = [_SUPPORT_OF_TRANSFORM.get(trial.transform, 1.0) * trial.removed_share for trial in group]
        mean_support = float(np.mean(supports))
        share_of_either_sign = _share_of_either_sign(by_transform.get(("time_offset", stream, ""), ()))
        if cause == "time_offset":
            # A clock is late or early: fields that are late beside others that are early have no common offset.
            mean_support *= 1.0 - 2.0 * share_of_either_sign
        if cause != "swapped_frames" or share_of_either_sign <= _EXCHANGED:
            mean_support *= support_of_extent(cause, share_off, lasts=lasts)
        # The size comes from the field that the transform explains best: in other fields another fault may contribute.
        magnitude = max(zip(supports, group, strict=True), key=lambda pair: pair[0])[1].magnitude
        if magnitude is not None and cause in _UNSIGNED:
            magnitude = abs(magnitude)
        # A transform without a row raises ``KeyError`` here, unless it is named as a cause.
        unit = CAUSES[cause].unit
        size = magnitude if unit else None
        blamed = flow if stream == "flow" else stream
        hypothesis = Hypothesis(cause, blamed, mean_support, size, "" if size is None else unit)
        # Alone, or beside a second cause: by the transform that removes most.
        if (cause, stream) not in hypotheses or mean_support > hypotheses[cause, stream].support:
            hypotheses[cause, stream] = hypothesis
    return list(hypotheses.values())


def _share_of_either_sign(trials: Sequence[ConventionTrial]) -> float:
    """Return the smaller share of the offsets of single fields that are late, or early; 0 to 1/2."""
    signs = [trial.magnitude > 0 for trial in trials if trial.magnitude]
    return min(signs.count(True), signs.count(False)) / len(signs) if signs else 0.0


def gain_hypothesis(
    flow: str,
    gain: float,
    error: float | None,
    removed_share: float,
    seconds: float,
    tolerance: float,
    frame_s: float = 0.0,
    lengths_px: Sequence[tuple[float, float]] = (),
) -> Hypothesis:
    """Return the cause of a gain of the flow: another sign, another unit of time or length, or a gain.

    A gain of -2 is the opposite sign. A factor equal to the length of the interval, or to its reciprocal, is another
    unit. So is a period of the frames over the length of the interval: the motion per frame, of which flow from frame
    to frame is correct. A factor equal to the reciprocal of a focal length, or of a size of the image, is that unit of
    length. A power of two of 64 or more, or 1000, is the number of fractions of a pixel in codes that were
    not divided by it: no gain is as large. The opposite sign beside a unit, and a gain beside the opposite sign, show
    once the first is undone.

    Parameters
    ----------
    flow
        Stream that is named.
    gain
        Excess of the factor over 1 (0.1 for vectors that are 10% too long).
    error
        Standard error of ``gain``; None where it is not known.
    removed_share
        Share of the deviation that the gain explains, 0 to 1. It becomes the support.
    seconds
        Length of the interval, s.
    tolerance
        Largest relative difference from a unit that counts as such.
    frame_s
        Period of the colour frames, s, where no flow from frame to frame deviates; else 0.
    lengths_px
        Lengths of the camera that are units of flow, px, along columns and along rows (``lengths_of_camera``).

    Returns
    -------
    Hypothesis
        ``flow_sign``, ``flow_unit``, or ``flow_gain`` with its size in percent.
    """
    factor = 1 + gain
    # A field in px/s is that in px times 1 / seconds, one in px s is that times seconds, and one in px/ms is that times
    # 1 / milliseconds, which is no other unit where the interval is a millisecond.
    per_ms = (1 / (MS_PER_S * seconds),) if seconds > 0 and abs(MS_PER_S * seconds - 1) > tolerance else ()
    for unit_factor in (seconds, 1 / seconds, *per_ms) if seconds > 0 else ():
        if abs(abs(factor) / unit_factor - 1) < tolerance:
            return Hypothesis("flow_unit", flow, removed_share, unit_factor, "1")
    # Motion per frame is that of every rate at once, of which the one from frame to frame does not show it.
    if 0 < frame_s < (1 - tolerance) * seconds and abs(abs(factor) * seconds / frame_s - 1) < tolerance:
        return Hypothesis("flow_unit", stream_family(flow), removed_share, frame_s / seconds, "1")
    if fractions := fractions_of_px(factor, tolerance):
        return Hypothesis("flow_unit", flow, removed_share, fractions, "1")
    # Of unequal lengths along both axes the factor that fits both lies between.
    if any(1 - tolerance < abs(factor) * max(pair) and abs(factor) * min(pair) < 1 + tolerance for pair in lengths_px):
        return Hypothesis("flow_unit", flow, removed_share, abs(factor), "1")
    # The opposite sign, and maybe a gain besides: between -3 and -1 / 3 the sign leaves |1 - |factor||, which is less
    # than half of 1 + |factor|.
    if -3 < factor < -1 / 3:
        return Hypothesis("flow_sign", flow, removed_share)
    return Hypothesis("flow_gain", flow, removed_share, 100 * gain, "percent", None if error is None else 100 * error)


def fractions_of_px(factor: float, tolerance: float) -> float:
    """Return the number of fractions of a pixel in which codes of flow count, by the gain of a flow; 0 for a gain."""
    if not _FEWEST_FRACTIONS * (1 - tolerance) < abs(factor) < np.inf:
        return 0.0
    size = abs(factor)
    nearest = min(2.0 ** round(log2(size)), 1000.0, key=lambda fractions: abs(size - fractions))
    return nearest if abs(size / nearest - 1) < tolerance else 0.0


def lengths_of_camera(facts: Facts) -> tuple[tuple[float, float], ...]:
    """Return the lengths of the depth camera that are units of flow, px, along columns and along rows."""
    lengths_px = (length_of_flow_px(facts, unit) for unit in LENGTHS)
    return tuple((pair[0], abs(pair[1])) for pair in lengths_px if pair is not None)


def frame_period_of(facts: Facts, off: Mapping[str, bool]) -> float:
    """Return the period of the colour frames, s; 0 where flow from frame to frame deviates, or none is left."""
    period_s = frame_period_s(facts)
    if not period_s:
        return 0.0
    is_off = [deviates for stream, deviates in off.items() if abs(flow_rate_hz(stream) * period_s - 1) < _SAME_PERIOD]
    return 0.0 if any(is_off) else period_s


def propose_sharpness(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate against the events, best supported first."""
    (sharpest,) = (feature for feature in alarm.statistic.features if isinstance(feature, SharpestFlow))
    flow = spreads_over(sharpest.rate, sharpest.deviates_by_rate)
    interval_s = sharpest.interval_s
    if alarm.finding.code == "flow_events.sharpness.other":
        # Values in px/s are too large by the reciprocal of the interval, values in px s by the interval.
        size = {"times_interval": 1 / interval_s, "divided_by_interval": interval_s}.get(sharpest.transform)
        (cause,) = CAUSES_OF_TRANSFORM[sharpest.transform]
        return (Hypothesis(cause, flow, support("flow_events.other_flow"), size, "1" if size else ""),)
    # From percent to a share. The sign of the model error is unknown, so its bound adds to the error.
    error = 0.01 * (alarm.statistic.standard_error + alarm.statistic.model_error_bound)
    return (
        gain_hypothesis(
            flow,
            sharpest.gain - 1,
            error,
            support("flow_events.gain"),
            interval_s,
            _SHARPNESS_GAIN_TOLERANCE,
            frame_period_of(facts, sharpest.deviates_by_rate),
            lengths_of_camera(facts),
        ),
        Hypothesis("intrinsics_focal", flow, support("flow_events.focal_length")),
        Hypothesis("flow_rate_mixed", flow, support("flow_events.rate_mixed")),
    )


def propose_composition(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one pair of rates, best supported first."""
    rates_off = next((feature for feature in alarm.statistic.features if isinstance(feature, RatePairsOff)), None)
    if rates_off is None or not rates_off.shares_off[rates_off.pair]:
        return ()
    pair, shares_off = rates_off.pair, rates_off.shares_off
    trials = [feature for feature in alarm.statistic.features if isinstance(feature, ConventionTrial)]
    # A copy is equal bit for bit in every trial, so its removed share is exactly 1: no tolerance.
    shares: dict[tuple[str, str], list[float]] = {}
    for trial in trials:
        if trial.transform in COPIES:
            shares.setdefault((trial.stream, trial.transform), []).append(trial.removed_share)
    copied = {stream for (stream, _), of_transform in shares.items() if min(of_transform) == 1.0}
    # Transforms with nearly the effect of a copy are then not named.
    trials = [trial for trial in trials if trial.stream not in copied or trial.transform in COPIES]
    hypotheses: list[Hypothesis] = []
    # A deviation between two rates does not determine which one is wrong; a rate that agrees with a third is rarely
    # wrong.
    agrees = {rate: any(rate in another and not share for another, share in shares_off.items()) for rate in pair}
    for rate, other in (pair, pair[::-1]):
        if agrees[rate]:
            factor = support("flow_rates.agrees_with_third")
        else:
            factor = 1.0 if agrees[other] else support("flow_rates.either_of_two")
        hypotheses += weakened(convention_hypotheses(rate, trials, rate, share_off=shares_off[pair]), factor)
    all_off = all(shares_off.values())
    if all_off:
        hypotheses += convention_hypotheses("flow", trials, "flow", share_off=shares_off[pair])
        mixed = {
            trial.stream for trial in trials if trial.transform == "field_of_another_rate" and trial.removed_share > 0
        }
        if len(mixed) > 2:  # of two rates that are exchanged only one holds fields of the other's
            hypotheses.append(Hypothesis("flow_rate_mixed", "flow", support("flow_rates.every_rate_mixed")))
    named = most_probable(hypotheses)
    already_named = {(hypothesis.cause, hypothesis.stream) for hypothesis in named}
    weak = support("flow_rates.any_disagreement")
    return named + tuple(
        Hypothesis(cause, stream, weak)
        for stream in (("flow", *pair) if all_off else pair)
        for cause in _CAUSES_BETWEEN_RATES
        if (cause, stream) not in already_named
    )


def propose_residual(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate against the frames, best supported first."""
    features = alarm.statistic.features
    (rate,) = (feature for feature in features if isinstance(feature, RateResidual))
    flow = spreads_over(rate.rate, rate.deviates_by_rate)
    by_templates = _template_hypotheses(
        rate,
        {feature.template: feature for feature in features if isinstance(feature, TemplateExplanation)},
        flow,
        facts,
    )
    if not rate.deviating_fields:
        unknown = Hypothesis("unknown", flow, support("flow_photometric.unknown"))
        return most_probable(by_templates) or (unknown,)
    # Faults of single frames do not cause one gain in most fields.
    deviating_share = 1.0 if rate.has_common_gain else rate.deviating_fields / rate.fields
    trials = [feature for feature in features if isinstance(feature, ConventionTrial)]
    by_trials = convention_hypotheses(rate.rate, trials, flow, share_off=deviating_share)
    if deviating_share <= _FEW_FIELDS:
        factor = support("flow_photometric.templates_of_few_fields")
    else:
        factor = support("flow_photometric.templates_of_most_fields") * (1 - rate.unmatched_share)
    by_templates = weakened(by_templates, factor)
    noise = facts.declared.pose
    if noise and is_noisy(noise):
        # Noise affects all fields equally; exchanged frames affect few.
        noisy = support("flow_photometric.noisy_pose") * rate.own_mean_share * rate.chance_of_largest_mean
        by_templates.append(Hypothesis("flow_from_noisy_pose", flow, noisy))
    displaced = support("flow_photometric.displacement")
    displacements = tuple(
        Hypothesis(cause, flow if stream == "flow" else stream, displaced)
        for cause, stream in _DISPLACED_AGAINST_FRAMES
    )
    return most_probable([*by_trials, *by_templates]) + displacements


def _template_hypotheses(
    rate: RateResidual, templates: dict[str, TemplateExplanation], flow: str, facts: Facts
) -> list[Hypothesis]:
    """Return gain, shift of an image, and faults of the geometry, by their share of what all templates explain."""
    if rate.explained_share <= 0:
        return []
    gain, shift = templates["gain"], templates["shift"]
    # Relative to what all templates explain together, so that rival supports are on one scale.
    by_gain, by_shift = gain.explained_share / rate.explained_share, shift.explained_share / rate.explained_share
    shift_px = _signed_norm(np.array(shift.sizes))
    if abs(shift_px) > _LARGEST_SHIFT_PX:
        by_shift = 0.0
    hypotheses = [
        gain_hypothesis(
            flow,
            gain.sizes[0],
            gain.standard_error,
            support("flow_photometric.gain") * by_gain,
            rate.interval_s,
            _RESIDUAL_GAIN_TOLERANCE,
            frame_period_of(facts, rate.deviates_by_rate),
            lengths_of_camera(facts),
        ),
        Hypothesis("spatial_offset", "rgb", by_shift, shift_px, "px"),
        # A field moved by -d assigns each pixel the vector of an image moved by d.
        Hypothesis("spatial_offset", flow, support("flow_photometric.image_shift_of_flow") * by_shift, -shift_px, "px"),
    ]
    for name, (cause, unit, largest) in _FAULT_OF_TEMPLATE.items():
        sizes = np.array(templates[name].sizes)
        # The template of time is in percent of the interval (1% of 1 s is 10 ms), others in the unit of their cause.
        scale = MS_PER_PERCENT_OF_S * rate.interval_s if name == "time" else 1.0
        size = _signed_norm(scale * sizes)
        explains_alone = len(sizes) == 1 and templates[name].explained_share > _NEARLY_ALL
        if explains_alone or abs(size) <= _LINEAR * largest:
            # Occam's razor: each further fitted number explains some of any deviation by chance.
            simplicity = support("flow_photometric.further_number") ** len(sizes)
            share = simplicity * templates[name].explained_share / rate.explained_share
            hypotheses.append(Hypothesis(cause, flow, share, size, unit))
            if name == "focal":
                # Frames of a camera that is declared with too short a focal length show larger displacements.
                of_frames = support("flow_photometric.focal_length_of_frames") * share
                hypotheses.append(Hypothesis(cause, "metadata", of_frames, size, unit))
            if name == "mounting":
                # Frames of a camera that is turned the other way against its declared mounting deviate alike.
                of_frames = support("flow_photometric.mounting_of_frames") * share
                hypotheses.append(Hypothesis(cause, "metadata", of_frames, -size, unit))
    return hypotheses


def _signed_norm(sizes: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Return the norm of the components of a fault, with the sign of the largest."""
    return float(np.copysign(np.linalg.norm(sizes), sizes[np.argmax(np.abs(sizes))]))
