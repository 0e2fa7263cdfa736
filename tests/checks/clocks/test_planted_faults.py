"""Each clock check passes exact clocks and names the fault that is planted in them."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fedora_qa.sequence.facts import Facts
from tests.support.altered_clocks import (
    CLOCKS,
    hypotheses_for,
    in_order_of_text,
    in_single_precision,
    judgement_of,
    with_drift,
    with_event_grid,
    with_event_shift,
    with_event_wrap,
    with_exchange,
    with_factor,
    with_factor_of_part,
    with_grid,
    with_repeat,
    with_rolled_rows,
    with_row_numbers,
    with_shift,
    with_step,
    with_unsorted_events,
    with_wrap,
    without_rows,
)
from tests.support.facts import MS, clock, exact_facts

FAULTS: dict[str, tuple[str, Callable[[], Facts], str, str, float | None]] = {
    "two poses exchanged": ("clocks.order", lambda: with_exchange("pose", 50), "unsorted", "pose", 1.0),
    "IMU in the order of text": ("clocks.order", lambda: in_order_of_text("imu"), "unsorted", "imu", None),
    "poses in the order of text": ("clocks.order", lambda: in_order_of_text("pose"), "unsorted", "pose", None),
    "a block of poses at its end first": (
        "clocks.order",
        lambda: with_rolled_rows("pose", 60),
        "unsorted",
        "pose",
        1.0,
    ),
    "an IMU sample twice": ("clocks.order", lambda: with_repeat("imu", 50), "duplicated_samples", "imu", 1.0),
    "three events early": ("clocks.order", with_unsorted_events, "unsorted", "events", 3.0),
    "a 32-bit counter wraps": ("clocks.order", lambda: with_wrap("imu"), "time_unit", "imu", None),
    "the IMU in milliseconds": ("clocks.unit", lambda: with_factor("imu", 1e-3), "time_unit", "imu", 1e-3),
    "poses in nanoseconds": ("clocks.unit", lambda: with_factor("pose", 1e3), "time_unit", "pose", 1e3),
    "frames in ticks of 90 kHz": ("clocks.unit", lambda: with_factor("rgb", 0.09), "time_unit", "rgb", 0.09),
    "poses in ticks of 100 ns": ("clocks.unit", lambda: with_factor("pose", 10.0), "time_unit", "pose", 10.0),
    "frames in wall-clock time": ("clocks.unit", lambda: with_factor("rgb", 32.0), "time_unit", "rgb", 32.0),
    "a pose clock 50 ppm fast": ("clocks.rate", lambda: with_factor("pose", 1 + 50e-6), "clock_rate", "pose", 50.0),
    "flow 0.1% slow": ("clocks.rate", lambda: with_factor("flow/10hz", 1.001), "clock_rate", "flow/10hz", 1000.0),
    "an IMU clock 60 ppm fast for a while": (
        "clocks.rate",
        lambda: with_drift(60e-6),
        "clock_rate",
        "imu",
        60.0,
    ),
    "one IMU sample lost": ("clocks.gaps", lambda: without_rows("imu", slice(70, 71)), "dropped_samples", "imu", 1.0),
    "seven frames lost": ("clocks.gaps", lambda: without_rows("rgb", slice(20, 27)), "dropped_samples", "rgb", 7.0),
    "events a minute before all else": (
        "clocks.span",
        lambda: with_event_shift(-60_000 * MS),
        "time_offset",
        "events",
        -6e4,
    ),
    "events an hour behind all else": (
        "clocks.span",
        lambda: with_event_shift(3_600_000 * MS),
        "time_offset",
        "events",
        3.6e6,
    ),
    "poses 30 ms late": ("clocks.span", lambda: with_shift("pose", 30 * MS), "time_offset", "pose", 30.0),
    "the last 10% of depth lost": (
        "clocks.span",
        lambda: without_rows("depth", slice(91, None)),
        "truncated",
        "depth",
        10.0,
    ),
    "a 32-bit counter of events wraps": ("clocks.order", with_event_wrap, "time_unit", "events", None),
    "a clock set back by 30 ms": (
        "clocks.order",
        lambda: with_step("imu", 900, -30 * MS),
        "time_offset",
        "imu",
        -30.0,
    ),
    "IMU stamps on a grid of 2.1 ms": (
        "clocks.order",
        lambda: with_grid("imu", 2_100_000),
        "quantised_time",
        "imu",
        2.1,
    ),
    "half of the depth stamps in nanoseconds": (
        "clocks.unit",
        lambda: with_factor_of_part("depth", 1000.0),
        "time_unit",
        "depth",
        1e3,
    ),
    "half of the pose stamps in milliseconds": (
        "clocks.unit",
        lambda: with_factor_of_part("pose", 1e-3),
        "time_unit",
        "pose",
        1e-3,
    ),
    "numbers of frames for stamps": ("clocks.unit", lambda: with_row_numbers("rgb"), "time_unit", "rgb", 5e-5),
    "a clock set forward by 6 ms": ("clocks.gaps", lambda: with_step("rgb", 40, 6 * MS), "time_offset", "rgb", 6.0),
    "depth in nanoseconds, seen by its span": (
        "clocks.span",
        lambda: with_factor("depth", 1e3),
        "time_unit",
        "depth",
        1e3,
    ),
    "frames on a grid of 7 ms": ("clocks.resolution", lambda: with_grid("rgb", 7 * MS), "quantised_time", "rgb", 7.0),
    "IMU on a grid of 0.7 ms": ("clocks.resolution", lambda: with_grid("imu", 700_000), "quantised_time", "imu", 0.7),
    "stamps in float32 seconds": (
        "clocks.resolution",
        lambda: in_single_precision("imu"),
        "quantised_time",
        "imu",
        0.00763,
    ),
    "events in milliseconds": ("clocks.resolution", with_event_grid, "quantised_time", "events", 1.0),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_exact_clocks_pass(name: str) -> None:
    """Nothing is wrong with a clean file."""
    assert judgement_of(name, exact_facts()).result.outcome == "passed"


@pytest.mark.parametrize(("name", "facts", "cause", "stream", "magnitude"), FAULTS.values(), ids=FAULTS)
def test_planted_fault_is_named(
    name: str, facts: Callable[[], Facts], cause: str, stream: str, magnitude: float | None
) -> None:
    """The check fails, and its first hypothesis is the planted cause in its stream with its size."""
    assert judgement_of(name, facts()).alarms
    first = hypotheses_for(name, facts())[0]
    assert (first.cause, first.stream) == (cause, stream)
    if magnitude is not None:
        assert first.magnitude == pytest.approx(magnitude, rel=0.02)
    assert all(other.finding.where.stream == stream for other in judgement_of(name, facts()).alarms)


def test_every_clock_check_has_a_planted_fault() -> None:
    """No check is without a proof that it can fail."""
    assert {name for name, *_ in FAULTS.values()} == set(CLOCKS)


@pytest.mark.parametrize("name", sorted(set(CLOCKS) - {"clocks.span"}))
@pytest.mark.parametrize("count", [0, 1, 2])
def test_streams_with_hardly_a_timestamp_are_no_failure(name: str, count: int) -> None:
    """A stream of two samples is neither a crash nor an alarm of order, unit, rate or gaps."""
    facts = exact_facts()
    few = {stream: clock(exact.times_ns[:count]) for stream, exact in facts.clocks.items()}
    facts = replace(facts, clocks=few, events=None if count == 0 else facts.events)
    if name == "clocks.resolution" and facts.events is None:
        return
    check = CLOCKS[name]
    assert check.not_applicable(facts) or judgement_of(name, facts).result.outcome in {
        "passed",
        "not_observable",
        "warned",
    }
