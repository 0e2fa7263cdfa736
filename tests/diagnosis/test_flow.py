"""What a gain of the flow means, a sign, a unit, or a gain; and in which axes its vectors are written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.flow import convention_hypotheses, fractions_of_px, frame_period_of, gain_hypothesis
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.units import LENGTHS, FlowUnit, FlowUnitName, frame_period_s, length_of_flow_px
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.record.types import Finding, Where
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_conventions import ConventionTrial
from tests.support.memory_sequence import facts_of, memory_sequence

SECONDS, TOLERANCE = 0.04, 0.02


def alarm(code: str, *features: Feature) -> Alarm:
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, Where(), features=features)
    return Alarm(Finding("F1", code, "error", "off", Where()), statistic)


def cause_of(factor: float) -> str:
    return gain_hypothesis("flow", factor - 1.0, None, 1.0, SECONDS, TOLERANCE).cause


@given(st.floats(-2.9, -0.34))
def test_a_negative_gain_is_the_sign_first(factor: float) -> None:
    """Undoing the sign leaves less than half of the deviation, which then is a gain."""
    assert cause_of(factor) == "flow_sign"
    assert abs(1 + factor) < 0.5 * (1 - factor)
    assert cause_of(-factor) == "flow_gain"


@given(st.sampled_from((SECONDS, 1 / SECONDS, 1e-3 / SECONDS)), st.sampled_from((1, -1)), st.floats(-0.015, 0.015))
def test_a_unit_is_a_unit_with_either_sign(unit: float, sign: int, deviation: float) -> None:
    """The opposite sign shows once the unit is undone."""
    assert cause_of(sign * unit * (1 + deviation)) == "flow_unit"


@given(
    st.floats(-0.3, 3.0).filter(
        lambda factor: all(abs(abs(factor) / unit - 1) > TOLERANCE for unit in (SECONDS, 1e-3 / SECONDS))
    )
)
def test_other_factors_are_gains(factor: float) -> None:
    """Undoing the sign of a factor near 0 would leave more than half."""
    assert cause_of(factor) == "flow_gain"


@given(st.sampled_from((64.0, 128.0, 256.0, 1000.0, 65536.0)), st.sampled_from((1, -1)), st.floats(-0.01, 0.01))
def test_codes_of_fractions_are_a_unit(per_px: float, sign: int, deviation: float) -> None:
    """Their number is stated exactly, and is the first that is undone."""
    hypothesis = gain_hypothesis("flow", sign * per_px * (1 + deviation) - 1.0, None, 1.0, SECONDS, TOLERANCE)
    assert (hypothesis.cause, hypothesis.magnitude) == ("flow_unit", per_px)
    facts = facts_of(memory_sequence())
    first = next(faults_for("flow_unit", "flow", hypothesis.magnitude, (), {}, facts))
    assert first == FlowUnit("flow", "fractions", per_px)


@given(st.floats(0.01, 61.0))
def test_smaller_gains_are_no_fractions(factor: float) -> None:
    """No code of flow has fewer than 64 fractions of a pixel."""
    assert fractions_of_px(factor, TOLERANCE) == 0.0


@given(st.integers(2, 10), st.floats(-0.015, 0.015))
def test_motion_per_frame_is_a_unit_of_all_rates(frames: int, deviation: float) -> None:
    """Of an interval of several frames; with flow from frame to frame that deviates as well it is a gain."""
    frame_s = SECONDS / frames
    factor = (1 + deviation) / frames
    hypothesis = gain_hypothesis("flow/25hz", factor - 1.0, None, 1.0, SECONDS, TOLERANCE, frame_s)
    assert (hypothesis.cause, hypothesis.stream, hypothesis.magnitude) == ("flow_unit", "flow", frame_s / SECONDS)
    of_no_frames = gain_hypothesis("flow/25hz", factor - 1.0, None, 1.0, SECONDS, TOLERANCE, 0.0)
    assert (of_no_frames.cause, of_no_frames.stream) == ("flow_gain", "flow/25hz")


def test_flow_from_frame_to_frame_must_be_in_order() -> None:
    """A gain of a half of all rates is none of the slower ones alone."""
    facts = facts_of(memory_sequence())
    period_s = frame_period_s(facts)
    own = f"flow/{round(1 / period_s)}hz"
    assert frame_period_of(facts, {own: False, "flow/1hz": True}) == period_s
    assert frame_period_of(facts, {own: True, "flow/1hz": True}) == 0.0
    first = next(faults_for("flow_unit", "flow", period_s * 10, (), {}, facts))
    assert first == FlowUnit("flow", "px per frame")


@given(st.sampled_from((234.0, 270.0, 135.0)), st.sampled_from((1, -1)), st.floats(-0.015, 0.015))
def test_reciprocals_of_lengths_of_the_camera_are_units(length_px: float, sign: int, deviation: float) -> None:
    """Also between those along columns and along rows, where they are unequal."""
    factor = sign * (1 + deviation) / length_px
    lengths_px = ((270.0, 200.0), (135.0, 100.0))
    hypothesis = gain_hypothesis("flow", factor - 1.0, None, 1.0, SECONDS, TOLERANCE, 0.0, lengths_px)
    assert hypothesis.cause == "flow_unit"
    assert hypothesis.magnitude == pytest.approx(abs(factor))
    assert gain_hypothesis("flow", 1 / 300.0 - 1.0, None, 1.0, SECONDS, TOLERANCE, 0.0, lengths_px).cause == "flow_gain"


@pytest.mark.parametrize("unit", LENGTHS)
def test_the_unit_of_the_fitted_length_is_undone_first(unit: FlowUnitName) -> None:
    """The size of a unit of length is the reciprocal of the length along columns."""
    facts = facts_of(memory_sequence())
    length_px = length_of_flow_px(facts, unit)
    assert length_px is not None
    faults = list(faults_for("flow_unit", "flow", 1 / length_px[0], (), {}, facts))
    # Half images and clip space have one length along columns.
    assert FlowUnit("flow", unit) in faults[: 2 if unit in ("half images", "clip space") else 1]
    assert {fault.unit for fault in faults if isinstance(fault, FlowUnit)} == {*LENGTHS, "px s"}


def test_px_per_millisecond_is_undone_by_the_factor_of_any_rate() -> None:
    """It is another factor for each rate, and none of intervals of a millisecond."""
    facts = facts_of(memory_sequence())
    for rate in facts.flow_streams:
        faults = faults_for("flow_unit", "flow", flow_rate_hz(rate) / 1000, (), {}, facts)
        assert next(faults) == FlowUnit("flow", "px/ms")
    assert gain_hypothesis("flow", 0.0, None, 1.0, 1e-3, TOLERANCE).cause == "flow_gain"


def test_of_several_axes_of_flow_the_one_that_removes_most_is_undone_first() -> None:
    """Alone and beside another unit; transforms with another cause are no axes to undo here."""
    facts = facts_of(memory_sequence())
    for name in ("quarter_turn", "flipped_u", "negated_transposed_axes_in_another_unit"):
        trials = [ConventionTrial("flow/10hz", each, "flow", share) for each, share in
                  (("flipped_v", 0.4), (name, 0.9), ("negated", 0.8))]  # fmt: skip
        alarms = [alarm("flow_geometry.endpoint.error", *trials)]
        first, *others = faults_for("frame_convention", "flow", None, alarms, {}, facts)
        assert isinstance(first, VectorAxes)
        written = np.array(first.axes)[:2, :2]
        np.testing.assert_array_equal(FLOW_AXES[name.removesuffix("_in_another_unit")].matrix @ written, np.eye(2))
        assert len({first, *others}) == 5


def test_one_transform_of_a_cause_is_not_weakened_by_another() -> None:
    """The mean over the fields is that of each transform."""
    shares = (("flipped_v", 1.0), ("flipped_v", 0.8), ("flipped_u", 0.0), ("flipped_u", 0.2))
    trials = [ConventionTrial("flow/10hz", name, "flow", share) for name, share in shares]
    (hypothesis,) = convention_hypotheses("flow/10hz", trials, "flow", share_off=1.0)
    assert hypothesis.support == pytest.approx(0.9)


@pytest.mark.parametrize(("sizes_ms", "cause"), [((20.0, -20.0), "swapped_frames"), ((20.0, 20.0), "time_offset")])
def test_fields_that_are_late_beside_early_ones_begin_at_exchanged_frames(
    sizes_ms: tuple[float, float], cause: str
) -> None:
    """A clock is late or early: all fields that deviate have one offset then."""
    trials = [
        trial
        for size_ms in 4 * sizes_ms
        for trial in (
            ConventionTrial("flow/50hz", "delayed", "depth", 0.9, size_ms),
            ConventionTrial("flow/50hz", "neighbouring_frame", "depth", 0.9, 1.0),
        )
    ]
    best = max(convention_hypotheses("flow/50hz", trials, "flow", share_off=1.0), key=lambda each: each.support)
    assert (best.cause, best.stream, best.support) == (cause, "depth", pytest.approx(0.9))
