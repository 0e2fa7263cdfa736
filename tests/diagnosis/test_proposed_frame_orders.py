"""Frames in the place of others: losses, delays and exchanges that are proposed."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.depth.consistency import PairsOff
from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.images.order import DisplacedFrames, OutOfOrderIntervals
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.name_order import FramesInOrderOfNames
from fedora_qa.faults.row_order import DelayedFrames, RotatedFrames, SwappedFrames
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import alarm, pairs_alarm


@pytest.mark.parametrize(
    ("missing", "ratio", "counts"), [(2, 3.1, (2,)), (2, 2.2, (2, 1)), (0, 3.1, (2,))], ids=["both", "far", "padded"]
)
def test_frames_behind_a_loss_are_undone_as_early(missing: int, ratio: float, counts: tuple[int, ...]) -> None:
    """Frames were lost before frame 2 and the others renumbered: they are early by the periods that the end lacks.

    A displacement over several intervals may be measured too short; a file may be cut to its shortest stream.
    """
    facts = facts_of(memory_sequence())
    clock = facts.clocks["rgb"]
    kept = replace(clock, times_ns=clock.times_ns[: len(clock.times_ns) - missing])
    lost = replace(facts, clocks={**facts.clocks, "rgb": kept})
    moves_on = OutOfOrderIntervals((ratio,), frames_return=False, isolated=True)
    of_order = alarm("images.order.share", moves_on)
    of_order = replace(of_order, finding=replace(of_order.finding, where=Where(stream="rgb", frame=2)))
    period_ns = float(np.median(np.diff(clock.times_ns)))
    first, second = hypotheses_of(of_order, lost)[:2]
    assert (first.cause, first.magnitude) == ("time_offset", -counts[0] * period_ns / NS_PER_MS)
    assert (second.cause, second.magnitude) == ("dropped_samples", counts[0])
    *parts, whole = faults_for("time_offset", "rgb", first.magnitude, (of_order,), {}, lost)
    assert parts == [ClockShift("rgb", -count * period_ns, (2, None)) for count in counts]
    assert whole == ClockShift("rgb", -counts[0] * period_ns)


def test_colour_of_other_frames_for_a_while_is_undone_there() -> None:
    """Frames that hold the values of the one before them are given back, as many as lie between the intervals."""
    facts = facts_of(memory_sequence())
    period_ms = float(np.median(np.diff(facts.clocks["rgb"].times_ns))) / NS_PER_MS
    failure = alarm("images.order.share", OutOfOrderIntervals((0.0, 2.0), False, True, DisplacedFrames(2, 4, 1)))
    fault = next(iter(faults_for("time_offset", "rgb", period_ms, [failure], {}, facts)))
    assert fault == DelayedFrames(1, period_ms, (2, 4), "rgb")
    restored = fault.undo(facts, memory_sequence()).rows["path/rgb"]
    sequence = memory_sequence()
    stored = np.asarray(sequence.rows("path/rgb", 0, facts.sizes["path/rgb"]))
    frames = restored(lambda first, last: stored[first:last], 0, len(stored))
    np.testing.assert_array_equal(frames[2], stored[3])
    # The one that was lost lies between those around it.
    np.testing.assert_allclose(frames[3], (stored[3].astype(float) + stored[4]) / 2, atol=0.5)
    np.testing.assert_array_equal(np.delete(frames, [2, 3], axis=0), np.delete(stored, [2, 3], axis=0))


@pytest.mark.parametrize(
    "intervals",
    [
        OutOfOrderIntervals((2.0,), frames_return=True, isolated=False),
        OutOfOrderIntervals((-1.0,), frames_return=False, isolated=True),
        OutOfOrderIntervals((3.0, 3.1), frames_return=False, isolated=True),
        OutOfOrderIntervals((3.0,), frames_return=None, isolated=True),
    ],
    ids=["returns", "backwards", "twice", "not measured"],
)
def test_other_frames_out_of_order_were_not_renumbered(intervals: OutOfOrderIntervals) -> None:
    """A frame that returns to its place, or an image that is moved, leaves the others where they are."""
    facts, of_order = facts_of(memory_sequence()), alarm("images.order.share", intervals)
    of_order = replace(of_order, finding=replace(of_order.finding, where=Where(stream="rgb", frame=2)))
    assert all(hypothesis.cause != "time_offset" for hypothesis in hypotheses_of(of_order, facts))
    assert list(faults_for("time_offset", "rgb", 3.0, (of_order,), {}, facts)) == [ClockShift("rgb", 3.0 * NS_PER_MS)]


def fields_alarm(rate: str, facts: Facts, first: int, last: int) -> Alarm:
    """Fields of a rate deviate, from the first row to the last."""
    times_ns = facts.clocks[rate].times_ns
    count = last - first + 1
    extent = FieldsOff(count, count / len(times_ns), False, 0, 0, None, int(times_ns[first]), int(times_ns[last]))
    failure = alarm("flow_geometry.endpoint.error", extent)
    return replace(failure, finding=replace(failure.finding, where=Where(stream=rate)))


def test_fields_of_flow_state_the_part_of_depth_where_noise_of_the_poses_hides_pairs() -> None:
    """Fields begin at the depth frames that are wrong."""
    facts = facts_of(memory_sequence())
    rate = max(facts.flow_streams, key=lambda stream: len(facts.clocks[stream].times_ns))
    failure = fields_alarm(rate, facts, 1, 2)
    times_ns = facts.clocks["depth"].times_ns
    first, last = np.searchsorted(times_ns, facts.clocks[rate].times_ns[[1, 2]]).tolist()
    period_ms = float(np.median(np.diff(times_ns))) / NS_PER_MS
    fault = next(iter(faults_for("time_offset", "depth", period_ms, [failure], {}, facts)))
    assert fault == DelayedFrames(1, period_ms, (first, last + 1))
    of_pairs_alone = next(iter(faults_for("time_offset", "depth", period_ms, [failure, pairs_alarm(1, 3)], {}, facts)))
    assert of_pairs_alone == DelayedFrames(1, period_ms, (2, 3))


def test_frames_are_put_in_the_order_of_their_numbers_where_their_text_has_another() -> None:
    """Of depth only where most pairs deviate, of colour only where displacements of the frames are out of order."""
    facts = facts_of(memory_sequence())
    depth = facts.clocks["depth"]
    times_ns = depth.times_ns[0] + 20 * NS_PER_MS * np.arange(12)
    many = replace(depth, times_ns=times_ns, advancing=np.ones(12, bool))
    facts = replace(facts, clocks={**facts.clocks, "depth": many, "rgb": many})
    by_names = [FramesInOrderOfNames("depth", 0), FramesInOrderOfNames("depth", 1)]
    most = alarm("depth.consistency.frame", PairsOff(9, 11, 0))
    assert list(faults_for("swapped_frames", "depth", 1.0, [most], {}, facts))[:2] == by_names
    few, of_events = alarm("depth.consistency.frame", PairsOff(3, 11, 0)), alarm("event_response.conservation.pixels")
    for stream, failure in (("depth", few), ("rgb", of_events)):
        others = faults_for("swapped_frames", stream, 1.0, [failure], {}, facts)
        assert not any(isinstance(fault, FramesInOrderOfNames) for fault in others)


def test_frames_of_a_part_are_undone_as_a_ring_by_the_fitted_distance() -> None:
    """In both directions, before neighbours are exchanged; a distance beyond the part is none of its frames."""
    facts = facts_of(memory_sequence())
    first, second, *_ = faults_for("swapped_frames", "depth", 1.0, [pairs_alarm(1, 4)], {}, facts)
    assert (first, second) == (RotatedFrames("depth", (2, 4), -1), RotatedFrames("depth", (2, 4), 1))
    too_far = faults_for("swapped_frames", "depth", 2.0, [pairs_alarm(1, 4)], {}, facts)
    assert not any(isinstance(fault, RotatedFrames) for fault in too_far)


def test_frames_at_both_ends_of_what_is_out_of_order_are_exchanged_first() -> None:
    """Then all neighbours in pairs, as of two renderers that take turns."""
    facts = facts_of(memory_sequence())
    times_ns = facts.clocks["rgb"].times_ns
    failure = alarm("images.order.share", OutOfOrderIntervals((2.0, -1.0, 2.0), True, False))
    place = Where(stream="rgb", start_us=facts.to_file_us(int(times_ns[1])), stop_us=facts.to_file_us(int(times_ns[2])))
    failure = replace(failure, finding=replace(failure.finding, where=place))
    pair, neighbours = faults_for("swapped_frames", "rgb", 1.0, [failure], {}, facts)
    assert pair == SwappedFrames("rgb", ((1, 2),))
    assert isinstance(neighbours, SwappedFrames)
    assert neighbours.pairs[:2] == ((0, 1), (2, 3))
