"""Causes that would explain that flow disagrees with depth and pose, and of what size they would be."""

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final, TypeVar

from fedora_qa.checks.flow_geometry.endpoint import (
    FieldsOff,
    FlowGainFit,
    FlowParameterFit,
    FlowRatesOff,
    FreeMotionCorrection,
    PoseCorrectionRatios,
)
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.flow import convention_hypotheses, gain_hypothesis, most_probable, spreads_over, weakened
from fedora_qa.diagnosis.flow_geometry.chosen_numbers import is_chosen
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial

AnyFeature = TypeVar("AnyFeature", bound=Feature)

_EXACT: Final = 0.98
"""An inverse transform that leaves less than 2% of the deviation comes before a fitted error of a parameter."""

_SAME_GAIN: Final = 0.02

_NEARLY_ALL: Final = 0.9
"""What is declared holds for all fields; so many of them show it, where some hardly move."""

_IMAGE_STREAMS: Final = ("flow", "depth")
"""Where a part of the image is off, what is wrong lies in the image: poses and cameras spoil all of it."""

_UNCORRECTED: Final = 0.01
"""Squared corrections below this share of their expectation are none: the flow was made from the noisy pose."""

_FIELDS_OF_A_JUMP: Final = 2
"""Fields of a rate that a jump of the pose and its return spoil: those in whose interval they happen."""

_GROWTH_OF_NOISE: Final = 5.4
"""Exceeded by one in a thousand of the squares of three axes over their expectation: chi-square of three degrees."""

_OF_METADATA: Final = (("metadata", 1), ("flow", -1))
_OF_TIME: Final = (("pose", 1), ("flow", -1))
_STREAMS_OF_PARAMETER: Final = MappingProxyType({
    "intrinsics_focal": _OF_METADATA,
    "intrinsics_centre": _OF_METADATA,
    "extrinsic_rotation": _OF_METADATA,
    "lever_arm": (("metadata", 1), ("pose", 1)),
    "time_offset": _OF_TIME,
    "clock_rate": _OF_TIME,
})  # fmt: skip
"""Streams in which an error of a parameter has the same effect here, and the sign of the fault: what is declared too
large is too small in the flow. Where nothing else separates them the first is meant."""


def propose_endpoint(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate of flow against depth and pose, most probable first."""
    statistic = alarm.statistic
    rate = alarm.finding.where.stream or "flow"
    hypotheses = _of_one_rate(rate, statistic.features, facts.declared)
    if alarm.finding.code == "flow_geometry.endpoint.pose_correction":
        return _of_the_corrections(rate, statistic, hypotheses)
    return hypotheses


def _of_one_rate(rate: str, features: Sequence[Feature], declared: Declared) -> tuple[Hypothesis, ...]:
    flow = spreads_over(rate, _only(features, FlowRatesOff).off)
    extent = _only(features, FieldsOff)
    share_off = extent.affected_share
    # Declarations and conventions hold for all fields: half of them or fewer are off by faults of single fields.
    local = share_off <= 0.5
    trials = [feature for feature in features if isinstance(feature, ConventionTrial)]
    conventions = convention_hypotheses(rate, trials, flow, share_off=share_off)
    for stream, repeats in ((flow, extent.repeats_of_flow), ("depth", extent.repeats_of_depth)):
        if repeats:
            of_repeats = 1.0 if local else support("flow_geometry.repeats_of_most_off")
            frozen = of_repeats * repeats / extent.count  # fields that do not repeat another are off as well
            conventions.append(Hypothesis("frozen_frames", stream, frozen, float(repeats), "samples"))
    parameters = _of_the_parameters(features, flow)
    # Cameras and poses are common to all pixels: a part of the image is wrong in an image stream only.
    if extent.in_part:
        conventions = [hypothesis for hypothesis in conventions if hypothesis.cause != "other_sequence"]
        parameters = [hypothesis for hypothesis in parameters if hypothesis.stream in (*_IMAGE_STREAMS, flow)]
    parameters = [
        replace(hypothesis, support=hypothesis.support * _trust(hypothesis, declared, share_off))
        for hypothesis in parameters
    ]
    # A gain is a fitted number as the parameters are, no exact transform: it does not weaken them.
    if max((hypothesis.support for hypothesis in conventions if hypothesis.cause != "flow_gain"), default=0) > _EXACT:
        parameters = weakened(parameters, support("flow_geometry.fit_beside_exact_transform"))
    correction = next((feature for feature in features if isinstance(feature, FreeMotionCorrection)), None)
    poses: list[Hypothesis] = []
    if correction is not None and not is_noisy(declared.pose) and not extent.in_part:
        poses = _of_the_poses(correction, extent.count, flow, local=local)
    any_pose = tuple(hypothesis for hypothesis in poses if hypothesis.cause == ANY_CAUSE)
    named_poses = (hypothesis for hypothesis in poses if hypothesis.cause != ANY_CAUSE)
    named = most_probable([*conventions, *parameters, *named_poses])
    return (named or (Hypothesis("unknown", flow, support("flow_geometry.unknown")),)) + any_pose


def _of_the_parameters(features: Sequence[Feature], flow: str) -> list[Hypothesis]:
    """Name what would put a fitted gain, or a fitted error of a parameter, into the data."""
    hypotheses = []
    for fit in features:
        if isinstance(fit, FlowGainFit):
            share = fit.removed_share * fit.correlation
            hypotheses.append(gain_hypothesis(flow, fit.gain, fit.standard_error, share, fit.interval_s, _SAME_GAIN))
        elif isinstance(fit, FlowParameterFit):
            likeliness, error = 1.0, fit.standard_error
            for stream, sign in _STREAMS_OF_PARAMETER[fit.parameter]:
                named, share = flow if stream == "flow" else stream, likeliness * fit.removed_share
                hypotheses.append(Hypothesis(fit.parameter, named, share, sign * fit.value, fit.unit, error))
                likeliness = support("flow_geometry.second_stream_of_a_parameter")
    return hypotheses


def _trust(hypothesis: Hypothesis, declared: Declared, share_off: float) -> float:
    """Return how likely a declaration is to be wrong: numbers that were chosen are not, nor what holds for a while."""
    if hypothesis.stream != "metadata":
        return 1.0
    chosen = is_chosen(declared.cameras["depth"], hypothesis.cause)
    return support("flow_geometry.trusted_declaration") if chosen or share_off < _NEARLY_ALL else 1.0


def _of_the_poses(correction: FreeMotionCorrection, fields_off: int, flow: str, *, local: bool) -> list[Hypothesis]:
    """Name what would explain that a rigid correction makes the fields agree, with ``ANY_CAUSE`` of the pose last.

    Of few fields single poses are wrong; of most, noise that is not declared, or the poses or the flow of another
    sequence: the growth of the corrections separates these.
    """
    share, noise = correction.removed_share, noise_likeness(correction.growth)
    if local:
        # A jump spoils two fields of a rate: the more fields are off, the less of them it explains.
        in_a_jump = min(_FIELDS_OF_A_JUMP / fields_off, 1.0)
        teleport = support("flow_geometry.jump_of_the_pose") * share * in_a_jump
        hypotheses = [Hypothesis("teleport", "pose", teleport, correction.shift_m, "m"),
                      Hypothesis("frozen_frames", "pose", support("flow_geometry.frozen_poses") * share)]  # fmt: skip
        any_pose = support("flow_geometry.any_pose")
    else:
        other = support("flow_geometry.another_sequence") * (1.0 - noise) * share
        misdeclared = support("flow_geometry.undeclared_noise") * noise * share
        hypotheses = [Hypothesis("noise_misdeclared", "pose", misdeclared),
                      *(Hypothesis("other_sequence", stream, other) for stream in ("pose", flow))]  # fmt: skip
        any_pose = support("flow_geometry.any_pose") * max(noise, support("flow_geometry.any_pose_without_noise"))
    best = max(hypothesis.support for hypothesis in hypotheses)
    return [*hypotheses, Hypothesis(ANY_CAUSE, "pose", any_pose * best)]


def noise_likeness(growth: float) -> float:
    """Return how far (0 to 1) corrections look like pose noise, from the growth of their sum."""
    # 5.4 = chi2_3^-1(0.999) / 3: the sum of independent corrections stays below, that of another motion exceeds it.
    return min(1.0, _GROWTH_OF_NOISE / max(growth, 1.0))


def _of_the_corrections(rate: str, statistic: Statistic, hypotheses: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
    """Name what makes the corrections of one rate smaller or larger than the declared noise does."""
    ratio = statistic.value
    # The statistic is a cube root of squares: 1.5 is the power that leads to a ratio of lengths.
    deviation_percent = 100 * (1 / ratio**1.5 - 1) if ratio else None
    if ratio < statistic.expected:
        ratios = _only(statistic.features, PoseCorrectionRatios).of_rate
        uncorrected = {stream: squares < _UNCORRECTED for stream, squares in ratios.items()}
        row = "uncorrected_flow" if uncorrected[rate] else "weakly_corrected_flow"
        from_noisy = support(f"flow_geometry.{row}")
        misdeclared = support("flow_geometry.corrections_beside_noise") - from_noisy / 2
        return (
            Hypothesis("flow_from_noisy_pose", spreads_over(rate, uncorrected), from_noisy),
            Hypothesis("noise_misdeclared", "pose", misdeclared, deviation_percent),
        )
    if not hypotheses or hypotheses[0].cause in ("unknown", "noise_misdeclared"):
        misdeclared = support("flow_geometry.corrections_beside_noise")
        return (
            Hypothesis("noise_misdeclared", "pose", misdeclared, deviation_percent, "percent"),
            Hypothesis(ANY_CAUSE, "pose", support("flow_geometry.any_pose_of_corrections")),
            *hypotheses,
        )
    return hypotheses


def _only(features: Sequence[Feature], kind: type[AnyFeature]) -> AnyFeature:
    """Return the one feature of a kind that every statistic of the check carries."""
    return next(feature for feature in features if isinstance(feature, kind))
