"""Hypotheses for findings that another finding of the same file explains."""

import pytest

from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.checks.images.exposure import BrightnessJump
from fedora_qa.checks.integrity.resolution import CoarseStep
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.joined_findings import joined_hypotheses
from fedora_qa.estimators.events.balance_estimates import GainEstimate
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.views.event_balance import BalanceCourse
from fedora_qa.views.inertial_agreement import InertialConventionTrial
from tests.support.proposals import named

BACKWARDS = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))


def alarm(finding: str, code: str, *features: Feature) -> Alarm:
    statistic = Statistic("value", 1.0, "1", 0.0, "off", code, Where(), features=features)
    return Alarm(Finding(finding, code, "error", "off", Where()), statistic)


def wrong_values(unfounded: int, missing: int) -> WrongFlowValues:
    return WrongFlowValues(frozenset({"flow/50hz"}), unfounded, missing, fills=0, behind=0, deep=True)


@pytest.mark.parametrize(("percent", "is_black"), [(-98.0, True), (-60.0, False), (4000.0, False)])
def test_nearly_black_frames_show_no_motion(percent: float, is_black: bool) -> None:
    """What is found of their order is their exposure; frames that are darker by half still move."""
    order = alarm("F1", "images.order.share")
    joined = joined_hypotheses([order, alarm("F2", "images.exposure.jump", BrightnessJump(percent, 1.0))])
    assert list(joined) == ["F1"] * is_black
    assert all(named(each) == [("exposure_or_gamma", "rgb")] for each in joined.values())


@pytest.mark.parametrize(
    ("unfounded", "code", "is_filled"),
    [
        (0, "depth.consistency.tile", True),
        (9, "depth.consistency.tile", False),
        (0, "depth.scale.factor", False),
    ],
)
def test_depth_without_flow_that_contradicts_itself_is_none(unfounded: int, code: str, is_filled: bool) -> None:
    """Depth that is displaced has flow beside it as well; depth that agrees with its neighbours has values."""
    missing = alarm("F1", "flow_geometry.validity.missing", wrong_values(unfounded, 99))
    joined = joined_hypotheses([missing, alarm("F2", code)])
    assert sorted(joined) == ["F1", "F2"] * is_filled
    assert all(named(each) == [("invalid_encoding", "depth")] for each in joined.values())


@pytest.mark.parametrize(
    ("of_rates", "of_forces", "is_apart"),
    [
        (InertialConvention("inverse"), InertialConvention("inverse"), False),
        (InertialConvention("inverse"), InertialConvention("wxyz"), True),
        (InertialConvention(sensor_axes=BACKWARDS), InertialConvention("inverse"), True),
        # One sensor is in another unit.
        (InertialConvention(rate_unit=57.3), InertialConvention("inverse"), False),
    ],
)
def test_rates_and_forces_of_two_bodies_are_of_another_motion(
    of_rates: InertialConvention, of_forces: InertialConvention, is_apart: bool
) -> None:
    """Attitudes of one body are those of both; under those of two bodies they agree by chance."""
    rates = alarm("F1", "imu.rotation.disagreement", InertialConventionTrial(of_rates))
    forces = alarm("F2", "imu.translation.disagreement", InertialConventionTrial(of_forces, kind="translation"))
    joined = joined_hypotheses([rates, forces])
    assert sorted(joined) == ["F1", "F2"] * is_apart
    assert all(named(each) == [("other_sequence", "imu"), ("other_sequence", "pose")] for each in joined.values())


@pytest.mark.parametrize(("contrast", "is_inverted"), [(-1.9, True), (-0.5, False)])
def test_frames_change_against_events_of_inverted_polarity(contrast: float, *, is_inverted: bool) -> None:
    """Fewer events for a while leave the frames in their order to explain."""
    course = BalanceCourse("part", GainEstimate(contrast, 0.02), 0.97, GainEstimate(0.0, 0.03))
    frames = alarm("F1", "event_response.frames.frame")
    joined = joined_hypotheses([frames, alarm("F2", "event_response.conservation.pixels", course)])
    assert {finding: named(each) for finding, each in joined.items()} == (
        {"F1": [("polarity_inverted", "events")]} if is_inverted else {}
    )


def of_flow(finding: str, code: str, value: float, *features: Feature, unit: str = "px") -> Alarm:
    where = Where(stream="flow/10hz")
    statistic = Statistic("value", value, unit, 0.0, "off", code, where, features=features)
    return Alarm(Finding(finding, code, "error", "off", where), statistic)


def test_flow_that_is_off_by_a_step_is_rounded() -> None:
    """Components that lost what is behind their point err by a step: the vector by 1.41 steps at most."""
    step = of_flow("F1", "integrity.resolution.step", 20.0, CoarseStep("1 px", 1.0), unit="1")
    within = of_flow("F2", "flow_geometry.endpoint.error", 1.4)
    beyond = of_flow("F3", "flow_geometry.endpoint.worst_pixel", 1.5)
    gain = of_flow("F4", "flow_photometric.residual.template", 1.0, unit="percent")
    joined = joined_hypotheses([step, within, beyond, gain])
    assert {finding: named(each) for finding, each in joined.items()} == {"F2": [("quantised_values", "flow/10hz")]}
    assert joined_hypotheses([of_flow("F1", "integrity.resolution.step", 2.0, CoarseStep("2^-8")), within]) == {}
