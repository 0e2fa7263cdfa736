"""Events against log intensity, on files of a closed-form world."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.checks.event_response import alignment
from fedora_qa.record.types import Diagnosis, Measurement, Result
from tests.checks.event_file import (
    DURATION_MS,
    FRAME_SHAPE,
    FRAMES_NS,
    JUMPING_WORLD,
    LINEAR_WORLD,
    LOG_WORLD,
    SHAPE,
    SHARP_WORLD,
    SMOOTH_WORLD,
    EventFile,
    frames_of,
    inserted,
    linear_file,
    log_file,
)
from tests.estimators.event_world import MS, Stream, Waves, linear_events, log_events
from tests.support.checked import diagnosed, diagnoses_of, measured_record, run_check

Change = Callable[[EventFile], EventFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "events.h5"


def results_of(path: Path) -> dict[str, Result]:
    """Results by the name of the check without its subject."""
    results = measured_record(path, "event_response").results
    crashes = [result.traceback for result in results if result.outcome == "crashed"]
    if crashes:
        raise RuntimeError(crashes[0])
    return {result.check.removeprefix("event_response."): result for result in results}


def outcomes(path: Path) -> dict[str, str]:
    return {check: result.outcome for check, result in results_of(path).items()}


def outcomes_with_frames(path: Path) -> dict[str, str]:
    """Outcomes of the checks of events against frames: jitter is measured of events alone."""
    return {check: outcome for check, outcome in outcomes(path).items() if check != "jitter"}


def first_diagnosis(path: Path) -> Diagnosis:
    return diagnoses_of(path, "event_response")[0]


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


def events(change: Callable[[Stream], Stream]) -> Change:
    return lambda file: file.altered(events=change(file.events))


def frames(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda file: file.altered(frames=change(file.frames.copy()))


def declaring(**attributes: Any) -> Change:
    return lambda file: file.declaring(**attributes)


def exchanged(images: np.ndarray) -> np.ndarray:
    images[[20, 21]] = images[[21, 20]]
    return images


def repeated(images: np.ndarray) -> np.ndarray:
    images[20] = images[19]
    return images


def dead(events: Stream) -> Stream:
    inside = (events.x >= 16) & (events.x < 32) & (events.y >= 8) & (events.y < 24)
    return events.keep(~inside)


def moved_down(events: Stream) -> Stream:
    kept = events.keep(events.y < SHAPE[0] - 3)
    return replace(kept, y=(kept.y + 3).astype(np.uint16))


def test_ideal_log_events_pass(path: Path) -> None:
    """No check fails, nearly all can tell, and their values are what was put in."""
    results = results_of(log_file().write(path))
    by_check = [result.outcome for result in results.values()]
    assert set(by_check) <= {"passed", "not_observable"}
    assert by_check.count("passed") >= 6
    assert abs(measured(results["threshold"], "threshold_on").value) < 2
    assert abs(measured(results["threshold"], "threshold_off").value) < 2
    assert abs(measured(results["timing"], "time_offset").value) < 0.15
    assert measured(results["conservation"], "violating_pixels").value == 0


@pytest.mark.parametrize("threshold", [0.1, 0.2, 0.35, 0.5])
@pytest.mark.parametrize(("world", "bias"), [(SMOOTH_WORLD, 1.0), (SHARP_WORLD, 2.0)], ids=["smooth", "sharp"])
def test_threshold_has_no_bias(world: Waves, bias: float, threshold: float, path: Path) -> None:
    """C+ and C- are right to 1% on smooth and 2% on sharp ground of contrast 19 : 1, and known to be to 6%."""
    log_file(world, threshold).write(path)
    result = run_check(path, "event_response.threshold")
    assert result.outcome == "passed"
    for name in ("threshold_on", "threshold_off"):
        assert abs(measured(result, name).value) < bias
        assert measured(result, name).limit < 6


def test_ideal_linear_events_pass(path: Path) -> None:
    """A sensor that fires on grey values, one event a step, passes as such."""
    linear_file().write(path)
    by_check = outcomes(path)
    # Steps of a millisecond show no spacings of events between two frames.
    assert by_check.pop("interpolation") == "not_observable"
    assert set(by_check.values()) == {"passed"}


def test_levels_that_jump_are_not_taken_for_early_events(path: Path) -> None:
    """Where edges pass within a few rendered steps honest events seem early, and nothing is said of their time."""
    linear_file(world=JUMPING_WORLD, threshold_dn=30.0).write(path)
    timing = run_check(path, "event_response.timing")
    offset = measured(timing, "time_offset")
    assert offset.value < -5 * offset.standard_error
    assert timing.outcome == "not_observable"


@pytest.mark.parametrize("late_ms", [2, 30])
def test_late_events_of_grey_values_are_found(late_ms: int, path: Path) -> None:
    """Levels that move by little in a step tell a delay of two milliseconds, and a gross one, to a twentieth."""
    events(lambda e: e.shifted(late_ms * MS))(linear_file()).write(path)
    diagnosis = first_diagnosis(path)
    assert (diagnosis.stream, diagnosis.cause) == ("events", "time_offset")
    assert diagnosis.magnitude == pytest.approx(late_ms, rel=0.05)


@pytest.mark.parametrize(
    ("change", "stream", "cause", "size", "within"),
    [
        (events(lambda e: e.shifted(2 * MS)), "events", "time_offset", 2.0, 0.1),
        (events(lambda e: e.shifted(-7 * MS)), "events", "time_offset", -7.0, 0.05),
        (events(lambda e: e.shifted(30 * MS)), "events", "time_offset", 30.0, 0.02),
        (events(lambda e: replace(e, p=1 - e.p)), "events", "polarity_inverted", None, 0),
        (events(lambda e: replace(e, x=SHAPE[1] - 1 - e.x)), "events", "mirrored", None, 0),
        (events(lambda e: replace(e, x=e.y, y=e.x)), "events", "axes_swapped", None, 0),
        (events(moved_down), "events", "spatial_offset", None, 0),
        (declaring(threshold_on=0.25, threshold_off=0.25), "events", "threshold_misdeclared", 25.0, 0.1),
        (declaring(model="linear"), "events", "event_model_misdeclared", None, 0),
        (events(dead), "events", "dead_region", 16.0, 0.2),
        (frames(repeated), "rgb", "frozen_frames", 1.0, 0),
        (frames(exchanged), "rgb", "swapped_frames", 1.0, 0),
    ],
    ids=["late", "early", "very-late", "inverted", "mirrored", "swapped", "moved", "threshold", "model", "dead",
         "repeated", "exchanged"],
)  # fmt: skip
def test_fault_is_named_with_its_size(
    change: Change, stream: str, cause: str, size: float | None, within: float, path: Path
) -> None:
    """The first diagnosis has the stream and cause that were planted, and their size."""
    change(log_file()).write(path)
    diagnosis = first_diagnosis(path)
    assert (diagnosis.stream, diagnosis.cause) == (stream, cause)
    if size is not None:
        assert diagnosis.magnitude == pytest.approx(size, rel=within)


def test_a_late_stretch_is_placed(path: Path) -> None:
    """Events that are 2 ms late between 0.2 and 0.4 s only are that, there, by that much."""

    def late(e: Stream) -> Stream:
        inside = (e.times_ns > 200 * MS) & (e.times_ns < 400 * MS)
        return sorted_by_time(replace(e, times_ns=e.times_ns + 2 * MS * inside))

    events(late)(log_file()).write(path)
    timing, (diagnosis, *_) = diagnosed(path, "event_response.timing")
    found = next(one for one in timing.findings if one.code == "event_response.timing.stretch")
    assert (found.where.start_us, found.where.stop_us) == (200_000, 400_000)
    assert measured(timing, "late_stretch").value == pytest.approx(2.0, rel=0.15)
    assert (diagnosis.stream, diagnosis.cause) == ("events", "time_offset")
    assert diagnosis.magnitude == pytest.approx(2.0, rel=0.15)


def test_a_late_region_is_placed(path: Path) -> None:
    """Events that are 2 ms late in the right half of the image only are that, there, by that much."""
    events(lambda e: sorted_by_time(replace(e, times_ns=e.times_ns + 2 * MS * (e.x >= SHAPE[1] // 2))))(
        log_file()
    ).write(path)
    timing, diagnoses = diagnosed(path, "event_response.timing")
    found = next(one for one in timing.findings if one.code == "event_response.timing.region")
    assert abs(measured(timing, "late_region").value) == pytest.approx(2.0, rel=0.15)
    assert found.where.tile in {(28, 0, 56, 40), (0, 0, 28, 40)}
    assert diagnoses[0].cause == "time_offset"


@pytest.mark.parametrize("part", ["stretch", "region"])
def test_polarity_is_asked_of_parts(part: str, path: Path) -> None:
    """Polarity that is inverted for 0.2 s, or in the middle of the image, is found there and named."""

    def partly(e: Stream) -> Stream:
        inside = (e.times_ns > 200 * MS) & (e.times_ns <= 400 * MS)
        if part == "region":
            inside = (e.x >= 14) & (e.x < 42) & (e.y >= 10) & (e.y < 30)
        return replace(e, p=np.where(inside, 1 - e.p, e.p).astype(np.uint8))

    events(partly)(log_file()).write(path)
    result, diagnoses = diagnosed(path, "event_response.orientation")
    found = next(one for one in result.findings if one.code == f"event_response.orientation.{part}")
    place = (found.where.start_us, found.where.stop_us) if part == "stretch" else found.where.tile
    assert place == ((200_000, 400_000) if part == "stretch" else (14, 10, 42, 30))
    assert diagnoses[0].cause == "polarity_inverted"


def sorted_by_time(events: Stream) -> Stream:
    return events.keep(np.argsort(events.times_ns, kind="stable"))


def test_each_threshold_is_held_to_its_own(path: Path) -> None:
    """With only C- declared too small by a third, only C- fails, and by +50 percent."""
    declaring(threshold_off=0.2 / 1.5)(log_file()).write(path)
    result = run_check(path, "event_response.threshold")
    assert abs(measured(result, "threshold_on").value) < 5
    assert measured(result, "threshold_off").value == pytest.approx(50, abs=5)
    assert len(result.findings) == 1


def test_clock_rate_is_told_from_an_offset(path: Path) -> None:
    """A clock that runs 4000 ppm fast is that, not an offset."""
    fast = events(lambda e: replace(e, times_ns=np.rint(e.times_ns * 1.004).astype(np.int64)))
    fast(log_file()).write(path)
    diagnosis = first_diagnosis(path)
    assert (diagnosis.stream, diagnosis.cause) == ("events", "clock_rate")
    assert diagnosis.magnitude == pytest.approx(4000, rel=0.2)


def test_events_that_count_something_else_are_of_this_sequence(path: Path) -> None:
    """Numbers of simulated frames, 700 a second, in place of microseconds."""
    counted = events(lambda e: replace(e, times_ns=e.times_ns * 700 // 10**9 * 1000))
    counted(log_file()).write(path)
    diagnosis = first_diagnosis(path)
    assert (diagnosis.stream, diagnosis.cause, diagnosis.status) == ("events", "time_unit", "supported")
    assert diagnosis.magnitude == pytest.approx(7e-4, rel=2e-3)


def test_events_of_the_first_moments_were_cut_off(path: Path) -> None:
    """They last as briefly, and agree with the frames of their time."""
    few = events(lambda e: e.keep(np.flatnonzero(e.times_ns < 60 * MS)))
    few(log_file()).write(path)
    diagnosis = first_diagnosis(path)
    assert (diagnosis.stream, diagnosis.cause) == ("events", "truncated")


def test_another_sequence_is_named(path: Path) -> None:
    """Frames of another world leave no agreement at all."""
    other = frames_of(replace(LOG_WORLD, seed=8))
    log_file().altered(frames=other).write(path)
    threshold, diagnoses = diagnosed(path, "event_response.threshold")
    assert diagnoses[0].cause == "other_sequence"
    assert threshold.outcome == "not_observable"


@pytest.mark.parametrize("share", [0.002, 0.01])
def test_conservation_sees_scattered_losses(share: float, path: Path) -> None:
    """One event in five hundred lost here and there breaks the law in some pixels, where all else is silent."""
    keep = lambda e: e.keep(np.random.default_rng(0).uniform(size=len(e)) >= share)  # noqa: E731
    events(keep)(log_file()).write(path)
    failed = {name for name, outcome in outcomes(path).items() if outcome == "failed"}
    assert failed == {"conservation"}


@cache
def from_the_signal() -> EventFile:
    """A sensor whose first reference is the signal at the first frame."""
    begun = log_events(LOG_WORLD, SHAPE, DURATION_MS * MS, phase=0.0)
    return log_file().altered(events=begun).declaring(initial_phase="zero")


def test_a_declared_start_sharpens_conservation(path: Path) -> None:
    """Where E begins at nothing, one event in a thousand lost or doubled is seen in most of its pixels."""
    from_the_signal().write(path)
    assert measured(run_check(path, "event_response.conservation"), "violating_pixels").value == 0
    rng = np.random.default_rng(5)
    chosen = rng.uniform(size=len(from_the_signal().events)) < 0.001
    for change in (
        lambda e: e.keep(~chosen),
        lambda e: inserted(e, replace(e.keep(chosen), times_ns=e.times_ns[chosen] + 5000)),
    ):
        events(change)(from_the_signal()).write(path)
        result, diagnoses = diagnosed(path, "event_response.conservation")
        found = measured(result, "violating_pixels").value
        assert found is not None
        assert found * SHAPE[0] * SHAPE[1] >= 0.6 * np.count_nonzero(chosen)
        assert diagnoses[0].cause == "dropped_samples"


def test_a_start_that_is_misdeclared_alarms_nobody(path: Path) -> None:
    """References that begin anywhere within the thresholds are not held to a start at the signal, declared or not."""
    log_file().declaring(initial_phase="zero").write(path)
    assert measured(run_check(path, "event_response.conservation"), "violating_pixels").value == 0

    begun = linear_events(LINEAR_WORLD, SHAPE, DURATION_MS * MS, phase=1.0)
    linear_file().altered(events=begun).declaring(initial_phase="zero").write(path)
    assert run_check(path, "event_response.conservation").outcome == "passed"


@pytest.mark.parametrize(
    "clean", [log_file, lambda: linear_file().declaring(initial_phase="zero")], ids=["log", "linear"]
)
def test_dead_region_is_named(clean: Callable[[], EventFile], path: Path) -> None:
    """Nine by nine pixels that never fire are a dead region, at their place."""
    dead = events(lambda e: e.keep((e.x < 20) | (e.x >= 29) | (e.y < 10) | (e.y >= 19)))
    dead(clean()).write(path)
    conservation, diagnoses = diagnosed(path, "event_response.conservation")
    diagnosis = next(d for d in diagnoses if d.cause == "dead_region")
    assert (diagnosis.stream, diagnosis.magnitude) == ("events", pytest.approx(9.0, abs=1.5))
    tile = conservation.findings[-1].where.tile
    assert tile is not None
    assert 16 <= tile[0] < 29
    assert 8 <= tile[1] < 19


def test_region_that_is_dead_for_a_while_is_named(path: Path) -> None:
    """Nine by nine pixels that are silent for half of the time lie too close together for a lost packet."""
    after, before = 200 * MS, 600 * MS

    def dead_for_a_while(e: Stream) -> Stream:
        fired = (e.x < 20) | (e.x >= 29) | (e.y < 10) | (e.y >= 19) | (e.times_ns < after) | (e.times_ns >= before)
        return e.keep(fired)

    events(dead_for_a_while)(log_file()).write(path)
    named = [(one.stream, one.cause) for one in diagnoses_of(path, "event_response.conservation")]
    assert named[0] == ("events", "dead_region")


def test_small_dead_region_is_seen_wherever_it_lies(path: Path) -> None:
    """Five by five dead pixels, across the borders of tiles, are in one tile together."""
    dead = events(lambda e: e.keep((e.x < 22) | (e.x >= 27) | (e.y < 14) | (e.y >= 19)))
    dead(log_file()).write(path)
    result = run_check(path, "event_response.conservation")
    assert "event_response.conservation.region" in {finding.code for finding in result.findings}
    assert measured(result, "worst_tile").value == pytest.approx(25 / 64, abs=4 / 64)


def test_frozen_frame_is_placed(path: Path) -> None:
    """The frame that repeats the one before is named."""
    frames(repeated)(log_file()).write(path)
    assert run_check(path, "event_response.frames").findings[0].where.frame in {20, 21}


def test_declared_delays_are_expected(path: Path) -> None:
    """Packets of 2 ms make events a millisecond late on average, which is no fault where they are declared."""
    on_packets = events(lambda e: replace(e, times_ns=-(-e.times_ns // (2 * MS)) * 2 * MS))
    on_packets(log_file()).declaring(packet_interval_us=2000).write(path)
    timing = measured(run_check(path, "event_response.timing"), "time_offset")
    assert timing.expected == pytest.approx(1.0)
    assert timing.value == pytest.approx(1.0, abs=0.15)


def test_declared_leak_is_taken_into_account(path: Path) -> None:
    """Brighter events that leak adds change neither threshold nor conservation where they are declared."""
    leaky = replace(LOG_WORLD, leak_nat_s=0.2 * 2.0)
    leaking = log_events(leaky, SHAPE, DURATION_MS * MS)
    log_file().altered(events=leaking).declaring(leak_rate_hz=2.0).write(path)
    assert set(outcomes(path).values()) <= {"passed", "not_observable"}
    log_file().altered(events=leaking).write(path)
    assert "failed" in outcomes(path).values()


def test_hover_and_night_cannot_be_judged(path: Path) -> None:
    """A scene that hardly moves, or is nearly black, shows no threshold; nothing fails."""
    for world in (replace(LOG_WORLD, velocity_px_s=(2.0, 1.0)), Waves(mean_dn=3.0, amplitude_dn=0.2)):
        still = EventFile(log_events(world, SHAPE, DURATION_MS * MS), frames_of(world))
        found = outcomes(still.write(path))
        assert found["threshold"] == found["timing"] == "not_observable"
        assert "failed" not in found.values()


@pytest.mark.parametrize("count", [1, 2])
def test_few_frames_are_no_crash(count: int, path: Path) -> None:
    """With one or two frames nothing fails."""
    log_file().altered(frames=log_file().frames[:count], frames_ns=FRAMES_NS[:count]).write(path)
    assert set(outcomes(path).values()) <= {"passed", "not_observable"}


def test_cameras_apart_are_not_applicable(path: Path) -> None:
    """A colour camera that sits elsewhere would have to be reprojected; the reason says so."""
    log_file().altered(rgb_moved_m=0.1).write(path)
    results = results_of(path)
    assert {result.outcome for check, result in results.items() if check != "jitter"} == {"not_applicable"}
    assert "one centre" in results["threshold"].reason
    # A declared response would not help, so that its absence is not what a reader is told.
    log_file().altered(rgb_moved_m=0.1).declaring(model="unknown", threshold_on=0.0).write(path)
    assert "parallax" in run_check(path, "event_response.threshold").reason


def test_saturated_frames_tell_nothing(path: Path) -> None:
    """Where frames are clipped to white, no pixel violates anything."""
    white = frames(lambda images: np.full((len(images), *FRAME_SHAPE, 3), 255, np.uint8))
    white(log_file()).write(path)
    by_check = outcomes_with_frames(path)
    # Spacings of events between the times of the frames do not depend on what the frames show.
    assert by_check.pop("interpolation") == "passed"
    assert set(by_check.values()) == {"not_observable"}


@pytest.mark.parametrize(("large", "intervals"), [(False, 12), (True, 8)])
def test_fewer_intervals_of_large_sensors_place_events(
    path: Path, monkeypatch: pytest.MonkeyPatch, large: bool, intervals: int
) -> None:
    """Two intervals each 0.2 s in place of three; both place events that lie three pixels too low, to one."""
    monkeypatch.setattr(alignment, "is_large_sensor", lambda _: large)
    file = log_file()
    file.altered(events=moved_down(file.events)).write(path)
    result = run_check(path, "event_response.alignment")
    assert result.coverage is not None
    assert result.coverage.seen == intervals
    assert measured(result, "shift_down").value == pytest.approx(3.0, abs=1.0)


UNKNOWN_RESPONSES: dict[str, tuple[Change, set[str]]] = {
    "as stored": (lambda file: file, set()),
    "inverted": (events(lambda e: replace(e, p=1 - e.p)), {"polarity_inverted"}),
    "mirrored": (events(lambda e: replace(e, x=(SHAPE[1] - 1 - e.x).astype(np.uint16))), {"mirrored"}),
}


def test_pixels_at_their_first_reference_are_expected_to_be_silent(path: Path) -> None:
    """Hardly any pixel of a faint scene passes a threshold: all noise of the levels would leave 0.79."""
    world, threshold = replace(LOG_WORLD, amplitude_dn=6.0, velocity_px_s=(20.0, 3.0)), 0.3
    silent = log_events(world, SHAPE, DURATION_MS * MS, threshold, threshold, phase=0.0)
    file = EventFile(silent, frames_of(world)).declaring(threshold_on=threshold, threshold_off=threshold)
    result = run_check(file.declaring(initial_phase="zero").write(path), "event_response.orientation")
    assert result.outcome == "not_observable"
    assert "the expected correlation is only 0.1" in result.reason
    uniform = run_check(file.declaring(initial_phase="uniform").write(path), "event_response.orientation")
    assert measured(uniform, "correlation").expected == pytest.approx(0.79, abs=0.01)


@pytest.mark.parametrize("model", ["log", "linear"])
@pytest.mark.parametrize(("change", "causes"), UNKNOWN_RESPONSES.values(), ids=UNKNOWN_RESPONSES)
def test_orientation_needs_no_declared_response(path: Path, model: str, change: Change, causes: set[str]) -> None:
    """Whatever it is, brighter events are where frames become brighter; how well they correlate is not judged."""
    change(log_file() if model == "log" else linear_file()).write(path)
    with h5py.File(path, "r+") as file:
        del file["metadata/events"]
    result, diagnoses = diagnosed(path, "event_response.orientation")
    assert [one.name for one in result.measurements] == ["advantage_of_another_orientation"]
    assert result.outcome == ("failed" if causes else "passed")
    assert {diagnosis.cause for diagnosis in diagnoses[:1]} == causes


def without_response(file: EventFile, path: Path) -> tuple[Result, dict[str, Any]]:
    """Return the result of the threshold check of a file that declares no sensor, and what the record infers."""
    file.write(path)
    with h5py.File(path, "r+") as stored:
        del stored["metadata/events"]
    record = measured_record(path, "event_response")
    (result,) = (result for result in record.results if result.check == "event_response.threshold")
    return result, dict(record.inferred)


@pytest.mark.parametrize(
    ("model", "unit", "tolerance"), [("log", "nat", 0.005), ("linear", "dn", 0.5)], ids=["log", "linear"]
)
def test_undeclared_thresholds_are_estimated_and_not_judged(
    path: Path, model: str, unit: str, tolerance: float
) -> None:
    """Domain and thresholds are those of the world, linear ones to half a value, and compared with nothing."""
    file, threshold = (log_file(), 0.2) if model == "log" else (linear_file(), 6.0)
    result, inferred = without_response(file, path)
    assert (result.outcome, result.measurements, result.findings) == ("not_observable", (), ())
    assert f"events fit the {model} model" in result.reason
    assert inferred["events.response"] == model
    for polarity in ("on", "off"):
        assert inferred[f"events.threshold_{polarity}_{unit}"] == pytest.approx(threshold, abs=tolerance)


def test_inverted_events_have_no_undeclared_thresholds(path: Path) -> None:
    """Thresholds below zero are none of a sensor: what events.orientation names is not stated as a response."""
    result, inferred = without_response(events(lambda e: replace(e, p=1 - e.p))(log_file()), path)
    assert (result.outcome, result.findings) == ("not_observable", ())
    assert "event_response.orientation" in result.reason
    assert not any(name.startswith("events.threshold") for name in inferred)
