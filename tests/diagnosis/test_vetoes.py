"""Measurements that are in order contradict a cause only where they would have measured it."""

from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np
import pytest

from fedora_qa.checks.event_response.conservation import Violations
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.clock_grids import ClockPlace, Place, places_of_clocks
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.measured_sizes import flow_offset_ms
from fedora_qa.diagnosis.vetoes import contradicts, disturbs_too_few
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Measurement, Outcome, Result, Where
from fedora_qa.sequence.facts import Facts, clock_of
from tests.support.memory_sequence import MS, facts_of, memory_sequence


@pytest.mark.parametrize(("length_m", "is_contradicted"), [(1.6e-5, False), (1.8e-5, True)])
def test_a_jump_may_lie_where_the_motion_hides_it_best(length_m: float, is_contradicted: bool) -> None:
    """A jump has three components, each of which is known to 10 um where the body turns most: sqrt(3) 10 um = 17 um."""
    jump = Measurement("position_jump", 1e-7, "m", 4e-7, 0.0, 6e-6, 8e-6, tests=90, least_detectable_range=(3e-6, 1e-5))
    results = {"pose.continuity": Result("pose.continuity", "passed", "continuous", measurements=(jump,))}
    assert contradicts("teleport", "pose", length_m, results, {}) == is_contradicted


def test_jumps_that_fail_contradict_no_teleport() -> None:
    jump = Measurement("position_jump", 1e-3, "m", 4e-7, 0.0, 6e-6, 8e-6)
    results = {"pose.continuity": Result("pose.continuity", "failed", "jumps", measurements=(jump,))}
    assert not contradicts("teleport", "pose", 1e-3, results, {})


@pytest.mark.parametrize(
    ("stream", "length_m", "is_contradicted"),
    [
        ("pose", 0.006, True),
        ("imu", 0.006, True),
        ("metadata", 0.006, False),
        ("pose", 0.0005, False),
        ("metadata", 0.0005, True),
        ("metadata", 0.0006, False),
    ],
)
def test_the_arm_of_the_imu_decides_between_poses_and_cameras(
    stream: str, length_m: float, is_contradicted: bool
) -> None:
    """An arm of (0.3, -0.4, 0) mm with limits of 1 mm: 6 mm are of the cameras, and 0.5 mm of the poses."""
    arm_m = {"x": 3e-4, "y": -4e-4, "z": 0.0}
    measurements = tuple(Measurement(f"lever_{k}", part, "m", 1e-6, 0.0, 1e-3, 2e-3) for k, part in arm_m.items())
    results = {"imu.translation": Result("imu.translation", "passed", "in order", measurements=measurements)}
    assert contradicts("lever_arm", stream, length_m, results, {}) == is_contradicted
    assert not contradicts("lever_arm", stream, length_m, {}, {})


@pytest.mark.parametrize("stream", ["depth", "pose"])
def test_depths_that_agree_with_the_path_have_its_unit(stream: str) -> None:
    """In their declared range; where any of the three checks does not pass, a unit may be wrong."""
    checks = ("depth.scale", "depth.range", "depth.consistency")
    results = {check: Result(check, "passed", "in order") for check in checks}
    assert contradicts("unit_mm_m", stream, 1000.0, results, {})
    for check in checks:
        assert not contradicts("unit_mm_m", stream, 1000.0, {**results, check: Result(check, "failed", "off")}, {})
        assert not contradicts("unit_mm_m", stream, 1000.0, {k: v for k, v in results.items() if k != check}, {})


def test_positions_that_jump_may_have_another_unit_in_a_part() -> None:
    """Depth between two parts in other units is not compared, and passes for the rest."""
    results = {
        check: Result(check, "passed", "in order") for check in ("depth.scale", "depth.range", "depth.consistency")
    }
    code = "pose.continuity.position"
    jump = Result("pose.continuity", "failed", "off", findings=(Finding("F1", code, "error", "off", Where()),))
    assert contradicts("unit_mm_m", "pose", 100.0, results, {})
    assert not contradicts("unit_mm_m", "pose", 100.0, {**results, "pose.continuity": jump}, {})


def places_of(facts: Facts) -> dict[str, Place]:
    return {stream: clock.place for stream, clock in places_of_clocks(facts).items()}


def moved(stream: str, offset_ns: int, rows: slice = slice(None)) -> Facts:
    """Facts of a sequence of which some timestamps of a stream have an offset."""
    facts = facts_of(memory_sequence())
    times_ns = facts.clocks[stream].times_ns.copy()
    times_ns[rows] += offset_ns
    return replace(facts, clocks={**facts.clocks, stream: clock_of(times_ns, None)})


def test_clean_clocks_are_in_place() -> None:
    """Frames, IMU and poses of one grid; events have none."""
    places = places_of(facts_of(memory_sequence()))
    assert places.keys() == {"rgb", "depth", "flow", "imu", "pose"}
    assert set(places.values()) == {"in"}


@pytest.mark.parametrize("stream", ["rgb", "depth", "imu", "pose"])
@pytest.mark.parametrize("offset_ns", [1000, 370_000, -2_013_000])
def test_a_moved_clock_is_out_and_the_others_are_in(stream: str, offset_ns: int) -> None:
    """From one microsecond on."""
    places = places_of(moved(stream, offset_ns))
    assert places.pop(stream) == "out"
    assert set(places.values()) == {"in"}


def test_a_moved_frame_is_enough() -> None:
    """A clock of which one frame is late is not in place, so that nothing contradicts its offset."""
    assert places_of(moved("rgb", 3 * MS + 1000, slice(3, 4)))["rgb"] == "out"


def test_two_clocks_alone_do_not_tell() -> None:
    """Which of two is wrong is unknown; and so it is where no two others agree."""
    facts = moved("rgb", 1000)
    two = replace(facts, clocks={stream: facts.clocks[stream] for stream in ("rgb", "depth")})
    assert set(places_of(two).values()) == {"unknown"}
    random = np.random.default_rng(0)
    scattered = {
        stream: clock_of(clock.times_ns + int(random.integers(1, MS // 2)) * (place + 1), None)
        for place, (stream, clock) in enumerate(facts.clocks.items())
    }
    assert "in" not in places_of(replace(facts, clocks=scattered)).values()


def test_whole_periods_leave_a_clock_on_its_grid() -> None:
    """Depth one frame late lies on the grid of the frames: only other offsets are excluded."""
    depth = places_of_clocks(moved("depth", 20 * MS))["depth"]
    assert (depth.place, depth.period_ms) == ("in", 20.0)
    assert not depth.excludes(20.0)
    assert not depth.excludes(-39.9)
    assert all(depth.excludes(offset_ms) for offset_ms in (2.0, 13.0, -21.0, 0.1, None))
    assert not ClockPlace("unknown", 20.0).excludes(2.0)


def test_streams_that_left_the_grid_together_are_out() -> None:
    """Colour and depth of one renderer 6.4 ms late, by as much: flow, IMU and poses are the most that share a grid."""
    late = moved("rgb", 6_415_000)
    for offset_ns, place in ((6_415_000, "out"), (3_111_000, "unknown")):
        both = replace(late, clocks={**late.clocks, "depth": moved("depth", offset_ns).clocks["depth"]})
        assert places_of(both) == {"rgb": place, "depth": place, "flow": "in", "imu": "in", "pose": "in"}


def test_a_frame_on_the_grid_of_the_poses_alone_is_out() -> None:
    """Colour 5 ms late: still at poses (200 Hz) and samples of the IMU (1000 Hz), not at depth and flow."""
    places = places_of(moved("rgb", 5 * MS))
    assert places.pop("rgb") == "out"
    assert set(places.values()) == {"in"}


@pytest.mark.parametrize("stream", ["imu", "pose"])
@pytest.mark.parametrize(
    ("off_percent", "limit_percent", "is_contradicted"),
    [(-4.3, 0.8, True), (0.1, 0.1, True), (101.0, 104.0, False), (-2.0, 30.0, False), (-40.0, 1.0, False)],
)
def test_a_gyro_that_turns_as_the_poses_do_is_of_their_flight(
    stream: str, off_percent: float, limit_percent: float, *, is_contradicted: bool
) -> None:
    """However many parameters fail; against another flight the gain is 0 or not determined."""
    gain = Measurement("scale", off_percent, "percent", 0.1, 0.0, limit_percent, 0.2)
    results = {"imu.rotation": Result("imu.rotation", "failed", "off", measurements=(gain,))}
    assert contradicts("other_sequence", stream, None, results, {}) == is_contradicted
    assert not contradicts("other_sequence", "rgb", None, results, {})


@pytest.mark.parametrize(
    ("off_percent", "limit_percent", "residual", "is_contradicted"),
    [
        (8.7, 8.8, 4.8, True),
        (8.7, 70.0, 4.8, False),
        (8.7, 8.8, 7.0, False),
        (-65.7, 25.0, 4.8, False),
        (144.0, 8.0, 4.8, False),
    ],
    ids=["noise is left", "gain unknown", "motion is left", "turns too little", "turns too much"],
)
def test_a_gyro_that_leaves_noise_alone_is_of_the_flight_of_noisy_poses(
    off_percent: float, limit_percent: float, residual: float, *, is_contradicted: bool
) -> None:
    """Noise widens the limit of the gain; two short flights are fitted with any gain."""
    gain = Measurement("scale", off_percent, "percent", 1.6, 0.0, limit_percent, 9.0)
    left = (
        Measurement("rotation_residual", residual, "mrad", 0.2, 4.9, 1.1, 1.2),
        Measurement("worst_rotation", -18.0, "mrad", 4.9, 0.0, 26.0, 27.0),
    )
    results = {"imu.rotation": Result("imu.rotation", "failed", "off", measurements=(gain, *left))}
    for stream in ("imu", "pose"):
        assert contradicts("other_sequence", stream, None, results, {}) == is_contradicted


@pytest.mark.parametrize(
    ("off_percent", "ratio", "limit", "is_contradicted"),
    [(-43.0, 1.02, 0.18, True), (-43.0, 1.8, 0.18, False), (-43.0, 1.3, 0.9, False), (-10.0, 1.02, 0.18, False)],
    ids=["declared", "larger", "not decided", "within limits"],
)
def test_flow_with_corrections_of_the_declared_noise_contradicts_another_noise(
    off_percent: float, ratio: float, limit: float, *, is_contradicted: bool
) -> None:
    """Depth that asks for larger corrections of the poses than flow does is wrong itself."""
    correction = Measurement("flow/50hz pose_correction", ratio, "1", 0.04, 1.0, limit, 2 * limit)
    results = {"flow_geometry.endpoint": Result("flow_geometry.endpoint", "failed", "off", measurements=(correction,))}
    assert contradicts("noise_misdeclared", "pose", off_percent, results, {}) == is_contradicted
    assert not contradicts("noise_misdeclared", "imu", off_percent, results, {})


@pytest.mark.parametrize("stream", ["events", "rgb"])
@pytest.mark.parametrize(
    ("correlation", "advantage", "is_contradicted"),
    [(0.16, -0.1, True), (0.05, 0.02, False), (-0.2, 0.4, False), (-0.2, 1.1, True), (-0.01, 0.9, True)],
    ids=["follows in part", "unrelated", "unrelated, negative", "mirrored", "turned"],
)
def test_events_that_follow_the_frames_in_part_are_of_their_sequence(
    stream: str, correlation: float, advantage: float, *, is_contradicted: bool
) -> None:
    """As declared beyond chance, or under another orientation by half of what is expected."""
    measurements = (
        Measurement("correlation", correlation, "1", 0.04, 0.96, 0.6, 0.7),
        Measurement("advantage_of_another_orientation", advantage, "1", 0.05, 0.0, 0.2, 0.3),
    )
    results = {"event_response.orientation": Result("event_response.orientation", "failed", "", measurements)}
    assert contradicts("other_sequence", stream, None, results, {}) == is_contradicted
    assert contradicts("time_offset", stream, None, results, {}) == is_contradicted
    assert not contradicts("time_offset", stream, 60.0, results, {})
    assert not contradicts("other_sequence", "depth", None, results, {})


@pytest.mark.parametrize("outcome", ["passed", "failed", "not_observable"])
def test_events_at_edges_are_of_this_sequence(outcome: Outcome) -> None:
    """Wherever the edges are; those of another sequence lie at none."""
    results = {"alignment.events": Result("alignment.events", outcome, "")}
    assert contradicts("other_sequence", "events", None, results, {}) == (outcome != "not_observable")
    assert not contradicts("other_sequence", "rgb", None, results, {})
    # A share of the time leaves edges in the rest.
    assert not contradicts("other_sequence", "events", 20.0, results, {})


@pytest.mark.parametrize("rule", ["unmatched", "gain"])
def test_of_frames_and_events_the_frames_are_odd_where_flow_contradicts_them_too(rule: str) -> None:
    """Flow that has another gain is at the places of the frames."""
    finding = Finding("F1", f"flow_photometric.residual.{rule}", "error", "off", Where(stream="flow/10hz"))
    results = {"flow_photometric.residual": Result("flow_photometric.residual", "failed", "", findings=(finding,))}
    assert contradicts("other_sequence", "events", None, results, {}) == (rule == "unmatched")
    assert not contradicts("other_sequence", "rgb", None, results, {})


def test_events_of_one_polarity_say_nothing_of_their_sequence() -> None:
    """Without a sign they follow no frames."""
    finding = Finding("F1", "event_stream.bounds.one_polarity", "warning", "", Where(stream="events"))
    bounds = Result("event_stream.bounds", "warned", "", findings=(finding,))
    assert contradicts("other_sequence", "events", None, {"event_stream.bounds": bounds}, {})


def test_imu_and_poses_that_agree_under_another_convention_are_of_one_flight() -> None:
    """Two motions agree under none; a convention of a part says nothing of the rest."""
    whole, part = Where("imu"), Where("imu", 7e6, 8e6)
    for where, is_contradicted in ((whole, True), (part, False)):
        finding = Finding("F1", "imu.rotation.disagreement", "critical", "they agree if", where)
        results = {"imu.rotation": Result("imu.rotation", "failed", "off", findings=(finding,))}
        assert contradicts("other_sequence", "pose", None, results, {}) == is_contradicted
        assert not contradicts("other_sequence", "depth", None, results, {})


def test_poses_in_coarse_steps_are_not_frozen() -> None:
    """They repeat where they move by less than a step; coarse depth says nothing of them."""
    repeats = Result("pose.continuity", "failed", "repeats")
    for stream, is_contradicted in (("pose", True), ("depth", False)):
        finding = Finding("F1", "integrity.resolution.step", "error", "steps of 0.01 m", Where(stream))
        results = {
            "pose.continuity": repeats,
            "integrity.resolution": Result("integrity.resolution", "failed", "coarse", findings=(finding,)),
        }
        assert contradicts("frozen_frames", "pose", 12.0, results, {}) == is_contradicted


@pytest.mark.parametrize("rounded", ["rgb", "events"])
@pytest.mark.parametrize(("offset_ms", "is_contradicted"), [(8.3, True), (-16.0, True), (40.0, False), (None, False)])
def test_what_is_rounded_to_a_grid_is_off_by_a_part_of_it(
    rounded: str, offset_ms: float | None, is_contradicted: bool
) -> None:
    """Stamped with the next of 60 ticks a second, frames are late by 8.3 ms on the mean, and never by two ticks."""
    grid = Measurement(f"{rounded}.grid", 16667.0, "us", 0.0, 1.0, 1.0, 1.0)
    results = {"clocks.resolution": Result("clocks.resolution", "failed", "coarse", measurements=(grid,))}
    assert contradicts("time_offset", "events", offset_ms, results, {}) == is_contradicted
    assert contradicts("time_offset", "rgb", offset_ms, results, {}) == is_contradicted


@pytest.mark.parametrize(("stream", "agrees", "is_contradicted"),
                         [("imu", "failed", False), ("imu", "passed", True), ("pose", "failed", True)])  # fmt: skip
def test_samples_that_were_numbered_anew_lie_on_the_grid(
    stream: str, agrees: Outcome, *, is_contradicted: bool
) -> None:
    """What the IMU holds contradicts its timestamps, and it ends early; poses that end with the others do not."""
    finding = Finding("F1", "clocks.span.ends_early", "error", "", Where(stream="imu"))
    results = {
        "clocks.span": Result("clocks.span", "failed", "", findings=(finding,)),
        "imu.translation": Result("imu.translation", agrees, ""),
    }
    places = {each: ClockPlace("in", 1.0) for each in ("imu", "pose")}
    assert contradicts("clock_rate", stream, -65e3, results, places) == is_contradicted


def test_depth_whose_edges_agree_as_a_whole_may_be_of_another_sequence_for_a_while() -> None:
    aligned = {
        "alignment.depth": Result("alignment.depth", "passed", ""),
        "depth.consistency": Result("depth.consistency", "failed", ""),
    }
    assert contradicts("other_sequence", "depth", None, aligned, {})
    assert not contradicts("other_sequence", "depth", 34.0, aligned, {})
    assert contradicts("other_sequence", "depth", 34.0, {"depth.consistency": Result("", "passed", "")}, {})


@pytest.mark.parametrize(("share", "is_contradicted"), [(0.9, True), (0.3, False)])
@pytest.mark.parametrize(("cause", "size"), [("clock_rate", 620.0), ("time_offset", 0.3)])
def test_lines_that_begin_and_end_with_frames_have_their_clock(
    cause: str, size: float, share: float, is_contradicted: bool
) -> None:
    """Most lines would be broken by an offset of a spacing of events."""
    lines = Measurement("lines_between_renders", share, "1", 0.01, 0.0, 0.05, 0.06, side="upper")
    check = "event_response.interpolation"
    results = {check: Result(check, "failed", "lines", measurements=(lines,))}
    for stream in ("events", "rgb"):
        assert contradicts(cause, stream, size, results, {}) == is_contradicted
    assert not contradicts(cause, "imu", size, results, {})


def test_declared_packets_are_no_rounding() -> None:
    """Events of packets of 1 ms may be late by 0.8 ms."""
    grid = Measurement("events.grid", 1000.0, "us", 0.0, 1000.0, 0.0, 1.0, side="upper")
    results = {"clocks.resolution": Result("clocks.resolution", "passed", "as declared", measurements=(grid,))}
    assert not contradicts("time_offset", "events", 0.8, results, {})


@pytest.mark.parametrize(("stream", "share", "is_contradicted"),
                         [("events", None, True), ("events", 14.0, False), ("rgb", 14.0, True)])  # fmt: skip
def test_a_whole_that_correlates_excludes_no_share_of_the_time(
    stream: str, share: float | None, is_contradicted: bool
) -> None:
    """Frames of another sequence for a while would leave the flow in single fields."""
    checks = "event_response.orientation", "flow_photometric.residual"
    results = {check: Result(check, "passed", "in order") for check in checks}
    assert contradicts("other_sequence", stream, share, results, {}) == is_contradicted


@pytest.mark.parametrize(("correlation", "is_contradicted"), [(0.8, False), (0.16, True)])
def test_another_sequence_for_a_while_leaves_the_correlation_of_the_rest(
    correlation: float, *, is_contradicted: bool
) -> None:
    """Where events follow the frames nowhere much, a tenth of the time is not the reason."""
    whole = Measurement("correlation", correlation, "1", 0.04, 0.96, 0.6, 0.7)
    results = {"event_response.orientation": Result("event_response.orientation", "failed", "", (whole,))}
    assert contradicts("other_sequence", "events", 10.0, results, {}) == is_contradicted


@pytest.mark.parametrize(
    ("outcome", "correlation", "is_contradicted"),
    [("failed", 0.07, True), ("not_observable", 0.07, False), ("failed", -0.07, False), ("failed", None, False)],
)
def test_events_that_are_shifted_are_of_this_sequence(
    outcome: Outcome, correlation: float | None, *, is_contradicted: bool
) -> None:
    """Without a correlation at any shift none is stated; where frames hardly change, one may be by chance."""
    whole = Measurement("correlation", correlation, "1", 0.04, 0.96, 0.6, 0.7)
    results = {
        "event_response.alignment": Result("event_response.alignment", outcome, ""),
        "event_response.orientation": Result("event_response.orientation", "failed", "", (whole,)),
    }
    assert contradicts("other_sequence", "events", None, results, {}) == is_contradicted


def residual_of_flow(**percent: float) -> dict[str, Result]:
    """What the photometric fit states of the time of some rates, in percent of the interval of each."""
    times = tuple(
        Measurement(f"flow/{rate} time", value, "percent", 2.0, 0.0, 12.0, 15.0) for rate, value in percent.items()
    )
    return {"flow_photometric.residual": Result("flow_photometric.residual", "failed", "off", measurements=times)}


@pytest.mark.parametrize(
    ("percent", "agrees"),
    [
        ({"10hz": 54.0, "25hz": 135.0, "50hz": 270.0}, True),
        ({"10hz": 54.0, "25hz": 110.0}, False),
        ({"25hz": 135.0}, False),
        ({"10hz": 2.0, "25hz": 5.0}, False),
    ],
    ids=["54 ms", "rates disagree", "one rate", "within the limit"],
)
def test_flow_at_another_time_is_late_and_of_this_sequence(percent: dict[str, float], agrees: bool) -> None:
    """Where its rates agree on one offset, whatever grid its timestamps lie on."""
    results, on_grid = residual_of_flow(**percent), {"flow": ClockPlace("in", 20.0)}
    assert contradicts("other_sequence", "flow", None, results, on_grid) == agrees
    assert contradicts("time_offset", "flow", 54.0, results, on_grid) != agrees
    assert contradicts("time_offset", "flow", 34.0, results, on_grid)


def test_rates_of_flow_state_their_common_offset() -> None:
    """Weighted by precision: 2% of 100 ms, and 2% of 40 ms."""
    offset_ms, error_ms = flow_offset_ms(residual_of_flow(**{"10hz": 54.0, "25hz": 130.0})) or (0.0, 0.0)
    assert offset_ms == pytest.approx((54.0 / 2.0**2 + 52.0 / 0.8**2) / (1 / 2.0**2 + 1 / 0.8**2))
    assert error_ms == pytest.approx((1 / 2.0**2 + 1 / 0.8**2) ** -0.5)


@pytest.mark.parametrize(
    ("repeats", "too_few"), [(1.0, True), (1999.0, False), (0.0, False)], ids=["one", "as many", "none is known"]
)
def test_few_doubled_events_contradict_the_frames_in_few_pixels(repeats: float, too_few: bool) -> None:
    """One doubled event disturbs one pixel; the number of those with other timestamps is unknown."""
    count = Measurement("repeats", repeats, "events", 0.0, 0.0, 0.0, 1.0)
    results = {"event_stream.duplicates": Result("event_stream.duplicates", "failed", "off", measurements=(count,))}
    code = "event_response.conservation.pixels"
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, Where(), features=(Violations(2000, 0.2),))
    alarm = Alarm(Finding("F1", code, "error", "off", Where()), statistic)
    assert disturbs_too_few(Hypothesis("duplicated_samples", "events", 0.3), alarm, results) == too_few
    assert not disturbs_too_few(Hypothesis("dropped_samples", "events", 0.3), alarm, results)


@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_values_of_another_time_on_the_common_grid_are_late(stream: str) -> None:
    """IMU and poses lie on the grid of all streams, and their motion differs by 7 ms: no clock has left it."""
    places = places_of_clocks(facts_of(memory_sequence()))
    late = {"imu.timing": Result("imu.timing", "failed", "late")}
    assert not contradicts("time_offset", stream, 7.3, late, places)
    assert contradicts("time_offset", stream, 7.3, {}, places)
    apart = {**places, "pose": ClockPlace("out", 5.0)}
    assert contradicts("time_offset", stream, 7.3, late, apart) == (stream == "imu")


@pytest.mark.parametrize(("step_percent", "is_contradicted"), [(-130.0, True), (-60.0, False), (40.0, False)])
def test_steps_of_the_opposite_sign_have_another_cause(step_percent: float, is_contradicted: bool) -> None:
    """Inverted polarity fits thresholds below zero, which no sensor has."""
    fitted = Measurement("threshold_off", step_percent, "percent", 1.0, 0.0, 5.0, 6.0)
    results = {"event_response.threshold": Result("event_response.threshold", "failed", "off", measurements=(fitted,))}
    assert contradicts("threshold_misdeclared", "events", 50.0, results, {}) == is_contradicted


@pytest.mark.parametrize("code", ["clocks.gaps.jump", "clocks.order.backward_steps", None])
def test_an_offset_of_a_part_changes_the_whole_by_less(code: str | None) -> None:
    """Where the clock itself jumps, or is set back, a small offset of the whole contradicts no larger one of a part."""
    whole = Measurement("time_offset", 0.003, "ms", 0.001, 0.0, 0.0031, 0.004)
    results = {"imu.timing": Result("imu.timing", "passed", "one clock", measurements=(whole,))}
    if code is not None:
        check, step = code.rpartition(".")[0], Finding("F1", code, "critical", "2 steps", Where("imu"))
        results[check] = Result(check, "failed", "steps", findings=(step,))
    assert contradicts("time_offset", "imu", 0.009, results, {}) is (code is None)


@pytest.mark.parametrize(("name", "is_contradicted"), [("frame", True), ("pose_correction", False)])
def test_depth_beside_noise_of_poses_contradicts_no_convention(name: str, *, is_contradicted: bool) -> None:
    """Exact depth frames turn as the poses do, or do not; corrections within noise leave either possible."""
    compared = Measurement(name, 1.0, "1", 0.1, 1.0, 1.0, 1.0)
    results = {
        "depth.consistency": Result("depth.consistency", "passed", "in order", measurements=(compared,)),
        "imu.rotation": Result("imu.rotation", "failed", "off"),
    }
    assert contradicts("quaternion_inverted", "pose", None, results, {}) == is_contradicted


@pytest.mark.parametrize("stream", ["imu", "pose"])
@pytest.mark.parametrize("by", ["grid", "ends", "nothing"])
def test_an_offset_that_imu_and_poses_share_is_seen_against_others(stream: str, by: str) -> None:
    """Both are 27 ms late: their difference is none, which says nothing of what the others show."""
    difference = Measurement("time_offset", 0.0, "ms", 0.001, 0.0, 0.0031, 0.004)
    results = {"imu.timing": Result("imu.timing", "passed", "one clock", measurements=(difference,))}
    places = {name: ClockPlace("out" if by == "grid" else "unknown", 5.0) for name in ("imu", "pose")}
    if by == "ends":
        findings = tuple(
            Finding(f"F{number}", f"clocks.span.{rule}", "error", "moved", Where(name))
            for number, (name, rule) in enumerate(product(("imu", "pose"), ("begins_late", "ends_early")), 1)
        )
        results["clocks.span"] = Result("clocks.span", "failed", "moved", findings=findings)
    assert contradicts("time_offset", stream, 27.039, results, places) == (by == "nothing")


@pytest.mark.parametrize("cause", ["intrinsics_focal", "intrinsics_centre", "extrinsic_rotation"])
@pytest.mark.parametrize(("outcome", "is_contradicted"), [("passed", True), ("failed", False)])
def test_flow_that_depth_and_poses_give_has_its_own_camera(
    cause: str, outcome: Literal["passed", "failed"], *, is_contradicted: bool
) -> None:
    """Then frames that deviate from it are those of a wrong camera."""
    geometry = {"flow_geometry.endpoint": Result("flow_geometry.endpoint", outcome, "?")}
    assert contradicts(cause, "flow", None, geometry, {}) == is_contradicted
    assert not contradicts(cause, "metadata", None, geometry, {})


def test_thresholds_of_a_part_may_leave_those_of_the_whole_in_order() -> None:
    """A cause without a size is of the whole file, whose thresholds are measured."""
    results = {"event_response.threshold": Result("event_response.threshold", "passed", "as declared")}
    assert contradicts("threshold_misdeclared", "events", None, results, {})
    assert not contradicts("threshold_misdeclared", "events", -50.0, results, {})


@pytest.mark.parametrize(("code", "is_contradicted"), [("shift", True), ("field", False)])
def test_noise_displaces_no_event(code: str, *, is_contradicted: bool) -> None:
    """Where events lie beside the changes of the frames, noise that is not declared is not the cause."""
    finding = Finding("F1", f"event_response.alignment.{code}", "error", "", Where(stream="events"))
    results = {"event_response.alignment": Result("event_response.alignment", "failed", "off", findings=(finding,))}
    assert contradicts("noise_misdeclared", "events", None, results, {}) == is_contradicted
    assert not contradicts("noise_misdeclared", "pose", None, results, {})
