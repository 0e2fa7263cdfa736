"""Offsets and rates of clocks that are proposed, of the whole file and of a part."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.event_response.timing import DelayedSegment
from fedora_qa.checks.flow_geometry.interval_timestamps import TimestampPattern
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.clocks import ClockRate, ClockShift
from fedora_qa.faults.fault import is_of_part
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import clock_of
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import alarm


@pytest.mark.parametrize(("offset_ms", "other_ms"), [(2.0, -18.0), (-9.0, 11.0)])
def test_an_offset_from_frames_is_known_up_to_their_step(offset_ms: float, other_ms: float) -> None:
    """Depth frames are 20 ms apart: 18 ms early looks like 2 ms late. Offsets that events measure are no such ones."""
    facts = facts_of(memory_sequence())
    steps_ms = np.diff(facts.clocks["depth"].times_ns) / NS_PER_MS
    np.testing.assert_array_equal(steps_ms, 20.0)
    from_frames = alarm("flow_geometry.validity.off_frames", TimestampPattern("constant", offset_ms, 1.0, "depth"))
    for alarms, sizes_ms in (((from_frames,), [offset_ms, other_ms]), ((), [offset_ms])):
        faults = faults_for("time_offset", "depth", offset_ms, alarms, {}, facts)
        assert [fault.magnitude for fault in faults] == pytest.approx(sizes_ms)


@pytest.mark.parametrize("stream", ["imu", "pose", "depth"])
def test_an_offset_of_a_part_of_a_clock_is_undone_there_first(stream: str) -> None:
    """The rows that left the line of the clock have the median of their offsets; the whole clock comes second."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks[stream]
    times_ns = clock.times_ns.copy()
    first, stop = len(times_ns) // 3, len(times_ns) // 2 + 1
    times_ns[first:stop] += 70_000
    moved = replace(facts, clocks={**facts.clocks, stream: replace(clock, times_ns=times_ns)})
    local, whole = faults_for("time_offset", stream, 0.05, (), {}, moved)
    assert (local, whole) == (ClockShift(stream, 70_000.0, (first, stop)), ClockShift(stream, 50_000.0))
    assert list(faults_for("time_offset", stream, 0.05, (), {}, facts)) == [whole]


@pytest.mark.parametrize("periods", [-0.4, 0.3, 3])
def test_a_step_of_a_clock_is_undone_on_either_side(periods: float) -> None:
    """Whole periods are a gap of lost samples, unless the IMU contradicts the poses; all else is no gap."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    step_ns, row = round(periods * int(np.median(np.diff(clock.times_ns)))), len(clock.times_ns) // 3
    times_ns = clock.times_ns + step_ns * (np.arange(len(clock.times_ns)) >= row)
    moved = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    whole = ClockShift("imu", 2.0 * NS_PER_MS)
    steps = [ClockShift("imu", step_ns, (row, None)), ClockShift("imu", -step_ns, (0, row))]
    gap, contradiction = alarm("clocks.gaps.missing"), alarm("imu.timing.time_offset")
    assert list(faults_for("time_offset", "imu", 2.0, (gap, contradiction), {}, moved)) == [*steps, whole]
    tried = list(faults_for("time_offset", "imu", 2.0, (gap,), {}, moved))
    assert not set(steps) & set(tried)
    assert whole in tried


def test_a_silence_is_a_step_of_the_clock_where_events_are_late() -> None:
    """Behind the silence events are late, or before it early. Without a delay they were lost."""
    facts = facts_of(memory_sequence())
    silence = alarm("event_stream.gaps.silence")
    place = Where("events", facts.to_file_us(30_000_000), facts.to_file_us(36_000_000))
    silence = replace(
        silence, finding=replace(silence.finding, where=place), statistic=replace(silence.statistic, value=6.0)
    )
    late = ClockShift("events", 6_000_000, while_ns=(30_000_000, None))
    early = ClockShift("events", -6_000_000, while_ns=(None, 36_000_001))
    delay = alarm("event_response.timing.offset", DelayedSegment(5.8, 0.2, 28_000_000, None))
    by_delay = ClockShift("events", 5.8 * NS_PER_MS, while_ns=(28_000_000, None))
    whole = ClockShift("events", 6.0 * NS_PER_MS)
    assert list(faults_for("time_offset", "events", 6.0, (silence, delay), {}, facts)) == [late, early, by_delay, whole]
    assert list(faults_for("time_offset", "events", 6.0, (silence,), {}, facts)) == [whole]


@pytest.mark.parametrize("stream", ["rgb", "depth"])
def test_a_clock_that_is_late_by_varying_times_is_made_regular_first(stream: str) -> None:
    """Frames that are stamped when they are recorded are 6 ms late, and up to 3 ms more. Those of a drift are not."""
    facts = facts_of(memory_sequence())
    times_ns = facts.clocks[stream].times_ns[0] + 20_000_000 * np.arange(26)
    late_ns = 6_000_000 + 1000 * (np.arange(len(times_ns)) * 7919 % 3001)
    recorded = replace(facts, clocks={**facts.clocks, stream: clock_of(times_ns + late_ns, None)})
    first, whole = faults_for("time_offset", stream, 7.0, (), {}, recorded)
    assert isinstance(first, ClockShift)
    assert (first.offset_ns, first.regular_ns) == (float(np.median(late_ns)), (float(times_ns[0]), 20e6))
    assert whole == ClockShift(stream, 7.0 * NS_PER_MS)
    drifting = replace(facts, clocks={**facts.clocks, stream: clock_of(times_ns * 1003 // 1000, None)})
    assert list(faults_for("time_offset", stream, 7.0, (), {}, drifting)) == [whole]


def test_a_rate_of_a_part_of_a_clock_is_undone_there_first() -> None:
    """A part of the IMU that runs 1000 ppm fast is slowed from its first rows on: all lie on the clock's line again."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    times_ns, rows = clock.times_ns.copy(), slice(20, len(clock.times_ns) // 2)
    times_ns[rows] += np.rint(1e-6 * (times_ns[rows] - times_ns[rows.start])).astype(np.int64) * 1000
    moved = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    local, *whole = faults_for("clock_rate", "imu", 300.0, (), {}, moved)
    assert isinstance(local, ClockRate)
    assert local.rate_error_ppm == pytest.approx(1000.0, rel=0.1)
    assert local.rows is not None
    assert (local.rows[0], local.rows[1]) == (pytest.approx(rows.start, abs=2), rows.stop)
    undo = local.undo(moved, memory_sequence()).rows[timestamps_of("imu")]
    undone_ns = undo(lambda start, stop: times_ns[start:stop], 0, len(times_ns))
    np.testing.assert_allclose(undone_ns, clock.times_ns, rtol=0, atol=1500)
    assert len(whole) == len(list(faults_for("clock_rate", "imu", 300.0, (), {}, facts)))


def test_a_slew_is_undone_with_the_offset_that_it_leaves() -> None:
    """An IMU whose clock runs 20000 ppm fast for a third of the file, and stays ahead, is undone as a part."""
    facts = facts_of(memory_sequence())
    clock = facts.clocks["imu"]
    first_ns, last_ns = int(clock.times_ns[0]), int(clock.times_ns[-1])
    start_ns, duration_ns = first_ns + (last_ns - first_ns) // 4, (last_ns - first_ns) // 3
    gained_ns = 0.02 * np.clip(clock.times_ns - start_ns, 0, duration_ns)
    times_ns = clock.times_ns + 1000 * np.rint(gained_ns / 1000).astype(np.int64)
    slewed = replace(facts, clocks={**facts.clocks, "imu": replace(clock, times_ns=times_ns)})
    local, *whole = faults_for("clock_rate", "imu", 300.0, (), {}, slewed)
    assert isinstance(local, ClockRate)
    assert is_of_part(local)
    assert local.rate_error_ppm == pytest.approx(20_000.0, rel=0.01)
    undo = local.undo(slewed, memory_sequence()).rows[timestamps_of("imu")]
    undone_ns = undo(lambda start, stop: times_ns[start:stop], 0, len(times_ns))
    np.testing.assert_allclose(undone_ns, clock.times_ns, rtol=0, atol=2000)
    assert len(whole) == len(list(faults_for("clock_rate", "imu", 300.0, (), {}, facts)))
    # No part of it has an offset of its own.
    assert not any(is_of_part(fault) for fault in faults_for("time_offset", "imu", 1.0, (), {}, slewed))
