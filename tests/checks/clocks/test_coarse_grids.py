"""Timestamps on a coarse grid, as each clock check measures them."""

from dataclasses import replace

import pytest

from tests.support.altered_clocks import CLOCKS, hypotheses_for, judgement_of, with_factor_of_part, with_grid
from tests.support.facts import MS, clock, exact_facts, with_clock


@pytest.mark.parametrize(("stream", "grid_ns"), [("rgb", 7 * MS), ("imu", 700_000), ("pose", 700_000)])
def test_a_coarse_grid_is_neither_a_gap_nor_another_rate(stream: str, grid_ns: int) -> None:
    """Timestamps that were rounded keep their rate and lack no sample: only their resolution is broken."""
    facts = with_grid(stream, grid_ns)
    assert not judgement_of("clocks.rate", facts).alarms
    assert not judgement_of("clocks.gaps", facts).alarms
    assert judgement_of("clocks.resolution", facts).alarms


def test_a_grid_of_half_a_period_is_no_other_rate() -> None:
    """Half a second of frames on a grid of 10.3 ms has steps of two grids and one of one: the mean period is kept."""
    frames = (exact_facts().clocks["rgb"].times_ns[:26] + 5_150_000) // 10_300_000 * 10_300_000
    hypotheses = hypotheses_for("clocks.rate", with_clock(exact_facts(), "rgb", clock(frames)))
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.magnitude) == ("quantised_time", 10.3)
    # A clock that runs 1% slow, and was set back by half a period once, does not keep the nominal period.
    slow = exact_facts().clocks["rgb"].times_ns * 10095 // 10000
    slow[40:] -= 10_095_000
    hypotheses = hypotheses_for("clocks.rate", with_clock(exact_facts(), "rgb", clock(slow)))
    assert {hypothesis.cause for hypothesis in hypotheses} == {"clock_rate"}


def test_a_grid_that_nearly_divides_the_period_is_no_other_rate() -> None:
    """Half a second of frames on a grid of 0.87 ms has one odd step: the grid is named, and not a clock with a jump."""
    frames = exact_facts().clocks["rgb"].times_ns[:26] // 870_000 * 870_000
    hypotheses = hypotheses_for("clocks.rate", with_clock(exact_facts(), "rgb", clock(frames)))
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.magnitude) == ("quantised_time", pytest.approx(0.87))


@pytest.mark.parametrize("start", [0, 7, 13])
def test_a_grid_just_above_the_period_repeats_a_timestamp_or_two(start: int) -> None:
    """Half a second of frames at 50 Hz on a grid of 21.2 ms: the grid is named, not a doubled frame or another rate."""
    frames = (exact_facts().clocks["rgb"].times_ns[start : start + 25] + 10_600_000) // 21_200_000 * 21_200_000
    coarse = with_clock(exact_facts(), "rgb", clock(frames))
    for check in ("clocks.order", "clocks.rate"):
        best = max(hypotheses_for(check, coarse), key=lambda hypothesis: hypothesis.support)
        assert (best.cause, best.stream, best.magnitude) == ("quantised_time", "rgb", pytest.approx(21.2)), check


def test_whole_seconds_are_no_single_precision() -> None:
    """A part in nanoseconds makes steps of 20 s, which float32 holds: the unit is wrong, not the resolution."""
    assert not judgement_of("clocks.resolution", with_factor_of_part("rgb", 1000.0)).alarms


def test_grids_are_seen_without_events() -> None:
    """Rounded timestamps are detected in a file without events. Exact clocks alone are not observable."""
    check = CLOCKS["clocks.resolution"]
    exact, coarse = (replace(facts, events=None) for facts in (exact_facts(), with_grid("rgb", 7 * MS)))
    assert judgement_of("clocks.resolution", exact).result.outcome == "not_observable"
    assert hypotheses_for("clocks.resolution", coarse)[0].stream == "rgb"
    assert check.not_applicable(replace(exact, clocks={}))
