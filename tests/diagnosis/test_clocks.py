"""Hypotheses for alarms of clocks: order, unit, rate, gaps, resolution and span of timestamps."""

from math import sqrt

import numpy as np
import pytest

from fedora_qa.checks.clocks.gaps import ClockJump, DisorderedTimestamps
from fedora_qa.checks.clocks.order import CounterWrap, RoundedRepeats
from fedora_qa.checks.clocks.rate import RoundedClock, SegmentRate
from fedora_qa.checks.clocks.resolution import PartialGrid
from fedora_qa.checks.clocks.span import CutOfSeveralRates, StreamEnds
from fedora_qa.checks.clocks.streams import ClockSetBack, PartInOtherUnit
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.clocks import of_varying_delays
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.facts import EventStep
from fedora_qa.views.clock_resets import ClockReset
from tests.support.facts import MS, clock, exact_facts, with_clock
from tests.support.proposals import named, proposed

BACK, FORWARDS = EventStep(700, 90 * MS, 80 * MS), EventStep(900, 95 * MS, 105 * MS)
IN_MS = ClockReset(BACK, FORWARDS, unit_factor=1e-3)
LATE = ClockReset(BACK, FORWARDS, 1.0, 0.9, 0.2, 10.0, 0.1, 400.0)
FAST = ClockReset(BACK, FORWARDS, 1.0, 0.2, 0.9, 10.0, 0.1, 400.0)


def test_repeated_timestamps_are_doubled_samples() -> None:
    assert proposed("clocks.order.repeated_stamps", value=3.0) == (
        Hypothesis("duplicated_samples", "rgb", 0.9, 3.0, "samples"),
    )


def test_repeats_of_a_coarse_grid_are_rounded_rather() -> None:
    assert proposed("clocks.order.repeated_stamps", RoundedRepeats(30.0), value=3.0) == (
        Hypothesis("quantised_time", "rgb", 0.95, 30.0, "ms"),
        Hypothesis("duplicated_samples", "rgb", 0.9, 3.0, "samples"),
    )


@pytest.mark.parametrize(
    ("features", "causes"),
    [
        pytest.param((), (), id="samples"),
        pytest.param((PartInOtherUnit(1e3, 5, 9),), (Hypothesis("time_unit", "rgb", 0.96, 1e3, "1"),), id="unit"),
        pytest.param((CounterWrap(),), (Hypothesis("time_unit", "rgb", 0.95),), id="counter"),
        pytest.param((ClockSetBack(20.0),), (Hypothesis("time_offset", "rgb", 0.92, 20.0, "ms"),), id="set back"),
    ],
)
def test_steps_back_are_of_a_clock_or_of_samples(features: tuple[Feature, ...], causes: tuple[Hypothesis, ...]) -> None:
    """Samples in another order stay a hypothesis beside every clock."""
    unsorted = Hypothesis("unsorted", "rgb", 0.9, 2.0, "samples")
    assert proposed("clocks.order.backward_steps", *features, value=2.0) == (*causes, unsorted)


@pytest.mark.parametrize(
    ("features", "causes", "unsorted"),
    [
        pytest.param((), (), 0.9, id="events"),
        pytest.param((CounterWrap(),), (Hypothesis("time_unit", "events", 0.98),), 0.9, id="counter"),
        pytest.param((IN_MS,), (Hypothesis("time_unit", "events", 0.97, 1e-3, "1"),), 0.3, id="unit"),
    ],
)
def test_steps_back_of_events_are_of_a_clock_or_of_events(
    features: tuple[Feature, ...], causes: tuple[Hypothesis, ...], unsorted: float
) -> None:
    """A clock that was set back explains them, so that events in another order are less likely beside it."""
    hypotheses = proposed("clocks.order.backward_steps", *features, stream="events", value=2.0)
    assert hypotheses == (
        *causes,
        Hypothesis("unsorted", "events", unsorted, 2.0, "events"),
        Hypothesis("quantised_time", "events", 0.3),
    )


@pytest.mark.parametrize(("reset", "first"), [(LATE, "time_offset"), (FAST, "clock_rate")])
def test_a_clock_that_was_set_back_was_late_or_gained(reset: ClockReset, first: str) -> None:
    """The better supported comes first; both have their sizes."""
    hypotheses = proposed("clocks.order.backward_steps", reset, stream="events")[:2]
    assert hypotheses[0].cause == first
    assert {(h.cause, h.support, h.magnitude, h.unit, h.standard_error) for h in hypotheses} == {
        ("time_offset", reset.offset_agreement, 10.0, "ms", 0.1),
        ("clock_rate", reset.drift_agreement, 400.0, "ppm", None),
    }


def test_a_clock_that_was_never_set_forwards_has_no_size() -> None:
    hypotheses = proposed("clocks.order.backward_steps", ClockReset(BACK, None, 1.0, 0.5, 0.5), stream="events")
    assert hypotheses[:2] == (Hypothesis("clock_rate", "events", 0.5), Hypothesis("time_offset", "events", 0.5))


@pytest.mark.parametrize("rule", ["factor", "part"])
def test_a_factor_of_units_is_a_unit(rule: str) -> None:
    assert proposed(f"clocks.unit.{rule}", value=1e3) == (Hypothesis("time_unit", "rgb", 1.0, 1e3, "1"),)


def test_a_wrong_period_is_a_rate() -> None:
    assert proposed("clocks.rate.error", value=120.0) == (Hypothesis("clock_rate", "rgb", 0.8, 120.0, "ppm"),)


def test_a_rounded_period_may_be_the_grid() -> None:
    assert proposed("clocks.rate.error", RoundedClock(2.0), value=120.0) == (
        Hypothesis("clock_rate", "rgb", 0.8, 120.0, "ppm"),
        Hypothesis("quantised_time", "rgb", 0.95, 2.0, "ms"),
    )


def test_the_rate_of_a_part_has_the_size_of_the_part() -> None:
    assert proposed("clocks.rate.change", SegmentRate(500.0, 3.0), value=120.0) == (
        Hypothesis("clock_rate", "rgb", 0.85, 500.0, "ppm", 3.0),
    )


LOST = Hypothesis("dropped_samples", "rgb", 0.9, 4.0, "samples")


@pytest.mark.parametrize(
    ("features", "hypotheses"),
    [
        pytest.param((), (LOST,), id="lost"),
        pytest.param(
            (DisorderedTimestamps(4),),
            (Hypothesis("unsorted", "rgb", 0.9), Hypothesis("time_offset", "rgb", 0.3), LOST),
            id="in another order",
        ),
        pytest.param(
            (ClockSetBack(20.0), DisorderedTimestamps(4)),
            (Hypothesis("time_offset", "rgb", 0.92, 20.0, "ms"), Hypothesis("unsorted", "rgb", 0.5), LOST),
            id="clock set back",
        ),
        pytest.param(
            (ClockJump(7.0, 0.001),), (Hypothesis("time_offset", "rgb", 0.9, 7.0, "ms", 0.001),), id="clock set"
        ),
    ],
)
def test_gaps_are_of_lost_samples_or_of_others(
    features: tuple[Feature, ...], hypotheses: tuple[Hypothesis, ...]
) -> None:
    """Samples that stand elsewhere fill the gaps, and a clock that was set leaves one odd step."""
    assert proposed("clocks.gaps.missing", *features, value=4.0) == hypotheses


def test_a_grid_is_rounding() -> None:
    """The statistic is in microseconds, the cause in milliseconds."""
    assert proposed("clocks.resolution.grid", stream="events", value=1000.0) == (
        Hypothesis("quantised_time", "events", 0.95, 1.0, "ms"),
    )


@pytest.mark.parametrize(
    ("reset", "causes"),
    [
        pytest.param(ClockReset(BACK, FORWARDS, unit_factor=1e3), ["time_unit", "quantised_time"], id="same factor"),
        pytest.param(IN_MS, ["quantised_time"], id="another factor"),
        pytest.param(LATE, ["quantised_time"], id="no unit"),
    ],
)
def test_a_comb_of_a_part_follows_from_its_unit(reset: ClockReset, causes: list[str]) -> None:
    """Whole ticks of another unit are multiples in the right one by exactly its factor."""
    hypotheses = proposed("clocks.resolution.partial_grid", PartialGrid(1000.0, 1), reset, stream="events")
    assert [hypothesis.cause for hypothesis in hypotheses] == causes
    assert hypotheses[-1] == Hypothesis("quantised_time", "events", 0.95, 1.0, "ms")


SECOND = 1000.0 * MS


@pytest.mark.parametrize(
    ("ends", "hypotheses"),
    [
        pytest.param(
            StreamEnds(100.0 * MS, -100.0 * MS, SECOND),
            (Hypothesis("time_offset", "rgb", 0.9, 100.0, "ms", 1e-3 / sqrt(12.0)),),
            id="shifted",
        ),
        pytest.param(
            StreamEnds(100.0 * MS, -91.0 * MS, SECOND),
            (Hypothesis("time_offset", "rgb", 0.9, 95.5, "ms"),),
            id="shifted and cut a little",
        ),
        pytest.param(
            StreamEnds(0.0, 150.0 * MS, SECOND),
            (Hypothesis("truncated", "rgb", 0.8, 15.0, "percent"), Hypothesis("clock_rate", "rgb", 0.3, -150e3, "ppm")),
            id="cut, or of another rate",
        ),
        pytest.param(
            StreamEnds(0.0, 910.0 * MS, SECOND),
            (Hypothesis("time_unit", "rgb", 0.7, 0.09, "1"), Hypothesis("truncated", "rgb", 0.8, 91.0, "percent")),
            id="cut, or in ticks",
        ),
        pytest.param(
            StreamEnds(0.0, 400.0 * MS, SECOND),
            (Hypothesis("truncated", "rgb", 0.8, 40.0, "percent"), Hypothesis("clock_rate", "rgb", 0.3, -400e3, "ppm")),
            id="cut, or of a far rate",
        ),
        pytest.param(
            StreamEnds(0.0, -31.0 * SECOND, SECOND),
            (Hypothesis("time_unit", "rgb", 0.9, 32.0, "1"), Hypothesis("truncated", "rgb", 0.8, -3100.0, "percent")),
            id="in another unit",
        ),
        pytest.param(
            StreamEnds(100.0 * MS, 0.0, 0.0),
            (Hypothesis("truncated", "rgb", 0.8, 1e10, "percent"),),
            id="streams of one sample",
        ),
    ],
)
def test_ends_that_differ_are_of_an_offset_a_unit_or_a_cut(
    ends: StreamEnds, hypotheses: tuple[Hypothesis, ...]
) -> None:
    """Both ends move alike by an offset; a loss is at one end; a unit is a factor of the duration."""
    assert proposed("clocks.span.end", ends) == hypotheses


def test_a_clock_that_stretches_span_and_period_alike_has_a_wrong_rate() -> None:
    """A stream at its nominal rate that goes on longer than the others has none."""
    facts = exact_facts()
    nominal = facts.clocks["imu"]
    stretched = clock((nominal.times_ns // 1000 * 2484 // 1000) * 1000)
    ends = StreamEnds(0.0, -1484.0 * MS * 2, 2 * SECOND)
    (rate, cut) = proposed("clocks.span.end", ends, stream="imu", facts=with_clock(facts, "imu", stretched))
    assert (rate.cause, rate.stream, cut.cause) == ("clock_rate", "imu", "truncated")
    assert rate.magnitude == pytest.approx(1.484e6, rel=1e-4)
    longer = clock(np.arange(0, round(2.484 * 2 * SECOND), nominal.times_ns[1]))
    hypotheses = proposed("clocks.span.end", ends, stream="imu", facts=with_clock(facts, "imu", longer))
    assert named(hypotheses) == [("truncated", "imu"), ("clock_rate", "imu")]


def test_ticks_of_no_counter_are_a_unit_where_they_leave_no_whole_rate() -> None:
    """50 Hz in ticks of 0.4321 us come at 115.7 Hz; the same span at 116 Hz is that of another rate."""
    facts, ends = exact_facts(), StreamEnds(0.0, (1 - 0.4321) * 2 * SECOND, 2 * SECOND)
    ticks = clock((facts.clocks["rgb"].times_ns * 0.4321 / 1000).astype(np.int64) * 1000)
    counted = clock((np.arange(len(ticks.times_ns)) * 1e6 / 116).astype(np.int64) * 1000)
    causes = [
        named(proposed("clocks.span.end", ends, facts=with_clock(facts, "rgb", rgb_clock)))[1]
        for rgb_clock in (ticks, counted)
    ]
    assert causes == [("time_unit", "rgb"), ("clock_rate", "rgb")]


@pytest.mark.parametrize("recur", [True, False])
def test_timestamps_that_recur_without_exception_are_of_files_that_overlap(recur: bool) -> None:
    """A clock that was set back by any other time has none of its timestamps twice."""
    facts = exact_facts()
    times_ns = facts.clocks["imu"].times_ns
    joined_ns = np.r_[times_ns[:60], times_ns[40:] + (0 if recur else 1000)]
    joined = with_clock(facts, "imu", clock(joined_ns))
    first, *others = proposed("clocks.order.backward_steps", ClockSetBack(-20.0), stream="imu", facts=joined)
    assert first == Hypothesis("time_offset", "imu", 0.92, -20.0, "ms")
    overlap = Hypothesis("duplicated_samples", "imu", 0.91, 20.0, "samples")
    assert (overlap in others) is recur


def test_samples_that_take_turns_after_the_clock_was_set_back_are_late() -> None:
    """What content they have contradicts their timestamps; of other streams they say nothing."""
    facts = exact_facts()
    times_ns = facts.clocks["imu"].times_ns.copy()
    times_ns[40:] -= 2300 * 1000
    facts = with_clock(facts, "imu", clock(np.sort(times_ns)))
    for code, sizes in (("imu.translation.lever", [-2.3]), ("images.exposure.jump", [])):
        place = Where(stream="imu")
        shown = Alarm(Finding("F1", code, "error", "off", place), Statistic("v", 1.0, "1", 0.0, "off", code, place))
        assert [h.magnitude for h in of_varying_delays(shown, facts) if h.stream == "imu"] == pytest.approx(sizes)


@pytest.mark.parametrize("stream", ["imu", "rgb", "depth"])
def test_a_stream_that_ends_early_may_have_been_counted_by_another_clock(stream: str) -> None:
    """A cut is meant first, and what the samples hold decides."""
    ends = StreamEnds(0.0, 65.0 * MS, SECOND)
    cutting, rate = proposed("clocks.span.end", ends, stream=stream, facts=exact_facts())
    assert (cutting.cause, rate.cause, rate.magnitude, rate.unit) == ("truncated", "clock_rate", -65e3, "ppm")
    assert rate.support < cutting.support


def test_a_part_in_another_unit_moves_an_end() -> None:
    """It comes before what the ends themselves show."""
    hypotheses = proposed("clocks.span.end", StreamEnds(0.0, 250.0 * MS, SECOND), PartInOtherUnit(1e-3, 5, 9))
    assert named(hypotheses) == [("time_unit", "rgb"), ("truncated", "rgb")]


def test_a_cut_of_several_rates_is_of_the_flow() -> None:
    """Rates that are cut alike are one fault."""
    ends = StreamEnds(0.0, 150.0 * MS, SECOND)
    several = CutOfSeveralRates(("flow/10hz", "flow/25hz"))
    assert named(proposed("clocks.span.end", ends, stream="flow/10hz")) == [("truncated", "flow/10hz")]
    assert named(proposed("clocks.span.end", ends, several, stream="flow/10hz")) == [("truncated", "flow")]


def test_a_trend_of_frames_that_are_all_early_is_an_offset_first() -> None:
    """Frames are early by about 4 ms, and less in the end: their mean rate is that of no clock."""
    facts = exact_facts()
    numbers = np.arange(len(facts.clocks["rgb"].times_ns))
    early_us = 4000 - np.rint(400 * np.sin(numbers / len(numbers))).astype(np.int64)
    early = with_clock(facts, "rgb", clock(20 * MS * numbers - 1000 * early_us))
    first, second = proposed("clocks.rate.error", stream="rgb", facts=early)
    assert (first.cause, first.unit, second.cause) == ("time_offset", "ms", "clock_rate")
    assert first.magnitude == pytest.approx(-3.8, abs=0.2)


@pytest.mark.parametrize(
    ("code", "is_named"), [("depth.scale.factor", True), ("event_response.alignment.shift", False)]
)
def test_a_clock_that_is_late_for_a_while_is_named_where_content_contradicts_it(code: str, is_named: bool) -> None:
    """Poses that left their regular times and came back are late, whatever else is fitted to them."""
    facts = exact_facts()
    numbers = np.arange(len(facts.clocks["pose"].times_ns))
    late_us = np.rint(30_000 * np.clip(1 - np.abs(numbers - 250) / 50, 0, None)).astype(np.int64)
    late = with_clock(facts, "pose", clock(5 * MS * numbers + 1000 * late_us))
    hypotheses = of_varying_delays(
        Alarm(Finding("F1", code, "error", "off", Where()), Statistic("v", 1.0, "1", 0.0, "off", code, Where())), late
    )
    assert named(hypotheses) == [("time_offset", "pose")] * is_named
