"""Hypotheses for frames whose colours are not what events measure."""

import pytest

from fedora_qa.checks.images.channels import NearestChannelOrder
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.hypotheses import hypotheses_of
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from tests.support.facts import exact_facts


def proposed(code: str, name: str, value: float, *features: Feature) -> tuple[Hypothesis, ...]:
    where = Where(stream="rgb")
    statistic = Statistic(name, value, "1", 0.01, "off", code, where, features=features)
    return hypotheses_of(Alarm(Finding("F1", code, "error", "off", where), statistic), exact_facts())


def test_an_order_is_supported_where_another_is_nearest() -> None:
    """Weights that are nearest to R, G, B although they deviate hardly support an exchange."""
    exchanged = proposed("images.channels.order", "towards_BGR", 0.9, NearestChannelOrder("BGR"))
    declared = proposed("images.channels.order", "towards_BGR", 0.3, NearestChannelOrder("RGB"))
    assert exchanged[0] == Hypothesis("channel_order", "rgb", 0.95)
    assert declared[0] == Hypothesis("channel_order", "rgb", 0.1)
    assert len(exchanged) == len(declared) == 14


@pytest.mark.parametrize(
    ("name", "exponent", "threshold"),
    [
        pytest.param("exponent", 1.3, False, id="bends by level"),
        pytest.param("exponent_at_declared_thresholds", 2.2, False, id="of a display"),
        pytest.param("exponent_at_declared_thresholds", 0.45, False, id="of a display, undone twice"),
        pytest.param("exponent_at_declared_thresholds", 1.3, True, id="of no display"),
    ],
)
def test_an_exponent_may_be_a_threshold(name: str, exponent: float, threshold: bool) -> None:
    """In the log model an exponent that no display has is that of another threshold rather."""
    support = {one.cause: one.support for one in proposed("images.transfer.exponent", name, exponent)}
    assert ("threshold_misdeclared" in support) == threshold
    assert support["exposure_or_gamma"] == (0.3 if threshold else 0.95)
