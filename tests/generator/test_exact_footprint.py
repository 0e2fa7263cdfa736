"""What the closed form approximates, measured: the affine footprint, and the parallelogram in place of a piece.

The figures are those of ``surfaces/README.md``.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.camera import Camera, CameraOptions, colour_camera
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Rectangle, World
from tests.generator.reference_world import radiance_rgb_dn

Floats = NDArray[np.float64]

LIGHT = Light(name="day", ambient=1.0, sky_horizon_rgb=(0.5,) * 3, sky_zenith_rgb=(0.5,) * 3)
HEIGHT_M = 1.7
WAVES = (WaveBand(longest_m=9.0, shortest_m=0.03, count=11, slope=0.45, seed=1),)
CHECKER = StepPattern(kind="checker", period_m=(0.8, 1.1), angle_deg=25.0)
GROUND = Rectangle(name="ground", center_m=(0, 0, 0), size_m=(1e4, 1e4), texture="lawn")


def world_of(texture: Texture, boxes: tuple[Box, ...] = ()) -> World:
    return World(name="w", textures={"lawn": texture}, rectangles=(GROUND,), boxes=boxes)


def grey(**terms: object) -> Texture:
    return Texture(dark_rgb=(1e-9,) * 3, light_rgb=(1.0,) * 3, **terms)


def window(full_width: int, distance_m: float, width: int = 24, height: int = 4) -> tuple[Camera, Floats]:
    """A few pixels of a camera of some width, and its level pose: their middle sees the ground at a distance."""
    K = colour_camera(CameraOptions(width=full_width, height=full_width)).K.copy()
    K[:2, 2] = (width - 1) / 2, (height - 1) / 2 - K[1, 1] * HEIGHT_M / distance_m
    T_world_camera = colour_camera(CameraOptions()).T_body_camera.copy()
    T_world_camera[2, 3] = HEIGHT_M
    return Camera(width, height, K, T_world_camera), T_world_camera


def closed_form_and_rays(world: World, camera: Camera, T: Floats, samples: int) -> tuple[Floats, Floats]:
    closed = ExactWorld.of(world, LIGHT).rgb_dn(camera, T)[..., 0]
    return closed / 255, radiance_rgb_dn(world, LIGHT, camera, T, samples)[..., 0] / 255


@pytest.mark.parametrize("full_width", [270, 1440])
@pytest.mark.parametrize("distance_m", [3.0, 10.0, 30.0])
def test_an_affine_footprint_is_off_by_a_share_of_the_change_of_depth(full_width: int, distance_m: float) -> None:
    """The mean place of a pixel's true footprint lies w / 12 of its length from where the affine one puts it.

    w is the relative change of 1 / z over the pixel, d / (f h) on the ground: 1.4% at 30 m from 1.7 m in a full-size
    frame. With a smooth texture the error is that shift times its slope: RMS below w / 4 of what neighbouring pixels
    differ by (standard deviation), as measured from 3 to 30 m.
    """
    camera, T = window(full_width, distance_m)
    closed, rays = closed_form_and_rays(world_of(grey(waves=WAVES)), camera, T, samples=64)
    change = distance_m / (camera.K[0, 0] * HEIGHT_M)
    rms = float(np.sqrt(((closed - rays) ** 2).mean()))
    assert rms < change / 4 * float(rays.std())


def test_the_affine_footprint_of_edges_is_off_by_no_more() -> None:
    """A full-size frame, a checker of a metre at 30 m: 0.2% of full scale RMS."""
    camera, T = window(1440, 30.0)
    closed, rays = closed_form_and_rays(world_of(grey(steps=(CHECKER,))), camera, T, samples=160)
    assert np.sqrt(((closed - rays) ** 2).mean()) < 2.5e-3


@pytest.mark.parametrize(
    ("texture", "most_rms"), [(grey(waves=WAVES), 3e-3), (grey(steps=(CHECKER,)), 1.2e-2)], ids=["smooth", "checker"]
)
def test_a_piece_of_a_cut_pixel_is_off_by_its_shape(texture: Texture, most_rms: float) -> None:
    """Only where both a border and the texture's own detail lie in one pixel: RMS over such pixels of full scale.

    A box 6 m ahead in a frame of 270 pixels: a pixel is 2.6 cm wide. Even textures have no error at all, as areas are
    exact.
    """
    box = Box(name="box", center_m=(6.5, 0.0, 1.0), size_m=(1.0, 1.2, 2.0), yaw_deg=25.0, texture="lawn")
    camera, T = window(270, 5.6, width=60, height=40)
    T[2, 3] = HEIGHT_M
    world = world_of(texture, boxes=(box,))
    even = replace(world, textures={"lawn": grey()})
    cut = np.abs(np.diff(ExactWorld.of(even, replace(LIGHT, ambient=0.3, sun_strength=0.7)).luma_dn(camera, T), axis=1))
    border = np.zeros((40, 60), bool)
    border[:, 1:-1] = (cut[:, :-1] > 1e-6) & (cut[:, 1:] > 1e-6)
    closed, rays = closed_form_and_rays(world, camera, T, samples=20)
    error = (closed - rays)[border]
    assert border.sum() > 30
    assert np.sqrt((error**2).mean()) < most_rms
