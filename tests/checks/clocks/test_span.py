"""The span of a stream beside the others: ends, offsets and streams of few samples."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.sequence.facts import Facts
from tests.support.altered_clocks import (
    CLOCKS,
    as_recording,
    hypotheses_for,
    judgement_of,
    only_rows,
    times_ns,
    with_shift,
    without_rows,
)
from tests.support.facts import FLOW_PERIODS_NS, MS, clock, exact_facts, with_clock


@pytest.mark.parametrize(("rows", "is_exact"), [(slice(0, 0), True), (slice(0, 1), False)])
def test_ends_that_moved_alike_state_an_offset_exactly(rows: slice, is_exact: bool) -> None:
    """Poses that begin and end with the others are 60 ms late at both ends; without the first one, at one of them."""
    late = np.delete(times_ns("pose") + 60 * MS, rows)
    (offset,) = hypotheses_for("clocks.span", with_clock(exact_facts(), "pose", clock(late)))
    assert offset.cause == "time_offset"
    assert (offset.standard_error is not None) == is_exact
    assert offset.magnitude == pytest.approx(60.0, abs=0.0 if is_exact else 5.0)


def test_a_last_sample_that_is_missing_is_noted() -> None:
    """A stream that stops one period before the others is noted, not failed; one that nothing else outlasts is not."""
    noted = judgement_of("clocks.span", without_rows("rgb", slice(100, None))).result
    assert noted.outcome == "warned"
    assert "rgb lacks 1 of its samples at its end" in noted.findings[0].message
    short = {
        stream: clock(exact.times_ns[exact.times_ns < 1995 * MS]) for stream, exact in exact_facts().clocks.items()
    }
    sampled = {stream: exact for stream, exact in short.items() if not stream.startswith("flow")}
    assert judgement_of("clocks.span", replace(exact_facts(), clocks=sampled)).result.outcome == "passed"


@pytest.mark.parametrize(("kept_ms", "slowest_ms", "stream"), [(1900, 1900, "flow"), (1900, 2000, "flow/25hz")])
def test_a_cut_of_all_rates_is_one_of_the_flow(kept_ms: int, slowest_ms: int, stream: str) -> None:
    """A cut that 25 and 50 Hz show is of flow as a whole, unless 10 Hz, too slow to fail, is whole to its end."""
    facts = exact_facts()
    ends_ms = {"flow/10hz": slowest_ms, "flow/25hz": kept_ms, "flow/50hz": kept_ms}
    for rate, end_ms in ends_ms.items():
        exact = facts.clocks[rate]
        assert exact.ends_ns is not None
        kept = exact.times_ns[exact.ends_ns <= end_ms * MS]
        facts = with_clock(facts, rate, clock(kept, int(exact.ends_ns[0] - exact.times_ns[0])))
    alarms = judgement_of("clocks.span", facts).alarms
    assert {alarm.finding.where.stream for alarm in alarms} == {"flow/25hz", "flow/50hz"}
    first = hypotheses_of(alarms[0], facts)[0]
    assert (first.cause, first.stream) == ("truncated", stream)
    assert not any("begin at zero" in alarm.finding.message for alarm in alarms)


def test_timestamps_from_zero_beside_others_of_an_epoch_are_said_to_be() -> None:
    """A stream that was counted from zero is named as that, with the offset between the clocks."""
    epoch_us = 1_700_000_000_000_000
    facts = replace(exact_facts(), origin_us=0)
    late = {
        stream: clock(exact.times_ns + epoch_us * 1000) for stream, exact in facts.clocks.items() if stream != "imu"
    }
    from_zero = replace(facts, clocks={**late, "imu": facts.clocks["imu"]})
    alarm = judgement_of("clocks.span", from_zero).alarms[0]
    assert "its timestamps begin at zero" in alarm.finding.message
    first = hypotheses_of(alarm, from_zero)[0]
    assert (first.cause, first.stream) == ("time_offset", "imu")


@pytest.mark.parametrize(
    ("stream", "rows", "cause", "magnitude"),
    [
        ("imu", slice(0, 1), "truncated", 100.0),
        ("rgb", slice(0, 2), "truncated", 99.0),
        ("rgb", slice(0, None, 100), "dropped_samples", 1.0),
        ("flow/10hz", slice(0, 0), "missing_stream", None),
        ("flow/50hz", slice(0, 2), "truncated", 98.0),
        ("flow/50hz", slice(0, 1), "truncated", 99.0),
    ],
    ids=["one IMU sample", "two frames", "the outer frames", "no flow", "two fields", "one field"],
)
def test_a_stream_of_few_samples_is_named(stream: str, rows: slice, cause: str, magnitude: float | None) -> None:
    """Two samples in two seconds are no stream. No other stream is named."""
    facts = only_rows(stream, rows)
    alarms = judgement_of("clocks.span", facts).alarms
    assert {alarm.finding.where.stream for alarm in alarms} == {stream}
    first = hypotheses_of(alarms[0], facts)[0]
    assert (first.cause, first.stream) == (cause, stream)
    assert first.magnitude == (None if magnitude is None else pytest.approx(magnitude))


def window_of(start_ms: int, stop_ms: int) -> Facts:
    """Facts of the samples and whole intervals in a part of a clean file."""
    facts = exact_facts()
    clocks = {}
    for stream, exact in facts.clocks.items():
        ends = exact.times_ns if exact.ends_ns is None else exact.ends_ns
        inside = (exact.times_ns >= start_ms * MS) & (ends <= stop_ms * MS)
        clocks[stream] = clock(exact.times_ns[inside], FLOW_PERIODS_NS.get(stream))
    return replace(facts, clocks=clocks)


@given(st.integers(0, 1000), st.integers(60, 1000))
def test_a_part_of_a_clean_file_lacks_nothing(start_ms: int, length_ms: int) -> None:
    """Whatever part is cut out, no stream has too few samples: slow rates of flow may have none in a short part."""
    assert not judgement_of("clocks.span", window_of(start_ms, start_ms + length_ms)).alarms


@pytest.mark.parametrize("span_ms", [250, 2000])
def test_few_samples_beside_events_alone(span_ms: int) -> None:
    """Events state the duration of a file without other streams. Three samples are due within 0.3 s."""
    facts = only_rows("rgb", slice(0, 2))
    assert facts.events is not None
    events = replace(facts.events, last_ns=span_ms * MS)
    facts = replace(facts, clocks={"rgb": facts.clocks["rgb"]}, events=events)
    codes = {alarm.finding.code for alarm in judgement_of("clocks.span", facts).alarms}
    assert codes == ({"clocks.span.few_samples"} if span_ms == 2000 else {"clocks.span.ends_early"})


def test_a_recorded_stream_that_ends_early_is_stated() -> None:
    cut = as_recording(without_rows("pose", np.s_[:100]))
    result = judgement_of("clocks.span", cut).result
    assert result.outcome != "failed"
    inferred = CLOCKS["clocks.span"].examine(cut).inferred
    assert inferred == {"pose.begins_later_ms": 500.0, "pose.ends_earlier_ms": 0.0}


def test_a_recorded_stream_that_is_shifted_is_judged() -> None:
    assert judgement_of("clocks.span", as_recording(with_shift("pose", 500 * MS))).result.outcome == "failed"
