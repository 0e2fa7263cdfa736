"""Events against colour, whatever polarity, thresholds and model: shifts are found, and the odd camera is told."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.record.types import Result
from tests.checks.event_file import LOG_WORLD, SHAPE, EventFile, linear_file, log_file
from tests.support.checked import rules, run_check

CHECK = "alignment.events"


def shifted(file: EventFile, right_px: int) -> EventFile:
    """The file with events farther to the right; those that leave the sensor are lost."""
    events = file.events
    kept = events.keep((events.x.astype(int) + right_px >= 0) & (events.x.astype(int) + right_px < SHAPE[1]))
    return file.altered(events=replace(kept, x=(kept.x.astype(int) + right_px).astype(np.uint16)))


def value_of(result: Result, name: str) -> float:
    return next(m.value for m in result.measurements if m.name == name and m.value is not None)


def test_clean_file_passes(tmp_path: Path) -> None:
    """Events of a sensor of grey values are in place to a fraction of a pixel."""
    result = run_check(linear_file().write(tmp_path / "clean.h5"), CHECK)
    assert result.outcome == "passed"
    assert abs(value_of(result, "shift_right")) < 0.2
    assert abs(value_of(result, "shift_down")) < 0.2


def test_lag_of_an_even_drift_is_allowed_for(tmp_path: Path) -> None:
    """In low contrast, where all moves to the right, events lag a pixel behind, within what levels leave open."""
    result = run_check(log_file().write(tmp_path / "clean.h5"), CHECK)
    assert not result.findings
    assert -1.3 < value_of(result, "shift_right") < -0.5


def test_polarity_and_thresholds_do_not_matter(tmp_path: Path) -> None:
    """Inverted polarity and wrongly declared thresholds change no digit."""
    file = log_file()
    inverted = file.altered(events=replace(file.events, p=1 - file.events.p)).declaring(threshold_on=0.7)
    results = [run_check(one.write(tmp_path / f"{i}.h5"), CHECK) for i, one in enumerate((file, inverted))]
    assert results[0].measurements == results[1].measurements


@pytest.mark.parametrize(("amplitude_dn", "seed"), [(5.0, 3), (6.0, 3), (6.0, 7)])
def test_events_of_faint_texture_may_lag_by_pixels(amplitude_dn: float, seed: int, tmp_path: Path) -> None:
    """Where levels change by less than a threshold between frames, a shift of one to two pixels is the lag.

    With a step from the change of the pixels that fire, a third of a threshold or less, its bound was a pixel.
    """
    world = replace(LOG_WORLD, amplitude_dn=amplitude_dn, seed=seed, velocity_px_s=(60.0, 25.0))
    result = run_check(log_file(world).write(tmp_path / "faint.h5"), CHECK)
    assert result.outcome == "not_observable"
    assert value_of(result, "shift_right") < -1


@pytest.mark.parametrize("right_px", [4, -2])
def test_shift_is_found_and_sized(right_px: int, tmp_path: Path) -> None:
    """Four pixels to the right, and two to the left, beside the lag of the clean file."""
    clean = value_of(run_check(log_file().write(tmp_path / "clean.h5"), CHECK), "shift_right")
    result = run_check(shifted(log_file(), right_px).write(tmp_path / "shifted.h5"), CHECK)
    assert "shift" in rules(result)
    assert value_of(result, "shift_right") - clean == pytest.approx(right_px, abs=0.15)


@pytest.mark.parametrize("right_px", [0, 2])
def test_quarters_of_large_frames_tell(right_px: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a quarter of the rows has its turn in each interval, the shift is that of the whole image."""
    path = shifted(log_file(), right_px).write(tmp_path / "file.h5")
    whole = run_check(path, CHECK)
    monkeypatch.setattr("fedora_qa.views.frames.USUAL_PIXELS", 1000)
    result = run_check(path, CHECK)
    assert result.coverage == whole.coverage
    assert rules(result) == rules(whole)
    assert value_of(result, "shift_right") == pytest.approx(value_of(whole, "shift_right"), abs=0.3)
    assert result.measurements != whole.measurements


@pytest.mark.parametrize("right_px", [6, -9])
def test_shift_beyond_the_reach_of_pixels_is_found(right_px: int, tmp_path: Path) -> None:
    """On blocks of pixels, to two standard errors."""
    result = run_check(shifted(log_file(), right_px).write(tmp_path / "shifted.h5"), CHECK)
    assert "shift" in rules(result)
    assert value_of(result, "shift_right") == pytest.approx(right_px, abs=1.5)


def test_what_cannot_be_told_is_said(tmp_path: Path) -> None:
    """A colour camera elsewhere is not applicable; events of no scene are not observable."""
    elsewhere = run_check(log_file().altered(rgb_moved_m=0.1).write(tmp_path / "elsewhere.h5"), CHECK)
    assert (elsewhere.outcome, elsewhere.reason) == (
        "not_applicable", "the cameras events and rgb do not share one centre",
    )  # fmt: skip
    rng, events = np.random.default_rng(2), log_file().events
    x, y = (rng.integers(0, size, len(events)).astype(np.uint16) for size in (SHAPE[1], SHAPE[0]))
    chance = log_file().altered(events=replace(events, x=x, y=y))
    assert run_check(chance.write(tmp_path / "chance.h5"), CHECK).outcome == "not_observable"


def test_the_brighter_side_of_edges_draws_no_events(tmp_path: Path) -> None:
    """A linear sensor has its steps in light, as declared; compared in log, the bright sky draws its events upwards."""
    scene = load_scene("park-day").with_size(180, 136)
    events = replace(scene.events, model="linear", threshold_on=4.0, threshold_off=6.0)
    linear, as_log = tmp_path / "linear.h5", tmp_path / "as_log.h5"
    generate_sequence(
        replace(scene, events=events, event_step_us=500), linear, Request(duration_s=0.4, quality="draft")
    )
    as_log.write_bytes(linear.read_bytes())
    with h5py.File(as_log, "a") as file:
        file["metadata/events"].attrs.update({"model": "log", "threshold_on": 0.2, "threshold_off": 0.2})
    assert abs(value_of(run_check(linear, CHECK), "shift_down")) < 0.05
    assert value_of(run_check(as_log, CHECK), "shift_down") < -0.1


@pytest.mark.parametrize("count", [3, 40, 800])
def test_few_events_agree_by_chance(count: int, tmp_path: Path) -> None:
    """Some correlation is the largest of all shifts, however few they are: it must exceed that of chance."""
    events = log_file().events
    chosen = np.zeros(len(events), np.bool_)
    chosen[np.linspace(0, len(events) - 1, count).astype(int)] = True
    result = run_check(log_file().altered(events=events.keep(chosen)).write(tmp_path / "few.h5"), CHECK)
    assert result.outcome == "not_observable"
    assert "by chance" in result.reason
