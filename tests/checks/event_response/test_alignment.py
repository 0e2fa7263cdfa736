"""Shift of events against frames where texture is faint, and behind a low-pass."""

from pathlib import Path

import pytest

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from tests.support.checked import run_check

DOWNWARDS = """
name = "downwards"
base = "park-day"
description = "The camera looks straight down at grass."
[flight]
position_m = [0.0, 0.0, 3.0]
[camera]
pitch_deg = 90.0
[events]
threshold_on = {threshold}
threshold_off = {threshold}
"""


def downwards(folder: Path, threshold: float) -> Path:
    """A file of 0.5 s above grass, whose luma varies by a few hundredths from blade to blade."""
    scene, path = folder / "downwards.toml", folder / f"{threshold}.h5"
    scene.write_text(DOWNWARDS.format(threshold=threshold))
    generate_sequence(load_scene(str(scene)).with_size(160, 120), path, Request(duration_s=0.5, quality="draft"))
    return path


def test_events_of_texture_that_has_passed_are_no_shift(tmp_path: Path) -> None:
    """A pixel of grass fires after several periods of it have passed: events correlate with other blades by then."""
    result = run_check(downwards(tmp_path, 0.2), "event_response.alignment")
    assert result.outcome == "not_observable"
    assert "detection limit too large: shift_right" in result.reason


def test_smaller_thresholds_resolve_the_texture(tmp_path: Path) -> None:
    """With a threshold that half a period exceeds, the same grass shows where the events lie."""
    result = run_check(downwards(tmp_path, 0.03), "event_response.alignment")
    shifts = {each.name: each for each in result.measurements if each.name in {"shift_right", "shift_down"}}
    assert result.outcome == "passed"
    for shift in shifts.values():
        assert shift.value == pytest.approx(0.0, abs=0.3)
        assert shift.limit is not None
        assert shift.limit < 1.0


FAST_TURN = """
name = "slow-sensor"
base = "fast-turn"
description = "A fast turn behind a low-pass with a time constant of 3 ms."
[events]
bandwidth_hz = 50.0
"""


def test_the_lag_of_a_declared_low_pass_is_no_shift(tmp_path: Path) -> None:
    """The light follows from the level and its derivative; the level alone lies 0.9 px behind."""
    scene, path = tmp_path / "turn.toml", tmp_path / "turn.h5"
    scene.write_text(FAST_TURN)
    source = load_scene(str(scene)).with_size(240, 180).starting_at(0.5)
    generate_sequence(source, path, Request(duration_s=0.5, quality="draft"))
    result = run_check(path, "event_response.alignment")
    (shift,) = (each for each in result.measurements if each.name == "shift_right")
    assert result.outcome == "passed"
    assert shift.value == pytest.approx(0, abs=0.4)
    assert shift.limit is not None
    assert shift.limit < 1.0
