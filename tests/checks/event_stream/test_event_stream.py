"""The event stream by itself, on files of a closed-form world."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.checks.event_file import EventFile, inserted, linear_file, log_file
from tests.estimators.event_world import MS, Checkers, Stream
from tests.support.checked import diagnoses_of, measured_record, rules, run_check

Change = Callable[[Stream], Stream]
CHECKS = ("event_stream.bounds", "event_stream.duplicates", "event_stream.gaps", "event_stream.rates")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "events.h5"


def altered(change: Change, file: EventFile | None = None) -> EventFile:
    file = file or log_file()
    return file.altered(events=change(file.events))


def between(start_ms: float, stop_ms: float) -> Callable[[Stream], np.ndarray]:
    return lambda e: (e.times_ns >= start_ms * MS) & (e.times_ns < stop_ms * MS)


def lost(start_ms: float, stop_ms: float) -> Change:
    return lambda e: e.keep(~between(start_ms, stop_ms)(e))


def doubled(start_ms: float, stop_ms: float) -> Change:
    return lambda e: inserted(e, e.keep(between(start_ms, stop_ms)(e)))


def hot(column: int, row: int, rate_hz: float) -> Change:
    def add(events: Stream) -> Stream:
        count = int(rate_hz * 0.8)
        times_ns = np.sort(np.random.default_rng(0).integers(0, 800_000, count)) * 1000
        x, y = np.full(count, column, np.uint16), np.full(count, row, np.uint16)
        return inserted(events, Stream(x, y, times_ns, (np.arange(count) % 2).astype(np.uint8)))

    return add


def on_packets(events: Stream) -> Stream:
    """Stamps moved up to multiples of 0.2 ms."""
    return replace(events, times_ns=-(-events.times_ns // 200_000) * 200_000)


@pytest.mark.parametrize(
    "file",
    [log_file, linear_file, lambda: altered(on_packets).declaring(packet_interval_us=200)],
    ids=["log", "linear", "packets"],
)
def test_ideal_events_pass(file: Callable[[], EventFile], path: Path) -> None:
    """Nothing is found in the streams of ideal sensors, asynchronous, stepped or in packets."""
    file().write(path)
    assert {name: run_check(path, name).outcome for name in CHECKS} == dict.fromkeys(CHECKS, "passed")


@pytest.mark.parametrize(
    ("change", "check", "rule", "cause", "size"),
    [
        (lambda e: replace(e, x=e.y, y=e.x), "bounds", "outside", "axes_swapped", None),
        (lambda e: replace(e, p=e.p + 1), "bounds", "polarity", "nan_in_stream", None),
        (doubled(300, 300.6), "duplicates", "event", "duplicated_samples", 35),
        (lost(400, 402), "gaps", "silence", "dropped_samples", 110),
        (lost(199, 201), "gaps", "silence", "dropped_samples", 110),
        (hot(20, 10, 400.0), "rates", "hot_pixel", "hot_pixels", 1),
    ],
    ids=["axes", "polarity", "doubled", "lost", "lost-across-windows", "hot"],
)
def test_fault_is_found_and_named(
    change: Change, check: str, rule: str, cause: str, size: float | None, path: Path
) -> None:
    """Each fault breaks its rule, and the diagnosis has its cause and about its size."""
    altered(change).write(path)
    assert rule in rules(run_check(path, f"event_stream.{check}"))
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert (diagnosis.stream, diagnosis.cause) == ("events", cause)
    if size is not None:
        assert diagnosis.magnitude == pytest.approx(size, rel=0.5)


def test_a_repeat_by_chance_is_of_the_hot_pixel(path: Path) -> None:
    """A hot pixel that fires in the microsecond of another event is one fault: its close events excuse the repeat."""
    noisy = hot(20, 10, 400.0)(log_file().events)
    meets = np.flatnonzero((noisy.x == 20) & (noisy.y == 10))[3]
    noisy = inserted(noisy, noisy.keep(np.arange(len(noisy)) == meets))
    altered(lambda _: noisy).write(path)
    assert run_check(path, "event_stream.duplicates").outcome == "passed"
    assert diagnoses_of(path, "event_stream")[0].cause == "hot_pixels"


def test_places_are_named(path: Path) -> None:
    """A gap is placed in time, a hot pixel and the first event outside in the image."""
    altered(lost(400, 402)).write(path)
    gap = run_check(path, "event_stream.gaps").findings[0].where
    assert gap.start_us == pytest.approx(400_000, abs=500)
    assert gap.stop_us == pytest.approx(402_000, abs=500)
    altered(hot(20, 10, 400.0)).write(path)
    assert run_check(path, "event_stream.rates").findings[0].where.pixel == (20, 10)
    stray = lambda e: replace(e, x=np.where(np.arange(len(e)) == 1234, 56, e.x).astype(np.uint16))  # noqa: E731
    altered(stray).write(path)
    outside = run_check(path, "event_stream.bounds").findings[0].where
    assert outside.pixel is not None
    assert (outside.index_start, outside.pixel[0]) == (1234, 56)


def test_each_finding_of_bounds_locates_its_own_event(path: Path) -> None:
    """An event outside of the sensor is not the place of an unknown polarity, and the other way round."""

    def change(events: Stream) -> Stream:
        x, p = events.x.copy(), events.p.copy()
        x[100], p[700] = 60_000, 7
        return replace(events, x=x, p=p)

    altered(change).write(path)
    findings = run_check(path, "event_stream.bounds").findings
    assert {finding.code.rpartition(".")[2]: finding.where.index_start for finding in findings} == {
        "outside": 100,
        "polarity": 700,
    }


@pytest.mark.parametrize("check", ["event_stream.rates", "event_stream.duplicates"])
def test_declared_hot_pixel_is_excused(check: str, path: Path) -> None:
    """A hot pixel that is declared with its rate alarms nobody."""
    altered(hot(20, 10, 400.0)).declaring(hot_pixels=[[20, 10]], hot_pixel_rate_hz=400.0).write(path)
    assert run_check(path, check).outcome == "passed"


def test_declared_hot_pixel_is_held_to_its_rate(path: Path) -> None:
    """A declared hot pixel that fires at half of its declared rate is noise misdeclared, by -50 percent."""
    altered(hot(20, 10, 400.0)).declaring(hot_pixels=[[20, 10]], hot_pixel_rate_hz=800.0).write(path)
    assert rules(run_check(path, "event_stream.rates")) == ["declared_hot_pixels"]
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert diagnosis.cause == "noise_misdeclared"
    assert diagnosis.magnitude == pytest.approx(-50, abs=10)


def test_packet_written_twice_is_found_on_a_grid(path: Path) -> None:
    """On packets a pixel may fire twice a tick; ticks in which every event is doubled are a fault all the same."""
    altered(lambda e: doubled(300.1, 301.1)(on_packets(e))).declaring(packet_interval_us=200).write(path)
    assert "packet" in rules(run_check(path, "event_stream.duplicates"))


def on_grid(step_us: int) -> Change:
    """Stamps moved up to multiples of a step."""
    step_ns = step_us * 1000
    return lambda events: replace(events, times_ns=-(-events.times_ns // step_ns) * step_ns)


def repeated_at_random(share: float) -> Change:
    """Return the change that writes a share of the events twice."""

    def change(events: Stream) -> Stream:
        twice = np.random.default_rng(0).random(len(events)) < share
        return inserted(events, events.keep(twice))

    return change


@pytest.mark.parametrize("step_us", [100, 200, 500, 1000])
def test_repeats_on_a_measured_grid(step_us: int, path: Path) -> None:
    """A grid that nobody declares explains the repeats that it makes, and no others."""
    altered(on_grid(step_us)).write(path)
    assert run_check(path, "event_stream.duplicates").outcome == "passed"
    altered(lambda e: repeated_at_random(0.01)(on_grid(step_us)(e))).write(path)
    assert "event" in rules(run_check(path, "event_stream.duplicates"))
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert (diagnosis.stream, diagnosis.cause) == ("events", "duplicated_samples")


def in_order(events: Stream, times_ns: np.ndarray) -> Stream:
    """The events at other times, sorted by them."""
    return replace(events, times_ns=times_ns).keep(np.argsort(times_ns, kind="stable"))


def jittered(spread_us: float) -> Change:
    """Timestamps that err independently of each other."""

    def change(events: Stream) -> Stream:
        jitter_us = np.rint(np.random.default_rng(0).normal(0.0, spread_us, len(events))).astype(np.int64)
        return in_order(events, np.clip(events.times_ns + 1000 * jitter_us, 0, events.times_ns[-1]))

    return change


def partly_on_grid(step_us: int, share: float) -> Change:
    """A share of the stamps moved up to multiples of a step."""

    def change(events: Stream) -> Stream:
        moved = np.random.default_rng(1).random(len(events)) < share
        return in_order(events, np.where(moved, on_grid(step_us)(events).times_ns, events.times_ns))

    return change


def repeats_of(events: Stream) -> int:
    return len(events) - len({*zip(events.x.tolist(), events.y.tolist(), events.times_ns.tolist(), strict=True)})


@pytest.mark.parametrize(
    "erring",
    [jittered(1000.0), jittered(3000.0), partly_on_grid(10_000, 0.1), partly_on_grid(20_000, 0.5)],
    ids=["jitter of 1 ms", "jitter of 3 ms", "a tenth on 10 ms", "half on 20 ms"],
)
def test_coincidences_by_chance_are_no_repeats(erring: Change, path: Path) -> None:
    """Events whose timestamps err coincide and were written once; events written twice are found beside them."""
    file = log_file(Checkers(velocity_px_s=(400.0, 150.0), amplitude_dn=60.0))
    erred = erring(file.events)
    assert repeats_of(erred) > 0
    altered(lambda _: erred, file).write(path)
    assert run_check(path, "event_stream.duplicates").outcome == "passed"
    altered(lambda _: repeated_at_random(0.01)(erred), file).write(path)
    assert "event" in rules(run_check(path, "event_stream.duplicates"))


def test_events_that_were_given_one_time_do_not_name_doubled_ones(path: Path) -> None:
    """No time may lie before one that was late by 30 ms: pixels fire twice at it, and many more of them once."""

    def held(events: Stream) -> Stream:
        begin, end = np.searchsorted(events.times_ns, [300_000_000, 330_000_000])
        times_ns = events.times_ns.copy()
        times_ns[begin] = times_ns[end]
        return Stream(events.x, events.y, np.maximum.accumulate(times_ns), events.p)

    altered(held, log_file(Checkers(velocity_px_s=(400.0, 150.0), amplitude_dn=60.0))).write(path)
    record = check_file(path, CheckOptions(select=("event_stream.duplicates",))).record
    assert [each.outcome for each in record.results if each.check == "event_stream.duplicates"] == ["failed"]
    assert record.diagnoses[0].cause == "quantised_time"


def test_one_repeat_of_an_exact_stream_is_found(path: Path) -> None:
    """A single event that was written twice is one too many."""
    altered(lambda e: inserted(e, e.keep(np.arange(len(e)) == 1234))).write(path)
    result = run_check(path, "event_stream.duplicates")
    assert rules(result) == ["event"]
    assert {m.name: m.value for m in result.measurements}["repeats"] == 1


def test_bursts_of_a_fast_edge_are_no_repeats(path: Path) -> None:
    """A pixel that crosses several thresholds within a tick, as its neighbours do, repeats nothing."""
    file = log_file(Checkers(velocity_px_s=(400.0, 150.0), amplitude_dn=60.0))
    fast = on_grid(1000)(file.events)
    assert len(fast) - len({*zip(fast.x.tolist(), fast.y.tolist(), fast.times_ns.tolist(), strict=True)}) > 100
    altered(lambda _: fast, file).write(path)
    assert run_check(path, "event_stream.duplicates").outcome == "passed"


@pytest.mark.parametrize("late", [True, False], ids=["last event", "first event"])
def test_events_under_one_timestamp_are_not_lost(late: bool, path: Path) -> None:
    """A full buffer for 40 ms: all events of a packet have the time of its last event, or of its first."""

    def stamped(events: Stream) -> Stream:
        starts_ns = events.times_ns // 3_000_000 * 3_000_000
        times_ns = np.where(between(402, 441)(events), starts_ns + late * 3_000_000, events.times_ns)
        return replace(events, times_ns=times_ns)

    altered(stamped).write(path)
    assert "silence" in rules(run_check(path, "event_stream.gaps"))
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert (diagnosis.stream, diagnosis.cause) == ("events", "quantised_time")
    assert diagnosis.magnitude == pytest.approx(3.0, rel=0.2)
    assert "dropped_samples" not in {other.cause for other in diagnoses_of(path, "event_stream")}


def test_steps_of_a_linear_sensor_are_its_tick(path: Path) -> None:
    """A stray event off the grid of rendered steps makes no silence of every step; three lost steps are one."""
    altered(hot(20, 10, 5.0), linear_file()).write(path)
    assert run_check(path, "event_stream.gaps").outcome == "passed"
    altered(lost(400, 403), linear_file()).write(path)
    assert rules(run_check(path, "event_stream.gaps")) == ["silence"]


def test_steps_beside_a_silence_are_its_tick(path: Path) -> None:
    """Where timestamps jitter for a while, the rendered steps around that time are no silences."""

    def jittered(events: Stream) -> Stream:
        jitter_us = np.random.default_rng(0).normal(0.0, 1100.0, len(events)).astype(np.int64)
        times_ns = np.where(between(440, 520)(events), events.times_ns + jitter_us * 1000, events.times_ns)
        return replace(events, times_ns=times_ns).keep(np.argsort(times_ns, kind="stable"))

    altered(jittered, linear_file()).write(path)
    assert run_check(path, "event_stream.gaps").outcome == "passed"


def test_few_events_on_a_grid_do_not_fail_a_release(path: Path) -> None:
    """A pixel that fires at every whole millisecond is measurable and not material: its share of events is stated."""
    file = log_file()
    times_ns = np.arange(1, 100) * 2 * MS + file.events.times_ns[0] // MS * MS
    regular = Stream(np.full(99, 20), np.full(99, 10), times_ns, np.ones(99, np.uint8))
    altered(lambda e: inserted(e, regular)).write(path)
    outcomes = {}
    for profile in ("strict", "release"):
        options = CheckOptions(select=("clocks.resolution",), evidence=None, profile=profile)
        (result,) = check_file(path, options).record.results
        outcomes[profile] = result.outcome, [finding.code for finding in result.findings]
    assert outcomes["strict"] == ("failed", ["clocks.resolution.partial_grid"])
    assert outcomes["release"] == ("passed", ["clocks.resolution.immaterial"])


def test_rounded_timestamps_of_a_part_are_found(path: Path) -> None:
    """Stamps rounded to 0.3 ms in a third of the columns are a grid of a part, with its step; clean ones are none."""
    log_file().write(path)
    assert run_check(path, "clocks.resolution").outcome == "passed"
    rounded = lambda e: np.where(e.x < 19, e.times_ns // 300_000 * 300_000, e.times_ns)  # noqa: E731
    order = lambda e: np.argsort(rounded(e), kind="stable")  # noqa: E731
    altered(lambda e: replace(e, times_ns=rounded(e)).keep(order(e))).write(path)
    assert rules(run_check(path, "clocks.resolution")) == ["partial_grid"]
    diagnosis = diagnoses_of(path, "clocks")[0]
    assert (diagnosis.cause, diagnosis.magnitude) == ("quantised_time", pytest.approx(0.3))


@pytest.mark.parametrize(("size", "added"), [("width", 1), ("width", 10), ("width", 57), ("height", 43)])
def test_a_declared_size_without_events_is_found(size: str, added: int, path: Path) -> None:
    """Columns or rows that the sensor does not have are found, with their number, and named."""
    log_file().write(path)
    with h5py.File(path, "r+") as file:
        attributes = file["metadata/cameras/events"].attrs
        attributes[size] = attributes[size] + added
    (measured,) = (m for m in run_check(path, "event_stream.rates").measurements if m.name.startswith("silent"))
    assert measured.value == added
    assert rules(run_check(path, "event_stream.rates")) == ["silent_border"]
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert (diagnosis.stream, diagnosis.cause) == ("metadata", "wrong_shape")


@pytest.mark.parametrize("beside", [lambda e: e.x < 40, lambda e: e.y < 25], ids=["columns", "rows"])
def test_an_even_floor_is_no_wrong_size(beside: Callable[[Stream], np.ndarray], path: Path) -> None:
    """A part of the view without edges ends at a line; the principal point is that of the whole sensor."""
    altered(lambda e: e.keep(beside(e))).write(path)
    assert rules(run_check(path, "event_stream.rates")) == []


def test_one_sided_polarity_is_noticed(path: Path) -> None:
    """A stream of brighter events only is legal and unusual."""
    altered(lambda e: e.keep(e.p == 1)).write(path)
    assert run_check(path, "event_stream.bounds").outcome == "warned"


def test_quiet_stream_cannot_show_a_lost_packet(path: Path) -> None:
    """One event in five hundred left: silences of 2 ms are usual."""
    altered(lambda e: e.keep(np.arange(len(e)) % 500 == 0)).write(path)
    assert run_check(path, "event_stream.gaps").outcome == "not_observable"


@pytest.mark.parametrize("count", [0, 1, 2])
def test_almost_no_events_are_no_crash(count: int, path: Path) -> None:
    """With none, one or two events the stream itself shows no fault; conservation misses the others."""
    altered(lambda e: e.keep(np.arange(len(e)) < count)).write(path)
    results = check_file(path, CheckOptions(select=("event_stream", "event_response"))).record.results
    assert "crashed" not in {result.outcome for result in results}
    assert {r.outcome for r in results if r.check.startswith("event_stream")} <= {"passed", "not_observable"}
    assert run_check(path, "event_response.conservation").outcome == "failed"
    if count == 0:
        assert run_check(path, "event_stream.bounds").outcome == "not_observable"
        assert run_check(path, "event_response.orientation").outcome == "not_observable"


def test_events_outside_the_sensor_leave_the_rest_alone(path: Path) -> None:
    """Columns that no sensor has are counted, and nobody else stumbles over them."""
    wild = lambda e: replace(e, x=np.where(np.arange(len(e)) % 100 == 0, 60_000, e.x).astype(np.uint16))  # noqa: E731
    altered(wild).write(path)
    results = measured_record(path, "event_stream").results
    assert {r.check: r.outcome for r in results} == {
        **dict.fromkeys(CHECKS, "passed"), "event_stream.bounds": "failed"
    }  # fmt: skip


def test_a_stream_of_one_pixel_is_a_hot_pixel(path: Path) -> None:
    """Forty thousand events of one pixel are hot, and what the frames show is missing."""
    one = lambda e: hot(20, 10, 50_000.0)(e.keep(np.zeros(len(e), bool)))  # noqa: E731
    altered(one).write(path)
    assert rules(run_check(path, "event_stream.rates")) == ["hot_pixel"]
    assert run_check(path, "event_response.conservation").outcome == "failed"


def test_a_late_epoch_changes_nothing(path: Path) -> None:
    """Stamps just below 2^53 us, where float64 ends, give the outcomes of a clock that starts at 0."""
    late_ns = (2**53 - 2_000_000) * 1000
    file = log_file()
    moved = replace(file.events, times_ns=file.events.times_ns + late_ns)
    file.altered(events=moved, frames_ns=file.frames_ns + late_ns).write(path)
    names = (*CHECKS, "clocks.resolution", "event_response.conservation")
    assert {name: run_check(path, name).outcome for name in names} == dict.fromkeys(names, "passed")


def test_a_burst_is_no_crash(path: Path) -> None:
    """A million events in one millisecond, all over the sensor, are found to be out of order."""
    rng, count = np.random.default_rng(7), 1_000_000
    times_ns = np.sort(rng.integers(400_000, 401_000, count)) * 1000
    x, y = (rng.integers(0, size, count).astype(np.uint16) for size in (56, 40))
    burst = Stream(x, y, times_ns, rng.integers(0, 2, count).astype(np.uint8))
    altered(lambda e: inserted(e, burst)).write(path)
    results = check_file(path, CheckOptions(select=("event_stream", "event_response.conservation"))).record.results
    found = {result.check: result.outcome for result in results}
    assert "crashed" not in found.values()
    assert found["event_stream.duplicates"] == found["event_response.conservation"] == "failed"


def cut_without_colour(source: Path, path: Path, start_ms: float, stop_ms: float, rests: bool = False) -> None:
    """Write a copy without colour, with the events of an interval; the poses before and behind it may be held."""
    shutil.copy(source, path)
    with h5py.File(path, "r+") as file:
        for key in ("path/rgb", "path/rgb_ts", "metadata/rgb_to_event"):
            del file[key]
        events, pose = file["path/events"], file["path/pose"]
        times_us = events["t"][:]
        kept = (times_us >= 1000 * start_ms) & (times_us < 1000 * stop_ms)
        for name in ("x", "y", "t", "p"):
            values = events[name][:][kept]
            del events[name]
            events[name] = values
        first, last = np.searchsorted(pose["ts"][:], [1000 * start_ms, 1000 * stop_ms])
        for name in ("position", "orientation") if rests else ():
            values = pose[name][:]
            values[:first], values[last:] = values[first], values[last - 1]
            pose[name][...] = values


@pytest.mark.parametrize(("start_ms", "stop_ms", "name"), [(250, 9999, "silent_begin"), (0, 350, "silent_end")])
def test_events_that_are_cut_off_where_the_camera_moves_are_found(
    start_ms: float, stop_ms: float, name: str, small_park_day: Path, path: Path
) -> None:
    """Without colour the poses show that the image changes: a warning before, and no scene at rest."""
    cut_without_colour(small_park_day, path, start_ms, stop_ms)
    result = run_check(path, "event_stream.gaps")
    assert name in [measurement.name for measurement in result.measurements]
    assert rules(result) == ["silent_end"]
    diagnosis = diagnoses_of(path, "event_stream")[0]
    assert (diagnosis.stream, diagnosis.cause) == ("events", "truncated")
    assert diagnosis.magnitude is not None
    assert 37 < diagnosis.magnitude < 47


@pytest.mark.parametrize(("start_ms", "stop_ms"), [(250, 9999), (0, 350)])
def test_events_may_begin_late_where_the_camera_rests(
    start_ms: float, stop_ms: float, small_park_day: Path, path: Path
) -> None:
    """A camera at rest sees no change, whatever the rest of the file holds."""
    cut_without_colour(small_park_day, path, start_ms, stop_ms, rests=True)
    assert run_check(path, "event_stream.gaps").outcome == "passed"
