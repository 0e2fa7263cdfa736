"""The error of the offset between the clocks of events and frames."""

from dataclasses import replace
from math import hypot, inf, pi, sin

import pytest

from fedora_qa.views.event_clock_offset import ClockOffset, offset_error_ms
from tests.support.facts import exact_facts

FITTED = ClockOffset(10e-3, 0.3e-3, 0.0, 0.0, inf, inf, capture_range_s=10e-3)


def test_an_offset_of_half_an_interval_may_be_underestimated() -> None:
    """A wave of four frames, 20 ms apart, moved by 10 ms, is fitted as moved by sin(pi / 4) / (pi / 4) of them."""
    by_curve_ms = 10.0 * (1 - sin(pi / 4) / (pi / 4))
    assert offset_error_ms(FITTED, 10.0, 0.4, exact_facts()) == pytest.approx(hypot(0.3, 0.4, by_curve_ms))
    assert offset_error_ms(FITTED, -0.5, 0.4, exact_facts()) == pytest.approx(0.5, rel=1e-3)


def test_an_offset_by_search_has_its_own_error_alone() -> None:
    """An offset that was undone before it was fitted has its own error alone, however large it is."""
    assert offset_error_ms(replace(FITTED, capture_range_s=inf), 60.0, 0.4, exact_facts()) == pytest.approx(0.5)
