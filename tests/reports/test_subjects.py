"""A gauge shows a value against what an honest file gives."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.record.types import Measurement
from fedora_reports.subjects import gauge_of


def measured(value: float | None, limit: float | None = 2.0, side: str = "both", error: float = 0.5) -> Measurement:
    """A measurement in ms of which 10 is expected."""
    return Measurement("offset", value, "ms", error, 10.0, limit, None, side)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("value", "share", "beyond"),
    [(10.0, 0.5, 0), (12.0, 0.75, 0), (8.0, 0.25, 0), (14.0, 1.0, 0), (30.0, 1.0, 1), (-30.0, 0.0, -1)],
)
def test_value_lies_by_its_deviation_in_limits(value: float, share: float, beyond: int) -> None:
    """The middle is what is expected, the quarters are the limits, the ends twice the limits."""
    gauge = gauge_of(measured(value))
    assert gauge is not None
    assert (gauge.value, gauge.beyond) == (pytest.approx(share), beyond)


def test_band_is_what_an_honest_file_gives() -> None:
    """The band reaches from limit to limit, and to the end on a side that does not count."""
    bands = {side: gauge.band for side in ("both", "upper", "lower") if (gauge := gauge_of(measured(10.0, side=side)))}
    assert bands == {"both": (0.25, 0.75), "upper": (0.0, 0.75), "lower": (0.25, 1.0)}


def test_error_reaches_one_standard_error_to_either_side() -> None:
    """Half a ms is a quarter of the limit, and a sixteenth of the drawing."""
    gauge = gauge_of(measured(10.0))
    assert gauge is not None
    assert gauge.error == pytest.approx((0.5 - 1 / 16, 0.5 + 1 / 16))


@pytest.mark.parametrize("one", [measured(None), measured(1.0, limit=None), measured(1.0, limit=0.0)])
def test_nothing_is_drawn_without_value_or_limit(one: Measurement) -> None:
    """A count that must be exact has no band to lie in."""
    assert gauge_of(one) is None


@given(st.floats(), st.floats(0.0), st.floats(0.0))
def test_every_gauge_stays_on_the_drawing(value: float, limit: float, error: float) -> None:
    """Whatever the numbers, all places are shares of the width."""
    gauge = gauge_of(measured(value, limit, error=error))
    if gauge is not None:
        assert all(0.0 <= share <= 1.0 for share in (*gauge.band, gauge.value, *gauge.error))


@pytest.mark.parametrize(("side", "counts"), [("both", True), ("upper", False), ("lower", True)])
def test_only_the_side_that_counts_is_out(side: str, counts: bool) -> None:
    """A value far below is drawn beyond the end whatever the side, and is out of order only where that side counts."""
    gauge = gauge_of(measured(-30.0, side=side))
    assert gauge is not None
    assert (gauge.beyond, gauge.counts) == (-1, counts)


@pytest.mark.parametrize(("side", "share"), [("both", 0.875), ("upper", 0.875), ("lower", 0.125)])
def test_what_would_have_been_seen_is_marked(side: str, share: float) -> None:
    """The least deviation that would have been seen lies beyond the limit, on the side that counts."""
    for least, expected in ((3.0, share), (None, None), (5.0, None), (1.0, None)):
        gauge = gauge_of(replace(measured(10.0, side=side), least_detectable=least))
        assert gauge is not None
        assert gauge.detection_limit == expected
