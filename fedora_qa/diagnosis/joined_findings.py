"""Hypotheses for a finding that another finding of the same file explains: what one check alone cannot tell."""

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Final

from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.checks.images.exposure import BrightnessJump
from fedora_qa.checks.integrity.resolution import CoarseStep
from fedora_qa.diagnosis.event_balance import is_reversed_for_a_while, without_balance_of_wrong_frames
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.views.inertial_agreement import InertialConventionTrial

_DECLARED: Final = InertialConvention()

_OF_FIELDS: Final = ("flow_photometric.residual.", "flow_geometry.endpoint.")
"""Beginnings of the codes of findings that compare single fields of flow, in px."""

_NEARLY_BLACK_PERCENT: Final = -90.0
"""Change of brightness from which a frame of 8 bits shows no motion: 25 of 255 levels are left for all of the scene,
most of which is darker than white. The value is not derived."""


def joined_hypotheses(alarms: Sequence[Alarm]) -> Mapping[str, tuple[Hypothesis, ...]]:
    """Return further causes of findings, by their id.

    Frames that are nearly black show no motion: what ``images.order`` finds of them is the exposure. Flow that is
    absent where depth is valid, and nowhere else wrong, was made of a depth without these values; where the depth
    contradicts itself as well, it has values that are none. Where events follow the light with the opposite sign for a
    while, the frames change against them. IMU and poses that agree in rates under the attitudes of one body, and in
    forces under those of another, agree by chance: they are of two motions. Fields of flow that are off by no
    more than the step in which they are stored are off by that step.

    Parameters
    ----------
    alarms
        Of one file.
    """
    features = [feature for alarm in without_balance_of_wrong_frames(alarms) for feature in alarm.statistic.features]
    joined: dict[str, tuple[Hypothesis, ...]] = {}
    if any(isinstance(each, BrightnessJump) and each.percent < _NEARLY_BLACK_PERCENT for each in features):
        black = Hypothesis("exposure_or_gamma", "rgb", support("images.order_of_black_frames"))
        joined |= {alarm.finding.id: (black,) for alarm in alarms if alarm.finding.code.startswith("images.order.")}
    if is_reversed_for_a_while(features):
        inverted = Hypothesis("polarity_inverted", "events", support("event_response.balance.reversed_for_a_while"))
        of_frames = (alarm for alarm in alarms if alarm.finding.code.startswith("event_response.frames."))
        joined |= {alarm.finding.id: (inverted,) for alarm in of_frames}
    values = [each for each in features if isinstance(each, WrongFlowValues)]
    of_pairs = [alarm for alarm in alarms if alarm.finding.code.startswith("depth.consistency.")]
    if of_pairs and values and all(each.missing and not each.unfounded for each in values):
        filled = Hypothesis("invalid_encoding", "depth", support("depth.values_without_flow"))
        of_values = (alarm for alarm in alarms if alarm.finding.code == "flow_geometry.validity.missing")
        joined |= {alarm.finding.id: (filled,) for alarm in (*of_pairs, *of_values)}
    if are_of_two_bodies(alarms):
        apart = tuple(Hypothesis("other_sequence", stream, support("imu.two_bodies")) for stream in ("imu", "pose"))
        of_bodies = (alarm for alarm in alarms if alarm.finding.code.endswith(".disagreement"))
        joined |= {alarm.finding.id: apart for alarm in of_bodies}
    for stream, step_px in _steps_of_flow(alarms).items():
        rounded = Hypothesis("quantised_values", stream, support("flow.off_by_a_step"))
        # Cut off, each component errs by a step at most; rounded, by half of it.
        largest_px = sqrt(2.0) * step_px
        for alarm in alarms:
            is_of_fields = alarm.finding.code.startswith(_OF_FIELDS) and alarm.finding.where.stream == stream
            if is_of_fields and alarm.statistic.unit == "px" and abs(alarm.statistic.value) <= largest_px:
                joined[alarm.finding.id] = (*joined.get(alarm.finding.id, ()), rounded)
    return joined


def _steps_of_flow(alarms: Sequence[Alarm]) -> Mapping[str, float]:
    """Return the coarse step of each rate of flow, px, by its stream."""
    return {
        stream: feature.size
        for alarm in alarms
        for feature in alarm.statistic.features
        if isinstance(feature, CoarseStep)
        and (stream := alarm.finding.where.stream) is not None
        and is_flow_stream(stream)
        and feature.size > 0
    }


def are_of_two_bodies(alarms: Sequence[Alarm]) -> bool:
    """Whether rates and forces of the whole file agree with poses under attitudes that no one body has.

    Parameters
    ----------
    alarms
        Of one file.
    """
    of_kind = {
        trial.kind: trial.convention
        for alarm in alarms
        if alarm.finding.code.endswith(".disagreement")
        for trial in alarm.statistic.features
        if isinstance(trial, InertialConventionTrial) and trial.interval_s is None
    }
    # One sensor alone may have other axes, or another unit: attitudes of another body are those of both.
    states_attitudes = all(
        convention.quaternions != _DECLARED.quaternions or convention.sensor_axes != _DECLARED.sensor_axes
        for convention in of_kind.values()
    )
    return len(of_kind) == 2 and states_attitudes and not of_kind["translation"].turns_as(of_kind["rotation"])
