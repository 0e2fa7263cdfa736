"""Flights called after the paper's sequences have the paper's figures."""

from pathlib import Path

import numpy as np
import pytest

from fedora_generator.errors import SceneError
from fedora_generator.flight import LoopOptions
from fedora_generator.flights.presets import PRESET_NAMES, preset_table
from fedora_generator.scene import Scene, load_scene
from fedora_generator.surroundings import surroundings_of

# Length s, distance m, greatest speed m/s, greatest angular speed rad/s: the sequence table of the FEDORA paper.
PAPER = {
    "baylands-day1": (165, 594.87, 5.032, 1.233),
    "baylands-day2": (220, 386.31, 2.531, 2.845),
    "baylands-ngt1": (159, 268.47, 2.416, 10.718),
    "racetrack-day": (112, 188.86, 2.218, 2.374),
    "racetrack-ngt": (112, 188.36, 2.058, 2.098),
}
STEP_S = 2e-3


def preset(folder: Path, name: str, extra: str = "") -> Scene:
    world = "park-day" if name.startswith("baylands") else "racetrack-day"
    path = folder / "scene.toml"
    path.write_text(f'base = "{world}"\n[flight]\nkind = "preset"\nname = "{name}"\n{extra}')
    return load_scene(path)


def test_the_presets_are_those_of_the_paper() -> None:
    """One for each row of the table."""
    assert set(PRESET_NAMES) == set(PAPER)


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_a_preset_has_the_papers_figures(name: str, tmp_path: Path) -> None:
    """Length, distance, greatest speed and greatest angular speed are those of the table, to 2%; most to 0.1%."""
    scene = preset(tmp_path, name)
    assert isinstance(scene.flight, LoopOptions)
    length_s, *_ = PAPER[name]
    states = scene.fly().states_at(np.arange(0.5 * STEP_S, length_s, STEP_S))
    speeds_m_s = np.linalg.norm(states.velocities_world_m_s, axis=1)
    angular_speeds_rad_s = np.linalg.norm(states.angular_velocities_body_rad_s, axis=1)
    found = (scene.flight.route().duration_s, speeds_m_s.sum() * STEP_S, speeds_m_s.max(), angular_speeds_rad_s.max())
    np.testing.assert_allclose(found, PAPER[name], rtol=0.02)


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_a_preset_is_free_of_the_world_it_is_made_for(name: str, tmp_path: Path) -> None:
    """A body of 0.4 m around the position meets nothing of park or racetrack from start to end; 2 m lower it would."""
    scene = preset(tmp_path, name)
    positions_m = scene.fly().states_at(np.arange(0, PAPER[name][0], 0.02)).positions_world_m
    corners_m = 0.2 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    around_m = (positions_m[:, None] + corners_m).reshape(-1, 3)
    surroundings = surroundings_of(scene)
    assert surroundings.collision(around_m) is None
    assert surroundings.collision(around_m - [0, 0, 2]) is not None


def test_a_scene_changes_a_preset_key_by_key(tmp_path: Path) -> None:
    """Keys beside the name are put over those of the preset, a wind among them."""
    wind = "laps = 1\n[flight.wind]\nspeed_m_s = 2\n"
    scene, plain = preset(tmp_path, "baylands-day1", wind), preset(tmp_path, "baylands-day1")
    assert isinstance(scene.flight, LoopOptions)
    assert isinstance(plain.flight, LoopOptions)
    assert scene.flight.laps == 1
    assert scene.flight.wind is not None
    assert scene.flight.waypoints == plain.flight.waypoints
    with pytest.raises(SceneError, match=r"Expected only known keys, got flight\.lap"):
        preset(tmp_path, "baylands-day1", "lap = 1\n")


def test_an_unknown_preset_is_refused() -> None:
    """The known ones are listed."""
    with pytest.raises(SceneError, match=r"one of the flights baylands-day1, .* got 'moon'"):
        preset_table({"kind": "preset", "name": "moon"})
