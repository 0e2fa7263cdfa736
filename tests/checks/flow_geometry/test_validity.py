"""Flow has values exactly where it must, over intervals that lie on frames: every pixel and every stamp is counted."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.flow_geometry.interval_timestamps import timestamp_statistics
from fedora_qa.checks.flow_geometry.validity import FlowGeometryValidity
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm, Judged
from fedora_qa.sequence.facts import Clock, Facts
from tests.support.facts import MS
from tests.support.flow_world import FlowWorld, judged, make_world, observe

HOLE = (slice(None), slice(20, 30), slice(40, 60))


@cache
def clean() -> FlowWorld:
    """A file with a hole in the depth, 200 pixels of each frame, and the same hole in every field."""
    world = make_world((25, 50))
    depth = world.rows_by_key["path/depth"].copy()
    depth[HOLE] = np.nan

    def pierced(_: str, flow: np.ndarray) -> np.ndarray:
        flow = flow.copy()
        flow[HOLE] = np.nan
        return flow

    return world.with_rows(path_depth=depth).with_flow(pierced)


def alarm_of(result: Judged, rule: str) -> Alarm:
    return next(a for a in result.alarms if a.finding.code == f"flow_geometry.validity.{rule}")


def most_probable_cause(alarm: Alarm) -> Hypothesis:
    return hypotheses_of(alarm, clean().facts)[0]


def value_of(result: Judged, name: str) -> float | None:
    return next(m.value for m in result.result.measurements if m.name == name)


def with_timestamps(world: FlowWorld, change: object) -> FlowWorld:
    clocks = {
        name: change(c) if c.ends_ns is not None else c  # type: ignore[operator]
        for name, c in world.facts.clocks.items()
    }
    return replace(world, facts=replace(world.facts, clocks=clocks))


def test_clean_file_passes() -> None:
    """Holes that flow and depth share are no fault."""
    assert judged(FlowGeometryValidity(), clean()).result.outcome == "passed"


def test_values_in_holes_are_counted_and_placed() -> None:
    """Zeros instead of NaN: 200 pixels a field, the first at its place, the encoding named."""
    filled = clean().with_flow(lambda _, flow: np.nan_to_num(flow))
    result = judged(FlowGeometryValidity(), filled)
    assert value_of(result, "values_without_depth") == 200 * 30
    alarm = alarm_of(result, "unfounded")
    assert alarm.finding.where.pixel == (40, 20)
    hypothesis = most_probable_cause(alarm)
    assert (hypothesis.cause, hypothesis.stream) == ("invalid_encoding", "flow")


def test_values_that_lead_out_of_any_image_are_an_encoding() -> None:
    """Varied values longer than the diagonal were made of no depth: they are what stands for unknown flow."""
    random = np.random.default_rng(0)
    filled = clean().with_flow(
        lambda _, flow: np.where(np.isnan(flow), random.uniform(1000, 1100, flow.shape), flow).astype(flow.dtype)
    )
    hypothesis = most_probable_cause(alarm_of(judged(FlowGeometryValidity(), filled), "unfounded"))
    assert (hypothesis.cause, hypothesis.stream) == ("invalid_encoding", "flow")


def test_flow_where_a_depth_was_lost_is_no_encoding() -> None:
    """Values that differ from pixel to pixel were made of a depth: that has lost its own, and flow is as it was."""
    depth = clean().rows_by_key["path/depth"].copy()
    depth[4:6, 60:80, 60:90] = np.nan
    alarm = alarm_of(judged(FlowGeometryValidity(), clean().with_rows(path_depth=depth)), "unfounded")
    hypothesis = most_probable_cause(alarm)
    assert (hypothesis.cause, hypothesis.stream) == ("nan_in_stream", "depth")


def test_missing_values_are_counted() -> None:
    """NaN over valid depth in two fields of one rate."""

    def spoilt(stream: str, flow: np.ndarray) -> np.ndarray:
        flow = flow.copy()
        if stream == "flow/25hz":
            flow[2:4, :5, :7] = np.nan
        return flow

    result = judged(FlowGeometryValidity(), clean().with_flow(spoilt))
    assert value_of(result, "missing_values") == 2 * 5 * 7
    alarm = alarm_of(result, "missing")
    hypothesis = most_probable_cause(alarm)
    assert (hypothesis.cause, hypothesis.stream) == ("nan_in_stream", "flow/25hz")
    assert (alarm.finding.where.index_start, alarm.finding.where.index_stop) == (2, 4)


@pytest.mark.parametrize(
    ("columns_a_frame", "cause"), [(1, ("invalid_encoding", "depth")), (0, ("nan_in_stream", "flow"))]
)
def test_values_that_every_rate_lacks_elsewhere_in_each_frame_are_of_depth(
    columns_a_frame: int, cause: tuple[str, str]
) -> None:
    """They were made from a depth that had none there; a border, which stays as the camera moves, is the flow's."""
    sequence = clean()
    clocks = sequence.facts.clocks

    def spoilt(stream: str, flow: np.ndarray) -> np.ndarray:
        flow = flow.copy()
        for row, start_ns in enumerate(clocks[stream].times_ns):
            left = columns_a_frame * int(np.searchsorted(clocks["depth"].times_ns, start_ns))
            flow[row, :5, left : left + 7] = np.nan
        return flow

    hypothesis = most_probable_cause(alarm_of(judged(FlowGeometryValidity(), sequence.with_flow(spoilt)), "missing"))
    assert (hypothesis.cause, hypothesis.stream) == cause


def test_infinite_values_are_counted() -> None:
    """Infinity is no way to say that there is no value."""
    result = judged(FlowGeometryValidity(), clean().with_flow(lambda _, flow: np.nan_to_num(flow, nan=np.inf)))
    assert value_of(result, "infinite_values") == 200 * 30


def test_points_behind_the_camera_must_have_no_value() -> None:
    """Depth a thousand times too small puts all points behind the moving camera; the depth is suspected."""
    shallow = clean().with_rows(path_depth=clean().rows_by_key["path/depth"] / np.float32(1000))
    alarm = alarm_of(judged(FlowGeometryValidity(), shallow), "unfounded")
    hypothesis = most_probable_cause(alarm)
    assert (hypothesis.cause, hypothesis.stream) == ("unit_mm_m", "depth")


def test_without_poses_missing_values_are_left_open() -> None:
    """Only a pose tells whether a point stays before the camera."""
    world = clean().without("pose").with_flow(lambda _, flow: np.full_like(flow, np.nan))
    assert judged(FlowGeometryValidity(), world).result.outcome == "passed"


def late(c: Clock) -> Clock:
    assert c.ends_ns is not None
    return replace(c, times_ns=c.times_ns + 5 * MS, ends_ns=c.ends_ns + 5 * MS)


def fast(c: Clock) -> Clock:
    assert c.ends_ns is not None
    return replace(c, times_ns=c.times_ns + c.times_ns // 1000, ends_ns=c.ends_ns + c.ends_ns // 1000)


def one_dropped(c: Clock) -> Clock:
    assert c.ends_ns is not None
    kept = np.arange(len(c.times_ns)) != 4
    return Clock(c.times_ns[kept], c.ends_ns[kept], c.advancing[kept])


def slow_for_50_hz(c: Clock) -> Clock:
    assert c.ends_ns is not None
    return replace(c, ends_ns=np.maximum(c.ends_ns, c.times_ns + 40 * MS))


def quantised(c: Clock) -> Clock:
    assert c.ends_ns is not None
    grid = 7 * MS
    return replace(c, times_ns=(c.times_ns + grid // 2) // grid * grid, ends_ns=(c.ends_ns + grid // 2) // grid * grid)


def second_half(change: Callable[[Clock], Clock]) -> Callable[[Clock], Clock]:
    """The change, of the later half of the intervals only."""

    def changed(c: Clock) -> Clock:
        half = len(c.times_ns) // 2
        part = change(Clock(c.times_ns[half:], None if c.ends_ns is None else c.ends_ns[half:], c.advancing[half:]))
        assert c.ends_ns is not None
        assert part.ends_ns is not None
        return replace(
            c,
            times_ns=np.concatenate((c.times_ns[:half], part.times_ns)),
            ends_ns=np.concatenate((c.ends_ns[:half], part.ends_ns)),
        )

    return changed


def exchanged(c: Clock) -> Clock:
    assert c.ends_ns is not None
    order = np.arange(len(c.times_ns))
    order[[3, 4]] = order[[4, 3]]
    return replace(c, times_ns=c.times_ns[order], ends_ns=c.ends_ns[order], advancing=order >= np.arange(len(order)))


TIMESTAMP_FAULTS = {
    "quantised": (quantised, "off_frames", "quantised_time", 7.0),
    "half late": (second_half(late), "off_frames", "time_offset", 5.0),
    "half late, where it begins": (second_half(late), "not_abutting", "time_offset", 5.0),
    "half fast": (second_half(fast), "off_frames", "clock_rate", 1000.0),
    "unsorted": (exchanged, "not_abutting", "unsorted", 1.0),
    "late": (late, "off_frames", "time_offset", 5.0),
    "fast": (fast, "off_frames", "clock_rate", 1000.0),
    "dropped": (one_dropped, "not_abutting", "dropped_samples", 1.0),
    "too long": (slow_for_50_hz, "wrong_length", "flow_rate_mixed", None),
}


@pytest.mark.parametrize(("change", "rule", "cause", "size"), TIMESTAMP_FAULTS.values(), ids=TIMESTAMP_FAULTS)
def test_fault_of_the_timestamps_is_named(change: object, rule: str, cause: str, size: float | None) -> None:
    """Intervals off frames, gaps and wrong lengths are named and sized; what befalls all rates befalls flow."""
    hypothesis = most_probable_cause(alarm_of(judged(FlowGeometryValidity(), with_timestamps(clean(), change)), rule))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "flow/50hz" if cause == "flow_rate_mixed" else "flow")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.02)


def test_intervals_are_not_rounded_to_their_own_length() -> None:
    """Those that abut keep to a grid of their length, however late they are."""
    late_flow = alarm_of(judged(FlowGeometryValidity(), with_timestamps(clean(), late)), "off_frames")
    assert "quantised_time" not in {h.cause for h in hypotheses_of(late_flow, clean().facts) if h.stream == "flow"}


def test_late_depth_is_told_from_late_flow() -> None:
    """Where flow begins on colour frames and not on depth frames, depth is late."""
    facts = clean().facts
    depth = facts.clocks["depth"]
    clocks = {**facts.clocks, "depth": replace(depth, times_ns=depth.times_ns + 3 * MS)}
    result = judged(FlowGeometryValidity(), replace(clean(), facts=replace(facts, clocks=clocks)))
    hypothesis = max(hypotheses_of(alarm_of(result, "off_frames"), facts), key=lambda hypothesis: hypothesis.support)
    assert (hypothesis.cause, hypothesis.stream) == ("time_offset", "depth")
    assert hypothesis.magnitude == pytest.approx(3.0)


@pytest.mark.parametrize("with_colour", [True, False], ids=["colour", "no colour"])
@pytest.mark.parametrize("kept", [slice(None, None, 2), slice(1, None), slice(None, -1)], ids=["half", "late", "early"])
def test_sparse_depth_is_no_reason_for_an_alarm(kept: slice, with_colour: bool) -> None:
    """Depth at half the rate of colour, or of flow, or that begins late or ends early, leaves flow where it was."""
    facts = clean().facts
    depth = facts.clocks["depth"]
    clocks = {**facts.clocks, "depth": replace(depth, times_ns=depth.times_ns[kept], advancing=depth.advancing[kept])}
    if not with_colour:
        del clocks["rgb"]
    off_frames = [s for s in timestamp_statistics(replace(facts, clocks=clocks)) if s.code.endswith("off_frames")]
    assert off_frames
    assert all(statistic.value == 0 for statistic in off_frames)


def broken(facts: Facts) -> Facts:
    depth = facts.clocks["depth"]
    stopped = Clock(np.zeros_like(depth.times_ns), None, np.arange(len(depth.times_ns)) == 0)
    return replace(facts, clocks={**facts.clocks, "depth": stopped})


def test_broken_depth_clock_is_not_observable() -> None:
    """Frames that share one stamp cannot be placed."""
    observation = observe(FlowGeometryValidity(), replace(clean(), facts=broken(clean().facts)))
    assert "do not increase" in observation.unobservable
