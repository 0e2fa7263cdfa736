"""Flights called after the paper's sequences have the paper's figures."""

from pathlib import Path

import numpy as np
import pytest

from fedora_generator.camera import event_camera
from fedora_generator.errors import SceneError
from fedora_generator.flights.kinds import LoopOptions
from fedora_generator.flights.presets import PRESET_NAMES, preset_table
from fedora_generator.scene import Scene, load_scene
from fedora_generator.surroundings import surroundings_of
from tests.benchmarks.presets.paper import PAPER
from tests.benchmarks.presets.path import flown


def preset(folder: Path, name: str, extra: str = "") -> Scene:
    path = folder / "scene.toml"
    path.write_text(f'base = "park-day"\n[flight]\nkind = "preset"\nname = "{name}"\n{extra}')
    return load_scene(path)


def test_the_presets_are_those_of_the_paper() -> None:
    """One for each row of the table."""
    assert set(PRESET_NAMES) == set(PAPER)


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_a_preset_has_the_papers_figures(name: str) -> None:
    """Length, distance, greatest speed and greatest angular speed of the scene are those of the table, to 0.1%."""
    scene, paper = load_scene(name), PAPER[name]
    expected = (paper.length_s, paper.distance_m, paper.speed_m_s, paper.angular_speed_rad_s)
    np.testing.assert_allclose(flown(scene), expected, rtol=1e-3)


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_a_preset_is_free_of_its_world(name: str) -> None:
    """A body of 0.4 m around the position meets nothing from start to end; 2 m lower it would."""
    scene = load_scene(name)
    positions_m = scene.fly().states_at(np.arange(0, PAPER[name].length_s, 0.02)).positions_world_m
    corners_m = 0.2 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    around_m = (positions_m[:, None] + corners_m).reshape(-1, 3)
    surroundings = surroundings_of(scene)
    assert surroundings.collision(around_m) is None
    assert surroundings.collision(around_m - [0, 0, 2]) is not None


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_a_preset_has_the_sensor_of_the_paper(name: str) -> None:
    """Linear model, 30 DN either way, at the full size of 640x480."""
    scene = load_scene(name)
    assert (scene.events.model, scene.events.threshold_on, scene.events.threshold_off) == ("linear", 30.0, 30.0)
    assert (event_camera(scene.camera).width, event_camera(scene.camera).height) == (640, 480)


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
