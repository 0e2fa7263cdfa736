"""Hypotheses for flow that deviates from the frames, with their sizes."""

from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.checks.flow_photometric.rate_statistics import RateResidual, TemplateExplanation
from fedora_qa.diagnosis.convention_trials import most_probable, weakened
from fedora_qa.diagnosis.flow import convention_hypotheses, gain_hypothesis, spreads_over
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial

_GAIN_TOLERANCE: Final = 0.1
"""Largest relative difference, near the capture range, of a gain from a sign or a unit that counts as such."""

_FEW_FIELDS: Final = 0.5
"""Largest share of deviating fields for a fault of single frames."""

_LARGEST_SHIFT_PX: Final = 10.0
"""Largest shift, px, for which the slopes of a flow predict its values."""

_MS_PER_PERCENT_OF_S: Final = 10.0

_LINEAR: Final = 1 / 3
"""Share of the largest size of a fault up to which tiles, with a capture range of 3 to 4 px, follow its template."""

_FAULT_OF_TEMPLATE: Final = MappingProxyType({
    "focal": ("intrinsics_focal", "percent", 30.0),
    "centre": ("intrinsics_centre", "px", 100.0),
    "mounting": ("extrinsic_rotation", "deg", 15.0),
    "time": ("time_offset", "ms", 50.0),
})  # fmt: skip
"""Cause, unit and largest size; beyond it the template, a derivative, does not apply."""

_DISPLACEMENTS: Final = tuple(
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


def propose_residual(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate against the frames, best supported first."""
    features = alarm.statistic.features
    (rate,) = (feature for feature in features if isinstance(feature, RateResidual))
    flow = spreads_over(rate.rate, rate.deviates_by_rate)
    by_templates = _template_hypotheses(
        rate, {feature.template: feature for feature in features if isinstance(feature, TemplateExplanation)}, flow
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
        Hypothesis(cause, flow if stream == "flow" else stream, displaced) for cause, stream in _DISPLACEMENTS
    )
    return most_probable([*by_trials, *by_templates]) + displacements


def _template_hypotheses(rate: RateResidual, templates: dict[str, TemplateExplanation], flow: str) -> list[Hypothesis]:
    """Return gain, shift of an image, and faults of the geometry, by their share of what all templates explain."""
    if rate.explained_share <= 0:
        return []
    gain, shift = templates["gain"], templates["shift"]
    # Relative to what all templates explain together, so that rival supports are on one scale.
    by_gain, by_shift = gain.explained_share / rate.explained_share, shift.explained_share / rate.explained_share
    shift_px = _signed_norm(np.array(shift.sizes))
    if abs(shift_px) > _LARGEST_SHIFT_PX:
        by_shift = 0.0
    gain_support = support("flow_photometric.gain") * by_gain
    hypotheses = [
        gain_hypothesis(flow, gain.sizes[0], gain.standard_error, gain_support, rate.interval_s, _GAIN_TOLERANCE),
        Hypothesis("spatial_offset", "rgb", by_shift, shift_px, "px"),
        # A field moved by -d assigns each pixel the vector of an image moved by d.
        Hypothesis("spatial_offset", flow, support("flow_photometric.image_shift_of_flow") * by_shift, -shift_px, "px"),
    ]
    for name, (cause, unit, largest) in _FAULT_OF_TEMPLATE.items():
        sizes = np.array(templates[name].sizes)
        # The template of time is in percent of the interval (1% of 1 s is 10 ms), others in the unit of their cause.
        scale = _MS_PER_PERCENT_OF_S * rate.interval_s if name == "time" else 1.0
        size = _signed_norm(scale * sizes)
        if abs(size) <= _LINEAR * largest:
            # Occam's razor: each further fitted number explains some of any deviation by chance.
            simplicity = support("flow_photometric.further_number") ** len(sizes)
            share = simplicity * templates[name].explained_share / rate.explained_share
            hypotheses.append(Hypothesis(cause, flow, share, size, unit))
            if name == "focal":
                # Frames of a camera that is declared with too short a focal length show larger displacements.
                of_frames = support("flow_photometric.focal_length_of_frames") * share
                hypotheses.append(Hypothesis(cause, "metadata", of_frames, size, unit))
    return hypotheses


def _signed_norm(sizes: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Return the norm of the components of a fault, with the sign of the largest."""
    return float(np.copysign(np.linalg.norm(sizes), sizes[np.argmax(np.abs(sizes))]))
