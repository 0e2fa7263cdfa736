"""What a gain of the flow means: a sign, a unit, or a gain."""

from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.diagnosis.flow import gain_hypothesis

SECONDS, TOLERANCE = 0.04, 0.02


def cause_of(factor: float) -> str:
    return gain_hypothesis("flow", factor - 1.0, None, 1.0, SECONDS, TOLERANCE).cause


@given(st.floats(-2.9, -0.34))
def test_a_negative_gain_is_the_sign_first(factor: float) -> None:
    """Undoing the sign leaves less than half of the deviation, which then is a gain."""
    assert cause_of(factor) == "flow_sign"
    assert abs(1 + factor) < 0.5 * (1 - factor)
    assert cause_of(-factor) == "flow_gain"


@given(st.sampled_from((SECONDS, 1 / SECONDS)), st.sampled_from((1, -1)), st.floats(-0.015, 0.015))
def test_a_unit_is_a_unit_with_either_sign(unit: float, sign: int, deviation: float) -> None:
    """The opposite sign shows once the unit is undone."""
    assert cause_of(sign * unit * (1 + deviation)) == "flow_unit"


@given(st.floats(-0.3, 3.0).filter(lambda factor: abs(abs(factor) / SECONDS - 1) > TOLERANCE))
def test_other_factors_are_gains(factor: float) -> None:
    """Undoing the sign of a factor near 0 would leave more than half."""
    assert cause_of(factor) == "flow_gain"
