"""Pixels of the exact world against a second computation with many rays a pixel."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_generator.camera import Camera, CameraOptions, colour_camera, event_camera
from fedora_generator.render import ExactWorld
from fedora_generator.scene import load_scene
from fedora_generator.surfaces.light import WHITE_DN, Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Lamp, Rectangle, World
from fedora_generator.threads import NUMBA_CONFIG
from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from tests.generator.reference_world import radiance_rgb_dn

Floats = NDArray[np.float64]

WAVES = (WaveBand(longest_m=4.0, shortest_m=0.1, count=7, contrast=0.6, seed=3),)
DARK, BRIGHT = (0.1, 0.15, 0.05), (0.7, 0.6, 0.5)
TEXTURES = {
    "smooth": Texture(dark_rgb=DARK, light_rgb=BRIGHT, waves=WAVES),
    "checker": Texture(
        dark_rgb=DARK,
        light_rgb=BRIGHT,
        waves=WAVES,
        steps=(StepPattern(kind="checker", period_m=(0.8, 1.1), angle_deg=25.0, contrast=0.4),),
    ),
    "dashes": Texture(
        dark_rgb=DARK, light_rgb=BRIGHT, steps=(StepPattern(kind="dashes", period_m=(1.5, 2.0), duty=(0.4, 0.2)),)
    ),
    "white": Texture(dark_rgb=(1.0, 1.0, 1.0), light_rgb=(1.0, 1.0, 1.0)),
}
DAY = Light(
    name="day",
    ambient=0.3,
    sun_strength=0.6,
    sun_azimuth_deg=200.0,
    sky_horizon_rgb=(0.7, 0.8, 0.9),
    sky_zenith_rgb=(0.3, 0.5, 0.9),
)
NIGHT = replace(DAY, name="night", ambient=0.02, sun_strength=0.0, lamp_scale=1.0)


def floor(texture: str) -> Rectangle:
    return Rectangle(name="floor", center_m=(0, 0, 0), size_m=(400, 400), texture=texture)


def box(x: float, y: float, yaw_deg: float, texture: str, size_m: tuple[float, float, float] = (1.0, 1.4, 2.0)) -> Box:
    return Box(name="box", center_m=(x, y, size_m[2] / 2), size_m=size_m, yaw_deg=yaw_deg, texture=texture)


BOXES = (
    box(4, 0.4, 20, "checker"),
    box(6, -1.0, 70, "smooth"),
    box(6.3, -0.6, 35, "white", (1.5, 1.0, 1.2)),  # pierces the one before
    box(9, 2.5, 10, "dashes", (0.3, 3.0, 3.5)),
)
LAMPS = (Lamp(position_m=(4.0, 1.5, 2.6), strength=3.0), Lamp(position_m=(8.0, -1.0, 3.0), strength=5.0))
WORLDS = {
    "smooth floor": (World(name="w", textures=TEXTURES, rectangles=(floor("smooth"),)), DAY),
    "checker floor": (World(name="w", textures=TEXTURES, rectangles=(floor("checker"),)), DAY),
    "boxes by day": (World(name="w", textures=TEXTURES, rectangles=(floor("smooth"),), boxes=BOXES), DAY),
    "boxes by night": (
        World(name="w", textures=TEXTURES, rectangles=(floor("dashes"),), boxes=BOXES, lamps=LAMPS),
        NIGHT,
    ),
}


def pose(camera: Camera, z_m: float = 1.5, pitch_deg: float = 10.0, roll_deg: float = 0.0) -> Floats:
    T_world_body = np.eye(4)
    T_world_body[:3, :3] = Rotation.from_euler("ZYX", [0.0, pitch_deg, roll_deg], degrees=True).as_matrix()
    T_world_body[2, 3] = z_m
    return T_world_body @ camera.T_body_camera


def block_means(image: Floats, side: int) -> Floats:
    """Means over square blocks of whole pixels."""
    height, width = (size // side for size in image.shape)
    return image.reshape(height, side, width, side).mean(axis=(1, 3))


@pytest.mark.parametrize("name", WORLDS)
def test_a_pixel_is_the_average_over_its_footprint(name: str) -> None:
    """Radiance agrees with 28 x 28 rays a pixel, also where faces meet, pierce each other and hide each other.

    The image is coarse (a pixel is up to metres wide on the floor), so that what is affine over a pixel only nearly
    is at its worst.
    """
    world, light = WORLDS[name]
    camera = colour_camera(CameraOptions(width=24, height=18))
    T_world_camera = pose(camera, roll_deg=7.0)
    exact = ExactWorld.of(world, light).rgb_dn(camera, T_world_camera)
    sampled = radiance_rgb_dn(world, light, camera, T_world_camera, samples=28)
    error = np.abs(exact - sampled)
    assert error.max() < 0.05 * sampled.max()
    assert np.sqrt((error**2).mean()) < 0.005 * sampled.max()


def test_an_edge_covers_its_exact_share_of_a_pixel() -> None:
    """A white box before a black floor and sky: coverage to 2e-3, as 128 x 128 rays a pixel count it."""
    textures = {"white": TEXTURES["white"], "black": Texture(dark_rgb=(1e-9,) * 3, light_rgb=(1e-9,) * 3)}
    world = World(name="w", textures=textures, rectangles=(floor("black"),), boxes=(box(4, 0.3, 33, "white"),))
    light = replace(DAY, ambient=1.0, sun_strength=0.0, sky_horizon_rgb=(1e-9,) * 3, sky_zenith_rgb=(1e-9,) * 3)
    camera = colour_camera(CameraOptions(width=8, height=6))
    T_world_camera = pose(camera, roll_deg=11.0)
    exact = ExactWorld.of(world, light).rgb_dn(camera, T_world_camera)
    sampled = radiance_rgb_dn(world, light, camera, T_world_camera, samples=128)
    assert ((exact > 1) & (exact < WHITE_DN - 1)).sum() > 20  # pixels that the border crosses, three channels
    np.testing.assert_allclose(exact / WHITE_DN, sampled / WHITE_DN, atol=2e-3)


def test_what_is_thinner_than_a_pixel_is_seen() -> None:
    """A post a fortieth of a pixel wide, between the pixel centres, brightens its column by its share."""
    textures = {"white": TEXTURES["white"], "black": Texture(dark_rgb=(1e-9,) * 3, light_rgb=(1e-9,) * 3)}
    camera = colour_camera(CameraOptions(width=40, height=30))
    width_m = 10.0 / camera.K[0, 0] / 40
    post = Box(name="post", center_m=(10.0 + width_m / 2, -0.085, 1.5), size_m=(width_m,) * 2 + (9.0,), texture="white")
    world = World(name="w", textures=textures, rectangles=(floor("black"),), boxes=(post,))
    light = replace(DAY, ambient=1.0, sun_strength=0.0, sky_horizon_rgb=(1e-9,) * 3, sky_zenith_rgb=(1e-9,) * 3)
    row = ExactWorld.of(world, light).rgb_dn(camera, pose(camera, pitch_deg=0.0))[15, :, 0]
    assert row.sum() == pytest.approx(WHITE_DN / 40, rel=0.01)  # a little of its side is seen too


def test_colour_and_event_camera_see_the_same_light() -> None:
    """9 x 9 pixels of the colour camera hold the light of the 4 x 4 of the event camera that look there (2.25 : 1).

    Pixel by pixel they cannot agree at an edge, as the border of an event pixel runs through colour pixels.
    """
    world, light = WORLDS["boxes by day"]
    options = CameraOptions(width=360, height=270)
    colour, events = colour_camera(options), event_camera(options)
    exact = ExactWorld.of(world, light)
    rgb = exact.rgb_dn(colour, pose(colour, roll_deg=7.0))
    luma = exact.luma_dn(events, pose(events, roll_deg=7.0))
    error = block_means(rgb @ np.array(LUMA_WEIGHTS_RGB), 9) - block_means(luma, 4)
    assert np.abs(error).max() < 0.3
    assert np.sqrt((error**2).mean()) < 0.02


def test_luma_is_the_weighted_sum_of_the_colours() -> None:
    """The event camera's luma is 0.299 R + 0.587 G + 0.114 B of the same pixel."""
    world, light = WORLDS["boxes by night"]
    camera = colour_camera(CameraOptions(width=64, height=48))
    exact = ExactWorld.of(world, light)
    luma = exact.rgb_dn(camera, pose(camera)) @ np.array([0.299, 0.587, 0.114])
    np.testing.assert_allclose(exact.luma_dn(camera, pose(camera)), luma, rtol=1e-12)


def test_the_number_of_threads_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """One thread and two give the same bits."""
    world, light = WORLDS["boxes by night"]
    camera = colour_camera(CameraOptions(width=90, height=70))
    exact, T_world_camera = ExactWorld.of(world, light), pose(camera)
    images = []
    for threads in (1, 2):
        monkeypatch.setattr(NUMBA_CONFIG, "NUMBA_NUM_THREADS", threads)
        images.append(exact.rgb_dn(camera, T_world_camera))
    np.testing.assert_array_equal(*images)


def test_a_lamp_falls_off_with_the_inverse_square() -> None:
    """Straight under a lamp of strength I at height h the floor has the irradiance I / h^2, softened by its radius."""
    height_m, strength = 2.0, 1.5
    world = World(
        name="w",
        textures=TEXTURES,
        rectangles=(floor("white"),),
        lamps=(Lamp(position_m=(0.0, 0.0, height_m), strength=strength),),
    )
    camera = Camera(1, 1, np.diag([1e5, 1e5, 1.0]), np.eye(4))  # a pixel of 10 um on the floor
    T_world_camera = np.diag([1.0, -1.0, -1.0, 1.0])  # optical Z straight down
    T_world_camera[2, 3] = 1.0
    night = replace(NIGHT, ambient=1e-9, lamp_radius_m=0.3)
    center_dn = ExactWorld.of(world, night).rgb_dn(camera, T_world_camera)[0, 0, 0]
    assert center_dn == pytest.approx(WHITE_DN * strength * height_m / (height_m**2 + 0.3**2) ** 1.5, rel=1e-6)


def test_a_face_shows_nothing_from_behind() -> None:
    """From under the floor there is only sky."""
    world, light = WORLDS["smooth floor"]
    camera = Camera(20, 16, colour_camera(CameraOptions(width=20, height=16)).K, np.eye(4))
    exact = ExactWorld.of(world, light)
    assert not exact.inverse_depth_per_m(camera, pose(colour_camera(CameraOptions()), z_m=-1.0)).any()


@pytest.mark.parametrize(("place", "time_us"), [((24, 9), 0), ((23, 10), 329_500), ((22, 11), 641_900)])
def test_a_pixel_of_many_faces_does_not_hang_on_rounding(place: tuple[int, int], time_us: int) -> None:
    """Far down the racetrack a pixel sees gates, kerbs, a tower, two walls of one height: in 30 us it hardly moves."""
    scene = load_scene("racetrack").with_size(90, 68)
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), scene.fly()
    images = [world.luma_dn(camera, camera.pose_at(flight, time_us + us)) for us in range(30)]
    luma_dn = np.array([image[place[::-1]] for image in images])
    assert np.abs(np.diff(np.log(luma_dn))).max() < 1e-4
