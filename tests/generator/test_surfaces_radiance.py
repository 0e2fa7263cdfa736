"""Pixels of the exact world against a second computation with many rays a pixel."""

from dataclasses import replace

import cv2
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.camera import Camera, CameraOptions, colour_camera, event_camera
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import WHITE_DN, Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Lamp, Rectangle, World
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


def pose(camera: Camera, z_m: float = 1.5, pitch_deg: float = 10.0, yaw_deg: float = 0.0, roll_deg: float = 0.0) -> Floats:
    from scipy.spatial.transform import Rotation

    T_world_body = np.eye(4)
    T_world_body[:3, :3] = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_matrix()
    T_world_body[2, 3] = z_m
    return T_world_body @ camera.T_body_camera


@pytest.mark.parametrize("name", WORLDS)
def test_a_pixel_is_the_average_over_its_footprint(name: str) -> None:
    """Radiance agrees with 48 x 48 rays a pixel, also where faces meet, pierce each other and hide each other."""
    world, light = WORLDS[name]
    camera = colour_camera(CameraOptions(width=48, height=36))
    T_world_camera = pose(camera, roll_deg=7.0)
    exact = ExactWorld.of(world, light).rgb_dn(camera, T_world_camera)
    sampled = radiance_rgb_dn(world, light, camera, T_world_camera, samples=48)
    error = np.abs(exact - sampled)
    assert error.max() < 0.03 * sampled.max()
    assert np.sqrt((error**2).mean()) < 0.003 * sampled.max()
