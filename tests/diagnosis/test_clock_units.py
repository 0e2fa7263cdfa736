"""Factors of units that the span of a stream leaves open, and the regular clock from which ticks were rounded."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.clocks.span import StreamEnds
from fedora_qa.diagnosis.clock_units import factors_of_span, unit_by_factor, units_of_brief_events
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import EventScan, Facts
from tests.support.facts import MS, clock, exact_facts, with_clock
from tests.support.memory_sequence import memory_sequence

US = 1000


def in_other_unit(stream: str, factor: float, seconds: int = 2, start_ms: float = 0.0) -> tuple[Facts, StreamEnds]:
    """Facts with a stream whose timestamps count whole ticks, ``start_ms`` of which passed before its first one."""
    facts = exact_facts(seconds)
    times_us = facts.clocks[stream].times_ns // US
    stored_ns = np.floor(times_us * factor + start_ms * 1000).astype(np.int64) * US
    ends = StreamEnds(start_ms * MS, seconds * 1000 * MS - float(stored_ns[-1]), seconds * 1000.0 * MS)
    return with_clock(facts, stream, clock(stored_ns)), ends


@pytest.mark.parametrize(
    ("factor", "expected"),
    [(0.032768, 0.032768), (0.01, 0.01), (10.0, 10.0), (24.0, 24.0), (48.0, 48.0), (0.4321, 0.4321), (2.5, 2.5)],
)
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_the_factor_of_a_counter_or_of_a_round_rate_comes_first(stream: str, factor: float, expected: float) -> None:
    """Both ends leave a percent open, within which the factor is found to the rounding of ticks."""
    facts, ends = in_other_unit(stream, factor)
    assert factors_of_span(stream, ends, facts)[0] == pytest.approx(expected, rel=1e-4)


def test_a_factor_of_no_counter_is_tried_as_measured_last() -> None:
    facts, ends = in_other_unit("imu", 0.4321)
    assert factors_of_span("imu", ends, facts)[-1] == pytest.approx(1 - ends.missing_ns / ends.median_duration_ns)


@pytest.mark.parametrize("missing", [0.1, -0.15, 1.0])
def test_a_small_loss_and_an_empty_span_leave_no_factor(missing: float) -> None:
    facts = exact_facts()
    assert not factors_of_span("imu", StreamEnds(0.0, missing * 2000 * MS, 2000.0 * MS), facts)


@pytest.mark.parametrize(("stream", "period_ns"), [("imu", MS), ("pose", 5 * MS)])
@pytest.mark.parametrize("factor", [0.032768, 0.09, 0.0441])
def test_a_regular_clock_is_found_from_its_ticks(stream: str, period_ns: int, factor: float) -> None:
    """Undone, the timestamps are those before they were rounded, to the microsecond."""
    facts, ends = in_other_unit(stream, factor)
    fault = unit_by_factor(stream, factor, ends, facts)
    assert fault.pivot_ns is None
    assert fault.regular_ns == (0.0, period_ns)
    key = timestamps_of(stream)
    undone = fault.undo(facts, memory_sequence()).rows[key]
    stored_ns = facts.clocks[stream].times_ns
    assert np.array_equal(undone(lambda a, b: stored_ns[a:b], 0, len(stored_ns)), exact_facts().clocks[stream].times_ns)


def test_an_irregular_clock_keeps_what_the_division_gives() -> None:
    """Timestamps that scatter by more than a tick are those of no regular clock."""
    facts, ends = in_other_unit("pose", 0.032768)
    times_ns = facts.clocks["pose"].times_ns + US * np.random.default_rng(1).integers(-9, 10, 401)
    facts = with_clock(facts, "pose", clock(np.sort(times_ns)))
    assert unit_by_factor("pose", 0.032768, ends, facts).regular_ns is None


def test_a_counter_that_began_with_its_stream_keeps_the_first_timestamp() -> None:
    """The stream begins with the others, which begin later than zero of the clock."""
    facts, _ = in_other_unit("imu", 0.01, start_ms=5000.0)
    ends = StreamEnds(0.0, 1980.0 * MS, 2000.0 * MS)
    assert unit_by_factor("imu", 0.01, ends, facts).pivot_ns == 5000 * MS


def with_events(first_ns: int, last_ns: int) -> Facts:
    """Facts of two seconds whose events lie between two instants."""
    return replace(exact_facts(), events=EventScan(50_000, first_ns, last_ns, 0, -1, US))


@pytest.mark.parametrize("is_cut_off", [True, False])
@pytest.mark.parametrize(("first_ns", "offset_ns"), [(8 * MS, 0), (8 * MS, 20 * MS)])
def test_counters_of_events_are_scaled_to_the_other_streams(first_ns: int, offset_ns: int, is_cut_off: bool) -> None:
    """A counter of 800 Hz, from the file's zero on or from elsewhere: times come back within a tick."""
    ticks = np.array([first_ns, 1000 * MS, 2000 * MS]) * 800 / 1e9
    stored_ns = offset_ns + (np.floor(ticks) if is_cut_off else np.rint(ticks)).astype(np.int64) * US
    facts = with_events(int(stored_ns[0]), int(stored_ns[-1]))
    unit = units_of_brief_events(facts)[0 if is_cut_off else 2]
    key = timestamps_of("events")
    undo = unit.undo(facts, memory_sequence()).rows[key]
    corrected_ns = undo(lambda a, b: stored_ns[a:b], 0, len(stored_ns))
    # Where the counter began is unknown, so that the first event, which is 8 ms late, begins with the other streams.
    late_ns = 0 if offset_ns == 0 else 8 * MS
    assert corrected_ns[1:] == pytest.approx([1000 * MS - late_ns / 2, 2000 * MS], abs=1.3 * MS)


@pytest.mark.parametrize(("first_ns", "last_ns"), [(0, 2000 * MS), (5 * MS, 210 * MS), (5 * MS, 5 * MS)])
def test_events_that_last_have_no_other_unit(first_ns: int, last_ns: int) -> None:
    """A tenth of the sequence or more, or a single instant, of which no factor follows."""
    assert units_of_brief_events(with_events(first_ns, last_ns)) == ()
