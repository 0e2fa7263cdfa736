"""The event rate of a long flight from windows and strips: the parts are exact, the sampling is not biased."""

from dataclasses import replace
from pathlib import Path

import h5py
import hdf5plugin  # noqa: F401  registers the codec
import numpy as np
import pytest

from fedora_generator.camera import event_camera
from fedora_generator.flights.presets import PRESET_NAMES
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene
from tests.benchmarks.presets.event_rate import STRIP_PX, STRIPS, count_events, part_of, random_strips
from tests.benchmarks.presets.windows import image_motion_rad_s, spread_windows

WINDOW_S = 0.75

COARSE_STEP_US = 5000
"""Between images of small frames, where counts are compared that are made in the same steps."""


def world_of(scene: Scene) -> ExactWorld:
    assert scene.world is not None
    return ExactWorld.of(scene.world, scene.light)


def test_a_part_of_a_camera_sees_its_pixels() -> None:
    """The image of any part is that part of the image."""
    scene = load_scene("racetrack-day").with_size(144, 108)
    camera, world = event_camera(scene.camera), world_of(scene)
    T_world_camera = camera.pose_at(scene.fly(), 9_000_000)
    whole_dn = world.luma_dn(camera, T_world_camera)
    part_dn = world.luma_dn(part_of(camera, 21, 7, 19, 33), T_world_camera)
    np.testing.assert_allclose(part_dn, whole_dn[7:40, 21:40], rtol=1e-9)


def test_strips_are_spread_over_the_image() -> None:
    """One in each part, from top to bottom, within the image, at other columns the next time."""
    camera, rng = event_camera(load_scene("racetrack-day").camera), np.random.default_rng(1)
    columns = np.array([[camera.K[0, 2] - strip.K[0, 2] for strip in random_strips(camera, rng)] for _ in range(200)])
    parts = columns // (camera.width // STRIPS)
    np.testing.assert_array_equal(parts, np.tile(np.arange(STRIPS), (200, 1)))
    assert columns.min() >= 0
    assert columns.max() <= camera.width - STRIP_PX
    assert len(np.unique(columns[:, 0])) > 50


def test_a_window_counts_the_events_of_the_file(tmp_path: Path) -> None:
    """The whole sensor from the start of the sequence on: the same events, brighter and darker, as are written."""
    scene = replace(load_scene("racetrack-ngt").with_size(90, 68), event_step_us=COARSE_STEP_US).starting_at(20.0)
    generate_sequence(scene, tmp_path / "a.h5", Request(duration_s=0.2, streams=frozenset({"events"})))
    with h5py.File(tmp_path / "a.h5") as file:
        t_us, p = file["path/events/t"][:], file["path/events/p"][:]
    camera = event_camera(scene.camera)
    for start_us, counted_us in ((0, 200_000), (100_000, 50_000)):
        seen = p[(t_us > start_us) & (t_us <= start_us + counted_us)]
        expected = np.count_nonzero(seen == 1), np.count_nonzero(seen == 0)
        assert min(expected) > 20
        assert count_events(scene, world_of(scene), camera, start_us, counted_us) == expected


@pytest.mark.parametrize("name", PRESET_NAMES)
def test_windows_stand_for_the_whole_flight(name: str) -> None:
    """Their weighted mean of the speed is the flight's mean speed, and its standard error says how nearly.

    Of the 40 draws at most 4 lie beyond two standard errors, which honest ones would in 5% of all.
    """
    scene = load_scene(name)
    flight, length_s = scene.fly(), scene.remaining_s
    assert length_s is not None
    times_s = np.arange(0, length_s, 0.01)
    speeds_m_s = np.linalg.norm(flight.states_at(times_s).velocities_world_m_s, axis=1)
    truth = speeds_m_s[times_s <= length_s - WINDOW_S].mean()
    draws = []
    for seed in range(40):
        windows = spread_windows(flight, length_s, WINDOW_S, 50, np.random.default_rng(seed))
        mean, error = windows.mean(np.interp(windows.starts_s, times_s, speeds_m_s))
        draws.append((mean - truth) / error)
    assert np.count_nonzero(np.abs(draws) > 2) <= 4
    assert abs(np.mean(draws)) < 4 / np.sqrt(40)


def test_windows_are_where_the_image_moves() -> None:
    """Of a flight with fast turns more windows lie in the turns than their share of time, and they count less."""
    scene = load_scene("baylands-ngt1")
    windows = spread_windows(scene.fly(), 159.0, WINDOW_S, 200, np.random.default_rng(2))
    turning = image_motion_rad_s(scene.fly(), windows.starts_s + WINDOW_S / 2) > 2
    everywhere = image_motion_rad_s(scene.fly(), np.arange(0, 159.0, 0.01)) > 2
    assert turning.mean() > 3 * everywhere.mean()
    assert windows.weights[turning].max() < 1


def test_the_rate_follows_the_light() -> None:
    """Half the light, half the differences of grey: by day and by night far fewer events."""
    for name in ("baylands-day2", "racetrack-ngt"):
        scene = replace(load_scene(name).with_size(72, 54), event_step_us=COARSE_STEP_US)
        light = scene.light
        dimmed = replace(light, **{key: 0.5 * getattr(light, key) for key in ("ambient", "sun_strength", "lamp_scale")})
        bright, dark = (
            sum(count_events(each, world_of(each), event_camera(each.camera), 5_000_000, 100_000))
            for each in (scene, replace(scene, light=dimmed))
        )
        assert 0 < dark < 0.6 * bright
