"""Scenes: those of the package load; what cannot be is refused in one sentence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fedora_generator.scene
from fedora_generator.choices import SCENE_NAMES
from fedora_generator.errors import SceneError
from fedora_generator.generate import require_free_flight
from fedora_generator.scene import load_scene
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Box, Rectangle, World

SCENES = Path(fedora_generator.scene.__file__).parent / "scenes"
PACKAGED = [load_scene(name) for name in SCENE_NAMES]

LEAST = """
name = "least"
description = "a wall"

[world]
name = "wall"
textures.grey = { dark_rgb = [0.2, 0.2, 0.2], light_rgb = [0.8, 0.8, 0.8] }
boxes = [{ name = "wall", center_m = [5, 0, 0], size_m = [1, 9, 9], texture = "grey" }]

[light]
name = "day"
ambient = 1.0
sky_horizon_rgb = [0.5, 0.5, 0.5]
sky_zenith_rgb = [0.5, 0.5, 0.5]

[flight]
position_m = [0, 0, 0]

[events]
model = "log"
threshold_on = 0.2
threshold_off = 0.2
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_every_scene_of_the_package_loads() -> None:
    """The list is the folder, park-day first, and each scene is called as its file is."""
    assert [scene.name for scene in PACKAGED] == list(SCENE_NAMES)
    assert SCENE_NAMES[0] == "park-day"
    assert {path.stem for path in SCENES.glob("*.toml")} == set(SCENE_NAMES)
    assert all(scene.description for scene in PACKAGED)


def test_every_scene_of_the_package_can_be_flown_for_20_seconds() -> None:
    """No camera meets the world, the pace of the hover and the turn included."""
    for scene in PACKAGED:
        require_free_flight(scene, 20_000_000)


def test_the_noisy_scene_declares_every_noise() -> None:
    """No noise option of the sensors is left at 0, and the clean scenes have none."""
    noisy, clean = load_scene("park-noisy"), load_scene("park-day")
    effects = ("threshold_sigma", "leak_rate_hz", "shot_rate_hz", "bandwidth_hz", "refractory_us", "hot_pixel_count")
    assert all(getattr(noisy.events, name) > 0 for name in effects)
    assert not any(getattr(clean.events, name) for name in effects)
    for sensor, names in (
        ("imu", ("gyro_noise_density", "accel_noise_density", "gyro_bias_walk", "accel_bias_walk")),
        ("pose", ("position_sigma_m", "rotation_sigma_rad")),
    ):
        assert all(getattr(getattr(noisy, sensor), name) > 0 for name in names)
        assert not any(getattr(getattr(clean, sensor), name) for name in names)


def test_a_scene_of_ones_own(tmp_path: Path) -> None:
    """A file with a world of its own; everything not said has its default."""
    scene = load_scene(written(tmp_path, LEAST))
    assert scene.world.boxes[0].size_m == (1, 9, 9)
    assert scene.depth_range_m == (0.1, 30.0)
    assert (scene.camera.width, scene.camera.height) == (1440, 1080)


def test_a_base_is_changed_key_by_key(tmp_path: Path) -> None:
    """What a scene says of its base's tables is put over them; the rest stays."""
    scene = load_scene(written(tmp_path, 'base = "park-day"\nname = "mine"\n[events]\nthreshold_on = 0.3\n'))
    base = load_scene("park-day")
    assert scene.events == replace(base.events, threshold_on=0.3)
    assert scene.world == base.world


def test_a_world_beside_the_scene(tmp_path: Path) -> None:
    """``world`` may name a TOML file in the scene's folder."""
    (tmp_path / "own.toml").write_text((SCENES / "worlds" / "park.toml").read_text())
    scene = load_scene(written(tmp_path, 'base = "hover"\nworld = "own.toml"\n'))
    assert scene.world == load_scene("hover").world


def test_a_world_is_built_upon_another(tmp_path: Path) -> None:
    """Textures are put over those of the base key by key; boxes and lamps are added; the base may be one's own."""
    (tmp_path / "own.toml").write_text(
        'base = "park"\nname = "own"\n[textures.lawn]\ndark_rgb = [0.1, 0.1, 0.1]\n'
        '[[boxes]]\nname = "crate"\ncenter_m = [5, 5, 0.5]\nsize_m = [1, 1, 1]\ntexture = "wood"\n'
    )
    (tmp_path / "next.toml").write_text('base = "own.toml"\nname = "next"\n[[lamps]]\nposition_m = [0, 0, 9]\n')
    park = load_scene("hover").world
    world = load_scene(written(tmp_path, 'base = "hover"\nworld = "next.toml"\n')).world
    assert world.name == "next"
    assert world.textures["lawn"] == replace(park.textures["lawn"], dark_rgb=(0.1, 0.1, 0.1))
    assert {**world.textures, "lawn": park.textures["lawn"]} == park.textures
    assert [box.name for box in world.boxes] == [*(box.name for box in park.boxes), "crate"]
    assert world.rectangles == park.rectangles
    assert (world.lamps[:-1], world.lamps[-1].position_m) == (park.lamps, (0, 0, 9))


def test_a_scene_starts_anywhere_on_its_flight() -> None:
    """A second of the clock is a second of the flight later; what is left of the flight is less by as much."""
    scene = load_scene("baylands-ngt1")
    later, times_s = scene.starting_at(34.0), np.linspace(0, 2, 9)
    np.testing.assert_array_equal(
        later.fly().states_at(times_s).orientations_xyzw, scene.fly().states_at(34.0 + times_s).orientations_xyzw
    )
    assert later.remaining_s == pytest.approx(scene.remaining_s - 34.0)
    assert load_scene("hover").starting_at(5.0).remaining_s is None
    assert later.digest != scene.digest


@pytest.mark.parametrize("start_s", [-1.0, float("nan"), float("inf"), 160.0])
def test_a_start_off_the_flight_is_refused(start_s: float) -> None:
    """Before it, after it, or nowhere."""
    with pytest.raises(SceneError, match=r"Expected (a start before the end|start_s >= 0)"):
        load_scene("baylands-ngt1").starting_at(start_s)


def test_the_digest_tells_scenes_apart() -> None:
    """Any value changes it; reading the same scene again does not."""
    scene = load_scene("park-day")
    assert scene.digest == load_scene("park-day").digest
    digests = {scene.with_size(72, 54).digest, *(other.digest for other in PACKAGED)}
    assert len(digests) == 1 + len(PACKAGED)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("threshold_on = 0.2", "thresold_on = 0.2", r"only known keys, got events.thresold_on"),
        ("ambient = 1.0", "ambient = 1.0\nmoon = 3", r"Expected only known keys, got light.moon; remove or correct it"),
        ("position_m = [0, 0, 0]", "", r"Expected a value for flight.position_m, got none"),
        ("threshold_on = 0.2", "threshold_on = 0.0", r"Expected threshold_on .* got 0.0, at events"),
        ('model = "log"', 'model = "linear"', r"Expected event_step_us with the linear model"),
        ("ambient = 1.0", "ambient = 0.0", r"Expected ambient > 0, got 0.0; black surfaces .*, at light"),
        ("ambient = 1.0", 'ambient = "much"', r"got 'much' at light.ambient"),
        ('texture = "grey"', 'texture = "gray"', r"Expected a texture of the world \(grey\), got 'gray' at 'wall'"),
        ("size_m = [1, 9, 9]", "size_m = [1, 0, 9]", r"Expected size_m > 0, got \(1.0, 0.0, 9.0\) at 'wall'"),
        ("[light]", "depth_range_m = [5.0, 1.0]\n[light]", r"only known keys, got world.depth_range_m"),
        ('name = "least"', 'name = "least"\ndepth_range_m = [5.0, 1.0]', r"Expected depth_range_m to ascend"),
        ('name = "least"', 'name = "least"\nseed = -1', r"Expected seed >= 0, got -1"),
        ('name = "least"', "name = ", r"Expected a readable TOML file"),
        ('name = "least"', 'base = "no-such"', r"Expected one of the scenes park-day, .* got 'no-such'"),
        ("light_rgb = [0.8, 0.8, 0.8]", "light_rgb = [1.8, 0.8, 0.8]", r"Expected albedos above 0 and up to 1"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_sentence(tmp_path: Path, old: str, new: str, message: str) -> None:
    """The key and the value that are wrong are named, on one line."""
    assert old in LEAST
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(written(tmp_path, LEAST.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["no-such", "no-such.toml", "", "scenes/park-day"])
def test_an_unknown_scene_is_refused(name: str) -> None:
    """The known ones are listed."""
    with pytest.raises(SceneError, match="park-day, park-night, racetrack, hover"):
        load_scene(name)


def test_an_unknown_world_is_refused(tmp_path: Path) -> None:
    """The known ones are listed."""
    with pytest.raises(SceneError, match="Expected one of the worlds baylands, park, racetrack, speedway"):
        load_scene(written(tmp_path, 'base = "hover"\nworld = "moon"\n'))


def test_a_flight_into_the_world_is_refused() -> None:
    """The box or ground that it meets, and when, are named; the lever arm of the camera counts."""
    scene = load_scene("park-day")
    ahead = Box(name="new wall", center_m=(3.0, 0.0, 1.0), size_m=(0.2, 5.0, 4.0), texture="brick")
    walled = replace(scene, world=replace(scene.world, boxes=(*scene.world.boxes, ahead)))
    require_free_flight(walled, 1_000_000)
    with pytest.raises(SceneError, match=r"got inside 'new wall' at 1\.\d+ s"):
        require_free_flight(walled, 2_000_000)
    buried = replace(scene, flight=replace(scene.flight, position_m=(0.0, 0.0, -0.5)))
    with pytest.raises(SceneError, match="got below 'lawn' at 0 s"):
        require_free_flight(buried, 100_000)


def test_a_box_knows_its_inside() -> None:
    """Points in a turned box by hand: along its own axes, not the world's."""
    box = Box(name="b", center_m=(1.0, 1.0, 1.0), size_m=(4.0, 0.2, 2.0), yaw_deg=45.0, texture="t")
    along, across = np.array([1.0, 1.0, 0.0]), np.array([-1.0, 1.0, 0.0])
    points = np.array([1.0, 1.0, 1.0]) + np.array([along, across, 1.5 * along, [0, 0, 1.1]])
    np.testing.assert_array_equal(box.contains(points), [True, False, False, False])


def yard(*rectangles: Rectangle, boxes: tuple[Box, ...] = ()) -> World:
    """A world of one texture."""
    grey = Texture(dark_rgb=(0.2, 0.2, 0.2), light_rgb=(0.8, 0.8, 0.8))
    return World(name="yard", textures={"grey": grey}, rectangles=rectangles, boxes=boxes)


def test_a_world_ends_where_nothing_but_sky_is_below() -> None:
    """Over the ground, a second piece of it, or the top of a box a camera is in the world; beyond all, it is not."""
    here = Rectangle(name="here", center_m=(0, 0, 0), size_m=(10, 10), texture="grey")
    there = Rectangle(name="there", center_m=(20, 0, 3), size_m=(10, 10), texture="grey")
    tower = Box(name="tower", center_m=(0, 9, 2), size_m=(8, 8, 4), texture="grey", yaw_deg=45.0)
    world = yard(here, there, boxes=(tower,))
    inside = np.array([[0, 0, 1], [4.9, -4.9, 30], [20, 4, 4], [0, 14, 5], [0, 0, 999]], dtype=float)
    assert world.collision(inside) is None
    for outside in ([10, 0, 1], [0, -5.1, 1], [3.9, 12.9, 5], [np.nan, 0, 1]):
        assert world.collision(np.array([[0, 0, 1], outside])) == (1, "beyond the rim of the ground")
    assert world.collision(np.array([[0.0, 0.0, 1001.0]])) == (0, "more than 1000 m above the ground")
    assert world.collision(np.array([[20.0, 0.0, 1.0]])) == (0, "below 'there'")


def test_a_world_without_ground_has_no_rim() -> None:
    """A wall, or a box that hangs in the sky, may be looked at from anywhere."""
    wall = Rectangle(name="wall", center_m=(5, 0, 0), size_m=(2, 2), texture="grey", u_axis=(0, 1, 0), v_axis=(0, 0, 1))
    far = np.array([[-5000.0, 0.0, 1e6]])
    assert yard(wall).collision(far) is None
    assert yard(boxes=(Box(name="box", center_m=(0, 0, 0), size_m=(1, 1, 1), texture="grey"),)).collision(far) is None
