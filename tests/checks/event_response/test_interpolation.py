"""Events that are interpolated between renders, made by a naive simulator that shares no line with the generator."""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from fedora_qa.record.types import Result
from tests.checks.event_file import (
    DURATION_MS,
    FRAMES_NS,
    LOG_WORLD,
    SHAPE,
    SHARP_WORLD,
    EventFile,
    linear_file,
    log_file,
)
from tests.estimators.event_world import MS, Stream, Waves
from tests.support.checked import diagnosed, run_check
from tests.support.naive_events import naive_events

CHECK = "event_response.interpolation"


def rendered(world: Waves, renders_hz: int, threshold: float = 0.2) -> EventFile:
    """The closed-form world, with events of exact renders at a rate."""
    times_us = list(range(0, DURATION_MS * 1_000 + 1, 1_000_000 // renders_hz))
    renders = [world.luma(1e-6 * time_us, SHAPE) for time_us in times_us]
    return replace(log_file(world, threshold), events=naive_events(renders, times_us, threshold))


def from_frames(file: EventFile, threshold: float = 0.2) -> EventFile:
    """The same frames, with events of nothing but them."""
    size = (SHAPE[1], SHAPE[0])
    frames = [cv2.resize(frame[..., 0].astype(float), size, interpolation=cv2.INTER_AREA) for frame in file.frames]
    return replace(file, events=naive_events(frames, (FRAMES_NS // 1_000).tolist(), threshold))


@dataclass(frozen=True)
class Lines:
    """What the check measures."""

    outcome: str
    share: float
    error: float
    statement: str


def lines_of(file: EventFile, path: Path) -> Lines:
    return lines_in(run_check(file.write(path), CHECK))


def lines_in(result: Result) -> Lines:
    (measured,) = result.measurements
    assert measured.value is not None
    assert measured.standard_error is not None
    return Lines(result.outcome, measured.value, measured.standard_error, "".join(f.message for f in result.findings))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "events.h5"


WORLDS = pytest.mark.parametrize(
    ("world", "threshold"),
    [(LOG_WORLD, 0.2), (SHARP_WORLD, 0.2), (replace(LOG_WORLD, velocity_px_s=(40.0, 20.0)), 0.05)],
)


@WORLDS
def test_light_that_moves_gives_no_lines(world: Waves, threshold: float, path: Path) -> None:
    """Clean: less than two standard errors."""
    lines = lines_of(log_file(world, threshold), path)
    assert lines.outcome == "passed"
    assert lines.share < 2 * lines.error


@WORLDS
def test_events_of_the_frames_alone_are_found(world: Waves, threshold: float, path: Path) -> None:
    """Nearly all changes are lines; the first diagnosis of all checks of events is the fault."""
    file = from_frames(log_file(world, threshold), threshold)
    result, diagnoses = diagnosed(file.write(path), CHECK)
    lines = lines_in(result)
    assert lines.outcome == "failed"
    assert lines.share > 0.9
    assert lines.share > 10 * lines.error
    assert "50 Hz" in lines.statement
    first = diagnoses[0]
    assert (first.cause, first.stream) == ("interpolated_frames", "events")


def blended(file: EventFile, exponent: float, steps: int, threshold: float = 0.2) -> EventFile:
    """The same frames, with events of blends of light^exponent; between its steps the logarithm is straight."""
    size = (SHAPE[1], SHAPE[0])
    frames = [cv2.resize(frame[..., 0].astype(float), size, interpolation=cv2.INTER_AREA) for frame in file.frames]
    values = [np.maximum(frame, 0.5) ** exponent for frame in frames]
    renders = [
        (before + (after - before) * step / steps) ** (1 / exponent)
        for before, after in pairwise(values)
        for step in range(steps)
    ]
    period_us = int(FRAMES_NS[1]) // 1_000
    times_us = [i * period_us // steps for i in range(len(renders) + 1)]
    return replace(file, events=naive_events([*renders, frames[-1]], times_us, threshold))


@WORLDS
@pytest.mark.parametrize("steps", [10, 50])
def test_light_that_is_blended_between_frames_is_found(world: Waves, threshold: float, steps: int, path: Path) -> None:
    """The spacings of its events grow or shrink by the threshold, whatever the level."""
    lines = lines_of(blended(log_file(world, threshold), 1.0, steps, threshold), path)
    assert lines.outcome == "failed"
    assert lines.share > 0.6
    assert "50 Hz are straight lines of light" in lines.statement


@pytest.mark.parametrize("steps", [10, 50])
def test_codes_that_are_blended_between_frames_are_found(steps: int, path: Path) -> None:
    """By the exponent of the declared curve; the light of the frames is that of a linear file."""
    file = blended(log_file(SHARP_WORLD), 1 / 2.2, steps)
    codes = np.rint(255 * (file.frames / 255) ** (1 / 2.2)).astype(np.uint8)
    replace(file, frames=codes).write(path)
    with h5py.File(path, "r+") as stored:
        stored["path/rgb"].attrs["transfer"] = "gamma2.2"
    result = run_check(path, CHECK)
    assert result.outcome == "failed"
    assert "straight lines of code values" in result.findings[0].message


@pytest.mark.parametrize("renders_hz", [100, 200])
def test_renders_at_a_multiple_of_the_frames_are_found(renders_hz: int, path: Path) -> None:
    """Where the image moves by more than a pixel from render to render, here 4.1 px from frame to frame."""
    lines = lines_of(rendered(LOG_WORLD, renders_hz, threshold=0.05), path)
    assert lines.outcome == "failed"
    assert lines.share > 0.8
    assert f"{renders_hz} Hz" in lines.statement


def test_renders_within_a_pixel_of_motion_are_those_of_a_good_simulator(path: Path) -> None:
    """4.1 px from frame to frame are less than a pixel from render to render."""
    lines = lines_of(rendered(LOG_WORLD, 250, threshold=0.1), path)
    assert lines.outcome == "passed"
    assert abs(lines.share) < 3 * lines.error


def test_a_stretch_is_found_at_its_place(path: Path) -> None:
    """Frames interpolated in the second quarter of the file only."""
    clean, faulty = log_file(), from_frames(log_file())
    inside = [200 * MS < time <= 400 * MS for time in faulty.events.times_ns]
    outside = [not 200 * MS < time <= 400 * MS for time in clean.events.times_ns]
    columns = {
        name: np.concatenate([getattr(clean.events, name)[outside], getattr(faulty.events, name)[inside]])
        for name in ("x", "y", "times_ns", "p")
    }
    order = np.argsort(columns["times_ns"], kind="stable")
    file = replace(clean, events=Stream(**{name: values[order] for name, values in columns.items()}))
    result = run_check(file.write(path), CHECK)
    assert result.outcome == "failed"
    (finding,) = result.findings
    assert (finding.where.start_us, finding.where.stop_us) == (200_000, 400_000)


@pytest.mark.parametrize("packet_us", [100, 200])
def test_packets_hide_nothing_and_raise_nothing(packet_us: int, path: Path) -> None:
    """Timestamps on a grid are lines by chance more often, within as across."""

    def packed(file: EventFile) -> EventFile:
        ticks = -(-file.events.times_ns // (1_000 * packet_us))
        return replace(file, events=replace(file.events, times_ns=1_000 * packet_us * ticks)).declaring(
            packet_interval_us=packet_us
        )

    assert lines_of(packed(log_file(threshold=0.1)), path).outcome == "passed"
    path.unlink()
    assert lines_of(packed(from_frames(log_file(threshold=0.1), 0.1)), path).outcome == "failed"


@pytest.mark.parametrize("threshold", [0.1, 0.2])
def test_a_part_of_the_intervals_suffices(threshold: float, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three of ten are used: clean and interpolated events are told apart, with a larger error."""
    clean = log_file(threshold=threshold)
    error = lines_of(clean, path).error
    monkeypatch.setattr("fedora_qa.views.frames.USUAL_PIXELS", 1000)
    path.unlink()
    result = run_check(clean.write(path), CHECK)
    lines, coverage = lines_in(result), result.coverage
    assert lines.outcome == "passed"
    # sqrt(10 / 3) = 1.8 where lines occur, and 10 / 3 where the added ones are most of them. A blend whose limit is of
    # no use then is not stated, and the next one has a smaller error.
    assert error < lines.error < 3.6 * error
    assert coverage is not None
    assert 0.25 * coverage.of < coverage.seen < 0.4 * coverage.of
    path.unlink()
    faulty = lines_of(from_frames(clean, threshold), path)
    assert faulty.outcome == "failed"
    assert faulty.share > 0.9


def test_steps_of_a_millisecond_show_no_spacings(path: Path) -> None:
    """The simulated DVS plugin gives one event a step."""
    result = run_check(linear_file().write(path), CHECK)
    assert result.outcome == "not_observable"
    assert "steps of 1 ms" in result.reason


def test_a_still_scene_is_not_observable(path: Path) -> None:
    """Few pixels change by three thresholds between two frames."""
    result = run_check(log_file(replace(LOG_WORLD, velocity_px_s=(0.5, 0.2))).write(path), CHECK)
    assert result.outcome == "not_observable"


def test_frames_without_events_around_are_not_observable(path: Path) -> None:
    """A file of one frame has no interval."""
    log_file().write(path)
    with h5py.File(path, "r+") as file:
        for key in ("path/rgb", "path/rgb_ts"):
            rows = file[key][:1]
            del file[key]
            file[key] = rows
    assert run_check(path, CHECK).outcome == "not_observable"
