"""Each clock check passes exact clocks and names what was planted in them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.clocks.rate import ClocksRate
from fedora_qa.checks.clocks.resolution import ClocksResolution
from fedora_qa.checks.protocol import FactsCheck
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.sequence.facts import EventStep, Facts
from tests.support.all_checks import CHECKS
from tests.support.facts import FLOW_PERIODS_NS, MS, PERIODS_NS, clock, exact_facts, with_clock

CLOCKS = {
    check.name: check
    for check in CHECKS
    if check.name.startswith("clocks.") and isinstance(check, FactsCheck | ClocksResolution)
}


def judged(name: str, facts: Facts) -> Judged:
    check = CLOCKS[name]
    return judge({name: check.examine(facts)}, [check], 1e-4)[0]


def proposed(name: str, facts: Facts) -> tuple[Hypothesis, ...]:
    """The hypotheses for the first alarm of a check."""
    return hypotheses_of(judged(name, facts).alarms[0], facts)


def times(stream: str) -> np.ndarray:
    return exact_facts().clocks[stream].times_ns.copy()


def shifted(stream: str, ns: int) -> Facts:
    return with_clock(exact_facts(), stream, clock(times(stream) + ns))


def scaled(stream: str, factor: float) -> Facts:
    interval = FLOW_PERIODS_NS.get(stream)
    interval = None if interval is None else round(interval * factor)
    timestamps = np.rint(times(stream) * factor / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), stream, clock(timestamps, interval))


def without(stream: str, rows: slice) -> Facts:
    return with_clock(exact_facts(), stream, clock(np.delete(times(stream), rows)))


def exchanged(stream: str, row: int) -> Facts:
    timestamps = times(stream)
    timestamps[[row, row + 1]] = timestamps[[row + 1, row]]
    return with_clock(exact_facts(), stream, clock(timestamps))


def in_order_of_text(stream: str) -> Facts:
    """10 comes before 9."""
    timestamps = times(stream)
    return with_clock(exact_facts(), stream, clock(timestamps[np.argsort(timestamps.astype(str), kind="stable")]))


def blocks_exchanged(stream: str, row: int) -> Facts:
    return with_clock(exact_facts(), stream, clock(np.roll(times(stream), row)))


def repeated(stream: str, row: int) -> Facts:
    timestamps = times(stream)
    return with_clock(exact_facts(), stream, clock(np.insert(timestamps, row, timestamps[row])))


def wrapped(stream: str) -> Facts:
    timestamps = times(stream)
    timestamps[len(timestamps) // 2 :] -= 2**32 * 1000
    return with_clock(exact_facts(), stream, clock(timestamps))


def quantised() -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, grid_ns=MS))


def unsorted_events() -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, decreases=3, first_decrease=77))


def wrapped_events() -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, decreases=1, first_decrease=7, largest_decrease_ns=2**32 * 1000))


def numbered(stream: str) -> Facts:
    timestamps = times(stream)
    return with_clock(exact_facts(), stream, clock(1000 * np.arange(len(timestamps))))


def set_forward(stream: str, row: int, ns: int) -> Facts:
    timestamps = times(stream)
    timestamps[row:] += ns
    return with_clock(exact_facts(), stream, clock(timestamps))


def rounded(stream: str, grid_ns: int, lost: int | None = None) -> Facts:
    timestamps = (times(stream) + grid_ns // 2) // grid_ns * grid_ns
    return with_clock(exact_facts(), stream, clock(timestamps if lost is None else np.delete(timestamps, lost)))


def in_single_precision(stream: str) -> Facts:
    origin_us = 100_000_000
    timestamps_us = origin_us + times(stream) // 1000
    single_us = np.rint((timestamps_us / 1e6).astype(np.float32).astype(np.float64) * 1e6).astype(np.int64)
    facts = replace(exact_facts(), origin_us=float(origin_us))
    return with_clock(facts, stream, clock((single_us - origin_us) * 1000))


def partly(stream: str, factor: float) -> Facts:
    timestamps = times(stream)
    part = slice(len(timestamps) // 4, 3 * len(timestamps) // 4)
    timestamps[part] = np.rint(timestamps[part] * factor / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), stream, clock(timestamps))


def drifting(rate: float) -> Facts:
    timestamps = times("imu")
    late = np.rint(np.clip(timestamps - 500 * MS, 0, 1000 * MS) * rate / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), "imu", clock(timestamps + late))


FAULTS: dict[str, tuple[str, Callable[[], Facts], str, str, float | None]] = {
    "two poses exchanged": ("clocks.order", lambda: exchanged("pose", 50), "unsorted", "pose", 1.0),
    "IMU in the order of text": ("clocks.order", lambda: in_order_of_text("imu"), "unsorted", "imu", None),
    "poses in the order of text": ("clocks.order", lambda: in_order_of_text("pose"), "unsorted", "pose", None),
    "a block of poses at its end first": (
        "clocks.order",
        lambda: blocks_exchanged("pose", 60),
        "unsorted",
        "pose",
        1.0,
    ),
    "an IMU sample twice": ("clocks.order", lambda: repeated("imu", 50), "duplicated_samples", "imu", 1.0),
    "three events early": ("clocks.order", unsorted_events, "unsorted", "events", 3.0),
    "a 32-bit counter wraps": ("clocks.order", lambda: wrapped("imu"), "time_unit", "imu", None),
    "the IMU in milliseconds": ("clocks.unit", lambda: scaled("imu", 1e-3), "time_unit", "imu", 1e-3),
    "poses in nanoseconds": ("clocks.unit", lambda: scaled("pose", 1e3), "time_unit", "pose", 1e3),
    "frames in ticks of 90 kHz": ("clocks.unit", lambda: scaled("rgb", 0.09), "time_unit", "rgb", 0.09),
    "poses in ticks of 100 ns": ("clocks.unit", lambda: scaled("pose", 10.0), "time_unit", "pose", 10.0),
    "frames in wall-clock time": ("clocks.unit", lambda: scaled("rgb", 32.0), "time_unit", "rgb", 32.0),
    "a pose clock 50 ppm fast": ("clocks.rate", lambda: scaled("pose", 1 + 50e-6), "clock_rate", "pose", 50.0),
    "flow 0.1% slow": ("clocks.rate", lambda: scaled("flow/10hz", 1.001), "clock_rate", "flow/10hz", 1000.0),
    "an IMU clock 60 ppm fast for a while": (
        "clocks.rate",
        lambda: drifting(60e-6),
        "clock_rate",
        "imu",
        60.0,
    ),
    "one IMU sample lost": ("clocks.gaps", lambda: without("imu", slice(70, 71)), "dropped_samples", "imu", 1.0),
    "seven frames lost": ("clocks.gaps", lambda: without("rgb", slice(20, 27)), "dropped_samples", "rgb", 7.0),
    "events a minute before all else": (
        "clocks.span",
        lambda: events_shifted(-60_000 * MS),
        "time_offset",
        "events",
        -6e4,
    ),
    "events an hour behind all else": (
        "clocks.span",
        lambda: events_shifted(3_600_000 * MS),
        "time_offset",
        "events",
        3.6e6,
    ),
    "poses 30 ms late": ("clocks.span", lambda: shifted("pose", 30 * MS), "time_offset", "pose", 30.0),
    "the last 10% of depth lost": (
        "clocks.span",
        lambda: without("depth", slice(91, None)),
        "truncated",
        "depth",
        10.0,
    ),
    "a 32-bit counter of events wraps": ("clocks.order", wrapped_events, "time_unit", "events", None),
    "a clock set back by 30 ms": (
        "clocks.order",
        lambda: set_forward("imu", 900, -30 * MS),
        "time_offset",
        "imu",
        -30.0,
    ),
    "IMU stamps on a grid of 2.1 ms": ("clocks.order", lambda: rounded("imu", 2_100_000), "quantised_time", "imu", 2.1),
    "half of the depth stamps in nanoseconds": (
        "clocks.unit",
        lambda: partly("depth", 1000.0),
        "time_unit",
        "depth",
        1e3,
    ),
    "half of the pose stamps in milliseconds": ("clocks.unit", lambda: partly("pose", 1e-3), "time_unit", "pose", 1e-3),
    "numbers of frames for stamps": ("clocks.unit", lambda: numbered("rgb"), "time_unit", "rgb", 5e-5),
    "a clock set forward by 6 ms": ("clocks.gaps", lambda: set_forward("rgb", 40, 6 * MS), "time_offset", "rgb", 6.0),
    "depth in nanoseconds, seen by its span": ("clocks.span", lambda: scaled("depth", 1e3), "time_unit", "depth", 1e3),
    "frames on a grid of 7 ms": ("clocks.resolution", lambda: rounded("rgb", 7 * MS), "quantised_time", "rgb", 7.0),
    "IMU on a grid of 0.7 ms": ("clocks.resolution", lambda: rounded("imu", 700_000), "quantised_time", "imu", 0.7),
    "stamps in float32 seconds": (
        "clocks.resolution",
        lambda: in_single_precision("imu"),
        "quantised_time",
        "imu",
        0.00763,
    ),
    "events in milliseconds": ("clocks.resolution", quantised, "quantised_time", "events", 1.0),
}


@pytest.mark.parametrize(("stream", "grid_ns"), [("rgb", 7 * MS), ("imu", 700_000), ("pose", 700_000)])
def test_a_coarse_grid_is_neither_a_gap_nor_another_rate(stream: str, grid_ns: int) -> None:
    """Stamps that were rounded keep their rate and lack no sample: only their resolution is broken."""
    facts = rounded(stream, grid_ns)
    assert not judged("clocks.rate", facts).alarms
    assert not judged("clocks.gaps", facts).alarms
    assert judged("clocks.resolution", facts).alarms


def test_a_grid_of_half_a_period_is_no_other_rate() -> None:
    """Half a second of frames on a grid of 10.3 ms has steps of two grids and one of one: the mean period is kept."""
    frames = (exact_facts().clocks["rgb"].times_ns[:26] + 5_150_000) // 10_300_000 * 10_300_000
    hypotheses = proposed("clocks.rate", with_clock(exact_facts(), "rgb", clock(frames)))
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.magnitude) == ("quantised_time", 10.3)
    # A clock that runs 1% slow, and was set back by half a period once, does not keep the nominal period.
    slow = exact_facts().clocks["rgb"].times_ns * 10095 // 10000
    slow[40:] -= 10_095_000
    hypotheses = proposed("clocks.rate", with_clock(exact_facts(), "rgb", clock(slow)))
    assert {hypothesis.cause for hypothesis in hypotheses} == {"clock_rate"}


@pytest.mark.parametrize(("rows", "is_exact"), [(slice(0, 0), True), (slice(0, 1), False)])
def test_ends_that_moved_alike_state_an_offset_exactly(rows: slice, is_exact: bool) -> None:
    """Poses that begin and end with the others are 60 ms late at both ends; without the first one, at one of them."""
    late = np.delete(times("pose") + 60 * MS, rows)
    (offset,) = proposed("clocks.span", with_clock(exact_facts(), "pose", clock(late)))
    assert offset.cause == "time_offset"
    assert (offset.standard_error is not None) == is_exact
    assert offset.magnitude == pytest.approx(60.0, abs=0.0 if is_exact else 5.0)


@pytest.mark.parametrize(("factor", "cause"), [(26.6587, "clock_rate"), (37.1, "clock_rate"), (32.0, "time_unit")])
@pytest.mark.parametrize("name", ["clocks.unit", "clocks.span"])
def test_a_factor_near_that_of_a_unit_is_the_rate_of_a_clock(name: str, factor: float, cause: str) -> None:
    """Poses of 200 Hz whose period and span are 26.7 times as long are in wall time: the simulation ran at its pace."""
    first = max(proposed(name, scaled("pose", factor)), key=lambda hypothesis: hypothesis.support)
    assert first.cause == cause
    assert first.magnitude == pytest.approx(1e6 * (factor - 1) if cause == "clock_rate" else factor, rel=1e-3)


def test_a_grid_that_nearly_divides_the_period_is_no_other_rate() -> None:
    """Half a second of frames on a grid of 0.87 ms has one odd step: the grid is named, and not a clock with a jump."""
    frames = exact_facts().clocks["rgb"].times_ns[:26] // 870_000 * 870_000
    hypotheses = proposed("clocks.rate", with_clock(exact_facts(), "rgb", clock(frames)))
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.magnitude) == ("quantised_time", pytest.approx(0.87))


def test_a_drifting_clock_lies_on_no_grid() -> None:
    """A clock that runs 500 ppm fast, of steps all alike, is not taken for one of coarse stamps."""
    hypotheses = proposed("clocks.rate", scaled("rgb", 1 + 500e-6))
    assert {hypothesis.cause for hypothesis in hypotheses} == {"clock_rate"}


def test_few_frames_on_a_grid_above_their_period_are_not_doubled() -> None:
    """Half a second of frames on a grid of 29.8 ms repeats eight stamps evenly, which doubled frames do not."""
    frames = exact_facts().clocks["rgb"].times_ns[:26]
    coarse = proposed("clocks.order", with_clock(exact_facts(), "rgb", clock(frames // 29_800_000 * 29_800_000)))
    assert coarse[0].cause == "quantised_time"
    doubled = proposed("clocks.order", with_clock(exact_facts(), "rgb", clock(np.repeat(frames, [3] * 4 + [1] * 22))))
    assert doubled[0].cause == "duplicated_samples"


@pytest.mark.parametrize("start", [0, 7, 13])
def test_a_grid_just_above_the_period_repeats_a_timestamp_or_two(start: int) -> None:
    """Half a second of frames at 50 Hz on a grid of 21.2 ms: the grid is named, not a doubled frame or another rate."""
    frames = (exact_facts().clocks["rgb"].times_ns[start : start + 25] + 10_600_000) // 21_200_000 * 21_200_000
    coarse = with_clock(exact_facts(), "rgb", clock(frames))
    for check in ("clocks.order", "clocks.rate"):
        best = max(proposed(check, coarse), key=lambda hypothesis: hypothesis.support)
        assert (best.cause, best.stream, best.magnitude) == ("quantised_time", "rgb", pytest.approx(21.2)), check


def test_one_doubled_frame_lies_on_no_odd_grid() -> None:
    """All steps of exact frames, one of them doubled, are of 20 ms too, but that is their period."""
    frames = exact_facts().clocks["rgb"].times_ns[:25]
    doubled = proposed("clocks.order", with_clock(exact_facts(), "rgb", clock(np.insert(frames, 9, frames[9]))))
    assert doubled[0].cause == "duplicated_samples"


def test_jitter_is_no_change_of_rate() -> None:
    """Of 300 clocks with white jitter none is said to change its rate, and the scores have about unit spread."""
    rng = np.random.default_rng(11)
    scores = []
    for _ in range(300):
        timestamps = np.rint(np.arange(400) * 5000 + rng.normal(0, 40, 400)).astype(np.int64) * 1000
        measured = ClocksRate().examine(with_clock(exact_facts(), "pose", clock(timestamps))).measurements
        change = next(m for m in measured if m.name == "pose.rate_change")
        assert change.value < change.model_error_bound + 5 * change.standard_error
        scores.append(change.value / change.standard_error)
    # The range of four standard normal values is 2.06 standard deviations (Tippett, Biometrika 17 (1925)).
    assert np.mean(scores) == pytest.approx(2.06 / np.sqrt(2), rel=0.1)


def test_a_jump_is_not_another_rate() -> None:
    """A clock that was set by 6 ms half-way ran at its nominal rate before and after."""
    assert not judged("clocks.rate", set_forward("rgb", 50, 6 * MS)).alarms


@given(st.lists(st.integers(1, 1998), min_size=1, max_size=40, unique=True))
def test_samples_lost_at_random_are_counted(lost: list[int]) -> None:
    """However many samples of an exact clock are lost at random places, they are gaps and not a coarse grid."""
    facts = with_clock(exact_facts(), "imu", clock(np.delete(times("imu"), lost)))
    value = {m.name: m.value for m in CLOCKS["clocks.gaps"].examine(facts).measurements}
    assert value["imu.missing"] == len(lost)


def test_rounding_moves_the_slope_by_no_more_than_is_allowed() -> None:
    """The worst phases of rounding, one half of the stamps early and the other late, stay within the allowance."""
    timestamps = np.arange(2000) * MS + np.where(np.arange(2000) < 1000, -500, 500)
    observation = ClocksRate().examine(with_clock(exact_facts(), "imu", clock(timestamps)))
    error = next(m for m in observation.measurements if m.name == "imu.rate_error")
    assert error.model_error_bound == pytest.approx(error.value, rel=2e-3)


def test_a_last_sample_that_is_missing_is_noted() -> None:
    """A stream that stops one period before the others is noted, not failed; one that nothing else outlasts is not."""
    noted = judged("clocks.span", without("rgb", slice(100, None))).result
    assert noted.outcome == "warned"
    assert "rgb lacks 1 of its samples at its end" in noted.findings[0].message
    short = {stream: clock(held.times_ns[held.times_ns < 1995 * MS]) for stream, held in exact_facts().clocks.items()}
    sampled = {stream: held for stream, held in short.items() if not stream.startswith("flow")}
    assert judged("clocks.span", replace(exact_facts(), clocks=sampled)).result.outcome == "passed"


@pytest.mark.parametrize(("kept_ms", "slowest_ms", "stream"), [(1900, 1900, "flow"), (1900, 2000, "flow/25hz")])
def test_a_cut_of_all_rates_is_one_of_the_flow(kept_ms: int, slowest_ms: int, stream: str) -> None:
    """A cut that 25 and 50 Hz show is of flow as a whole, unless 10 Hz, too slow to fail, is whole to its end."""
    facts = exact_facts()
    ends_ms = {"flow/10hz": slowest_ms, "flow/25hz": kept_ms, "flow/50hz": kept_ms}
    for rate, end_ms in ends_ms.items():
        held = facts.clocks[rate]
        assert held.ends_ns is not None
        kept = held.times_ns[held.ends_ns <= end_ms * MS]
        facts = with_clock(facts, rate, clock(kept, int(held.ends_ns[0] - held.times_ns[0])))
    alarms = judged("clocks.span", facts).alarms
    assert {alarm.finding.where.stream for alarm in alarms} == {"flow/25hz", "flow/50hz"}
    first = hypotheses_of(alarms[0], facts)[0]
    assert (first.cause, first.stream) == ("truncated", stream)
    assert not any("begin at zero" in alarm.finding.message for alarm in alarms)


@pytest.mark.parametrize("name", ["clocks.order", "clocks.gaps"])
def test_a_part_that_is_late_by_many_samples_is_neither_lost_nor_shuffled(name: str) -> None:
    """Poses of half a second that are 90 ms late leave a gap and stand before others: one offset, with its sign."""
    facts = exact_facts()
    times_ns = facts.clocks["pose"].times_ns.copy()
    times_ns[100:200] += 90 * MS
    first = proposed(name, with_clock(facts, "pose", clock(times_ns)))[0]
    assert (first.cause, first.stream, first.magnitude) == ("time_offset", "pose", pytest.approx(90.0))


def test_timestamps_from_zero_beside_others_of_an_epoch_are_said_to_be() -> None:
    """A stream that was counted from zero is named as that, with the offset between the clocks."""
    epoch_us = 1_700_000_000_000_000
    facts = replace(exact_facts(), origin_us=0)
    late = {stream: clock(held.times_ns + epoch_us * 1000) for stream, held in facts.clocks.items() if stream != "imu"}
    from_zero = replace(facts, clocks={**late, "imu": facts.clocks["imu"]})
    alarm = judged("clocks.span", from_zero).alarms[0]
    assert "its timestamps begin at zero" in alarm.finding.message
    first = hypotheses_of(alarm, from_zero)[0]
    assert (first.cause, first.stream) == ("time_offset", "imu")


@pytest.mark.parametrize("name", CLOCKS)
def test_exact_clocks_pass(name: str) -> None:
    """Nothing is wrong with a clean file."""
    assert judged(name, exact_facts()).result.outcome == "passed"


@pytest.mark.parametrize(("name", "facts", "cause", "stream", "magnitude"), FAULTS.values(), ids=FAULTS)
def test_planted_fault_is_named(
    name: str, facts: Callable[[], Facts], cause: str, stream: str, magnitude: float | None
) -> None:
    """The check fails, and its first hypothesis is the planted cause in its stream with its size."""
    assert judged(name, facts()).alarms
    first = proposed(name, facts())[0]
    assert (first.cause, first.stream) == (cause, stream)
    if magnitude is not None:
        assert first.magnitude == pytest.approx(magnitude, rel=0.02)
    assert all(other.finding.where.stream == stream for other in judged(name, facts()).alarms)


@pytest.mark.parametrize("kept", [0.086, 0.09, 0.094])
def test_a_cut_stream_is_not_one_of_ticks(kept: float) -> None:
    """A tenth of the frames, or events that end with the motion, last as long as ticks of 90 kHz would."""
    facts = without("rgb", slice(round(kept * len(times("rgb"))) + 1, None))
    assert facts.events is not None
    still = replace(facts, events=replace(facts.events, last_ns=round(kept * facts.events.last_ns)))
    assert all(judgement.result.outcome == "passed" for judgement in [judged("clocks.unit", still)])


def test_every_clock_check_has_a_planted_fault() -> None:
    """No check is without a proof that it can fail."""
    assert {name for name, *_ in FAULTS.values()} == set(CLOCKS)


def test_whole_seconds_are_no_single_precision() -> None:
    """A part in nanoseconds makes steps of 20 s, which float32 holds: the unit is wrong, not the resolution."""
    assert not judged("clocks.resolution", partly("rgb", 1000.0)).alarms


def test_grids_are_seen_without_events() -> None:
    """A file without events still betrays rounded stamps; exact clocks alone tell nothing."""
    check = CLOCKS["clocks.resolution"]
    exact, coarse = (replace(facts, events=None) for facts in (exact_facts(), rounded("rgb", 7 * MS)))
    assert judged("clocks.resolution", exact).result.outcome == "not_observable"
    assert proposed("clocks.resolution", coarse)[0].stream == "rgb"
    assert check.not_applicable(replace(exact, clocks={}))


@given(st.sampled_from(sorted(PERIODS_NS)), st.floats(0.3, 2000.0))
def test_any_rounded_clock_keeps_its_rate(stream: str, rate_hz: float) -> None:
    """Whole-microsecond rounding of a whole rate is no clock error, at any rate."""
    nominal = max(round(rate_hz), 1)
    timestamps = np.rint(1e6 * np.arange(200) / nominal).astype(np.int64) * 1000
    observation = ClocksRate().examine(with_clock(exact_facts(), stream, clock(timestamps)))
    assert judge({"clocks.rate": observation}, [ClocksRate()], 1e-4)[0].result.outcome == "passed"


CHOSEN_US = [
    *[("pose", period_us) for period_us in (15_000, 35_000, 7_500, 12_500, 16_700, 33_330, 33_300, 45_000)],
    *[("imu", period_us) for period_us in (500, 1_500, 2_500, 3_000, 6_000, 7_000, 9_000, 11_000, 13_000, 17_000)],
]


@pytest.mark.parametrize(("stream", "period_us"), CHOSEN_US)
def test_a_period_that_a_writer_chooses_is_no_clock_error(stream: str, period_us: int) -> None:
    """Every third sample of 5 ms, a timer of 7 ms, 30 Hz as 33.3 ms."""
    facts = with_clock(exact_facts(), stream, clock(np.arange(0, 2_000_000, period_us) * 1000))
    assert judged("clocks.rate", facts).result.outcome == "passed"


def test_every_fourth_frame_of_video_is_no_clock_error() -> None:
    """7.5 Hz is no whole rate; its period is four of those that colour keeps."""
    frames_ns = np.rint(1e6 * np.arange(120) / 30).astype(np.int64) * 1000
    facts = with_clock(with_clock(exact_facts(), "rgb", clock(frames_ns)), "depth", clock(frames_ns[::4]))
    assert judged("clocks.rate", facts).result.outcome == "passed"


@pytest.mark.parametrize("ppm", [5.0, -20.0, 100.0])
@pytest.mark.parametrize("period_us", [1_000, 3_000, 5_000, 15_000, 20_000, 40_000])
def test_a_drift_of_a_chosen_period_is_measured(period_us: int, ppm: float) -> None:
    """A clock that runs by a few ppm too fast is off the period that was chosen, not off another one."""
    timestamps_ns = np.rint(np.arange(0, 2_000_000, period_us) * (1 + 1e-6 * ppm)).astype(np.int64) * 1000
    result = judged("clocks.rate", with_clock(exact_facts(), "pose", clock(timestamps_ns)))
    assert result.result.outcome == "failed"
    assert result.alarms[0].statistic.value == pytest.approx(ppm, abs=1.5)


@pytest.mark.parametrize("name", sorted(set(CLOCKS) - {"clocks.span"}))
@pytest.mark.parametrize("count", [0, 1, 2])
def test_streams_with_hardly_a_timestamp_are_no_failure(name: str, count: int) -> None:
    """A stream of two samples is neither a crash nor an alarm of order, unit, rate or gaps."""
    facts = exact_facts()
    few = {stream: clock(held.times_ns[:count]) for stream, held in facts.clocks.items()}
    facts = replace(facts, clocks=few, events=None if count == 0 else facts.events)
    if name == "clocks.resolution" and facts.events is None:
        return
    check = CLOCKS[name]
    assert check.not_applicable(facts) or judged(name, facts).result.outcome in {"passed", "not_observable", "warned"}


def few(stream: str, rows: slice) -> Facts:
    facts = exact_facts()
    interval = FLOW_PERIODS_NS.get(stream)
    return with_clock(facts, stream, clock(facts.clocks[stream].times_ns[rows], interval))


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
    """Two samples in two seconds are no stream, and no other is accused."""
    facts = few(stream, rows)
    alarms = judged("clocks.span", facts).alarms
    assert {alarm.finding.where.stream for alarm in alarms} == {stream}
    first = hypotheses_of(alarms[0], facts)[0]
    assert (first.cause, first.stream) == (cause, stream)
    assert first.magnitude == (None if magnitude is None else pytest.approx(magnitude))


def in_a_window(start_ms: int, stop_ms: int) -> Facts:
    """Facts of the samples and whole intervals in a part of a clean file."""
    facts = exact_facts()
    clocks = {}
    for stream, held in facts.clocks.items():
        ends = held.times_ns if held.ends_ns is None else held.ends_ns
        inside = (held.times_ns >= start_ms * MS) & (ends <= stop_ms * MS)
        clocks[stream] = clock(held.times_ns[inside], FLOW_PERIODS_NS.get(stream))
    return replace(facts, clocks=clocks)


@given(st.integers(0, 1000), st.integers(60, 1000))
def test_a_part_of_a_clean_file_lacks_nothing(start_ms: int, length_ms: int) -> None:
    """Whatever part is cut out, no stream has too few samples: slow rates of flow may have none in a short part."""
    assert not judged("clocks.span", in_a_window(start_ms, start_ms + length_ms)).alarms


@pytest.mark.parametrize("span_ms", [250, 2000])
def test_few_samples_beside_events_alone(span_ms: int) -> None:
    """Events tell how long a file lasts where nothing else does; three samples are due within 0.3 s."""
    facts = few("rgb", slice(0, 2))
    assert facts.events is not None
    events = replace(facts.events, last_ns=span_ms * MS)
    facts = replace(facts, clocks={"rgb": facts.clocks["rgb"]}, events=events)
    codes = {alarm.finding.code for alarm in judged("clocks.span", facts).alarms}
    assert codes == ({"clocks.span.few_samples"} if span_ms == 2000 else {"clocks.span.ends_early"})


def events_shifted(shift_ns: int) -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    events = replace(facts.events, first_ns=facts.events.first_ns + shift_ns, last_ns=facts.events.last_ns + shift_ns)
    return replace(facts, events=events)


@given(st.integers(-1999, 1999), st.integers(0, 2000))
def test_events_may_begin_late_and_end_early(shift_ms: int, length_ms: int) -> None:
    """While any instant is common, a still scene explains what is missing."""
    facts = exact_facts()
    assert facts.events is not None
    first_ms = max(shift_ms, -length_ms)
    events = replace(facts.events, first_ns=first_ms * MS, last_ns=(first_ms + length_ms) * MS)
    assert not judged("clocks.span", replace(facts, events=events)).alarms


def test_no_event_at_all_is_noted() -> None:
    """A still scene gives none, which no timestamp can tell: a warning, not a finding."""
    facts = exact_facts()
    assert facts.events is not None
    result = judged("clocks.span", replace(facts, events=replace(facts.events, count=0))).result
    assert (result.outcome, [finding.code for finding in result.findings]) == ("warned", ["clocks.span.no_events"])


@pytest.mark.parametrize(("count", "is_few"), [(0, True), (2, True), (3, False)])
def test_without_frames_no_scene_is_known_to_be_still(count: int, is_few: bool) -> None:
    """Nothing else would state that a declared stream of events is empty."""
    facts = exact_facts()
    assert facts.events is not None
    alone = replace(facts, clocks={s: c for s, c in facts.clocks.items() if s != "rgb"})
    alarms = judged("clocks.span", replace(alone, events=replace(facts.events, count=count))).alarms
    assert [alarm.finding.code for alarm in alarms] == ["clocks.span.few_samples"] * is_few


@pytest.mark.parametrize(
    ("first_ms", "last_ms", "codes"),
    [
        (400, 1990, ["clocks.span.events_begin_late"]),
        (10, 1500, ["clocks.span.events_end_early"]),
        (400, 1500, ["clocks.span.events_begin_late", "clocks.span.events_end_early"]),
        (90, 1950, []),
    ],
)
def test_without_frames_silent_ends_are_noted(first_ms: int, last_ms: int, codes: list[str]) -> None:
    """The scene may have been still; with frames the conservation of light decides."""
    facts = exact_facts()
    assert facts.events is not None
    cut = replace(facts, events=replace(facts.events, first_ns=first_ms * MS, last_ns=last_ms * MS))
    alone = replace(cut, clocks={s: c for s, c in facts.clocks.items() if s != "rgb"})
    result = judged("clocks.span", alone).result
    assert [finding.code for finding in result.findings] == codes
    assert result.outcome == ("warned" if codes else "passed")
    assert not judged("clocks.span", cut).result.findings


def with_stray(row: int, before_ms: int, after_ms: int) -> Facts:
    """Events of which those before a row, or from it on, lie elsewhere: between both there is none."""
    facts = exact_facts()
    assert facts.events is not None
    step = EventStep(row, before_ms * MS, after_ms * MS)
    first_ns, last_ns = min(facts.events.first_ns, before_ms * MS), max(facts.events.last_ns, after_ms * MS)
    return replace(
        facts, events=replace(facts.events, first_ns=first_ns, last_ns=last_ns, longest_steps=(step,), count=1000)
    )


@pytest.mark.parametrize(
    ("row", "before_ms", "after_ms", "is_stray"),
    [
        (1, -1_000_000, 4, True),  # one absurd timestamp, of 2 s
        (999, 1990, 10**12, True),
        (50, -1000, 4, True),
        (950, 1990, 3100, True),
        (50, -990, 4, False),  # not as far as half of the duration
        (950, 1990, 2990, False),
        (50, -1500, -1400, False),  # a sensor that runs before the others
        (700, 500, 1600, False),  # a silence within
        (5, 1990, 10**6, False),  # most events lie elsewhere: another clock
    ],
)
def test_events_far_from_all_others_are_strays(row: int, before_ms: int, after_ms: int, is_stray: bool) -> None:
    """They are counted, and no duration is theirs; recorders begin and end as they like."""
    facts = with_stray(row, before_ms, after_ms)
    alarms = judged("clocks.span", facts).alarms
    assert [alarm.finding.code for alarm in alarms] == ["clocks.span.far"] * is_stray
    assert not judged("clocks.span", recorded(facts)).alarms
    if is_stray:
        assert alarms[0].statistic.value == (row if before_ms < 0 else 1000 - row)
        assert not judged("clocks.unit", facts).alarms
        assert [h.cause for h in proposed("clocks.span", facts)] == ["time_offset"]


def recorded(facts: Facts) -> Facts:
    """The same facts of a sequence that is declared as recorded."""
    return replace(facts, declared=replace(facts.declared, kind="recorded"))


def test_the_rate_of_a_recorded_stream_is_stated() -> None:
    """25.8 Hz is that of its sensor, though 26 Hz are nearer than 1 percent."""
    free = with_clock(exact_facts(), "rgb", clock(np.arange(0, 2000 * MS, 38_765_000)))
    assert judged("clocks.rate", free).result.outcome == "failed"
    result = judged("clocks.rate", recorded(free)).result
    assert result.outcome == "passed"
    assert CLOCKS["clocks.rate"].examine(recorded(free)).inferred["rgb.rate_hz"] == pytest.approx(25.797, abs=1e-3)


def test_a_recorded_clock_that_changes_its_rate_is_judged() -> None:
    ns = np.arange(0, 2000 * MS, 5 * MS)
    altered = with_clock(exact_facts(), "pose", clock(np.where(ns > 1000 * MS, ns + (ns - 1000 * MS) // 1000, ns)))
    assert judged("clocks.rate", recorded(altered)).result.outcome == "failed"


def test_a_recorded_stream_that_ends_early_is_stated() -> None:
    cut = recorded(without("pose", np.s_[:100]))
    result = judged("clocks.span", cut).result
    assert result.outcome != "failed"
    inferred = CLOCKS["clocks.span"].examine(cut).inferred
    assert inferred == {"pose.begins_later_ms": 500.0, "pose.ends_earlier_ms": 0.0}


def test_a_recorded_stream_that_is_shifted_is_judged() -> None:
    assert judged("clocks.span", recorded(shifted("pose", 500 * MS))).result.outcome == "failed"
