"""Exact depth against a second ray caster, closed forms, and the rule of the depth camera's range."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.camera import Camera, CameraOptions, colour_camera
from fedora_generator.render import ExactWorld
from fedora_generator.streams import depth_mm, in_range
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Box, Rectangle, World
from tests.generator.reference_world import z_depth_m

LIGHT = Light(name="day", ambient=1.0, sky_horizon_rgb=(0.5,) * 3, sky_zenith_rgb=(0.5,) * 3)
TEXTURES = {"grey": Texture(dark_rgb=(0.5,) * 3, light_rgb=(0.5,) * 3)}
FLOOR = Rectangle(name="floor", center_m=(0, 0, 0), size_m=(200, 200), texture="grey")
LOOKING_EAST = colour_camera(CameraOptions()).T_body_camera
CAMERA = colour_camera(CameraOptions(width=40, height=30))


def wall(x_m: float) -> Box:
    return Box(name="wall", center_m=(x_m + 0.5, 0, 0), size_m=(1, 2000, 2000), texture="grey")


def inverse_depth(world: World, T_world_camera: np.ndarray, camera: Camera = CAMERA) -> np.ndarray:
    return ExactWorld.of(world, LIGHT).inverse_depth_per_m(camera, T_world_camera)


boxes = st.lists(
    st.builds(
        lambda x, y, z, sx, sy, sz, yaw: Box(
            name="box", center_m=(x, y, z), size_m=(sx, sy, sz), yaw_deg=yaw, texture="grey"
        ),
        *(st.floats(2, 25), st.floats(-8, 8), st.floats(-1, 4)),
        *(st.floats(0.05, 4), st.floats(0.05, 4), st.floats(0.05, 4), st.floats(0, 360)),
    ),
    max_size=8,
)
angle = st.floats(-60, 60)


@settings(deadline=None, max_examples=60)
@given(boxes, angle, angle, angle, st.floats(0.2, 5))
def test_depth_agrees_with_a_second_ray_caster(
    solids: list[Box], yaw_deg: float, pitch_deg: float, roll_deg: float, height_m: float
) -> None:
    """Boxes that hide, touch and pierce each other, from any side: z-depth to 1e-9 of plain slab intersection."""
    world = World(name="w", textures=TEXTURES, rectangles=(FLOOR,), boxes=tuple(solids))
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_matrix()
    T_world_camera[2, 3] = height_m
    T_world_camera = T_world_camera @ LOOKING_EAST
    expected = 1 / z_depth_m(world, CAMERA, T_world_camera)
    agrees = np.isclose(inverse_depth(world, T_world_camera), expected, rtol=1e-9, atol=1e-12)
    # A ray that grazes a border hits or misses by rounding.
    assert (~agrees).sum() <= 1


@pytest.mark.parametrize("distance_m", [0.1, 0.5, 30.0, 500.0])
def test_a_wall_ahead_has_one_z_depth(distance_m: float) -> None:
    """Z-depth lies along the optical axis: all pixels of a wall at right angles have it, not the longer ray's."""
    found = inverse_depth(World(name="w", textures=TEXTURES, boxes=(wall(distance_m),)), LOOKING_EAST)
    np.testing.assert_allclose(1 / found, distance_m, rtol=1e-12)


def test_a_wall_seen_at_a_grazing_angle_is_still_exact() -> None:
    """At 89.9 degrees from its normal, 1 / z of a plane is linear in the pixel; the closed form holds to rounding."""
    slope = np.tan(np.radians(0.1))
    v_axis = (0.0, 0.0, 1.0)
    u_axis = (float(np.cos(np.radians(0.1))), float(np.sin(np.radians(0.1))), 0.0)
    # Front of the plane y = 1 + slope x towards -y.
    plane = Rectangle(name="plane", center_m=(0, 1, 0), size_m=(5e4, 5e4), u_axis=u_axis, v_axis=v_axis, texture="grey")
    found = inverse_depth(World(name="w", textures=TEXTURES, rectangles=(plane,)), LOOKING_EAST)
    left = -(np.arange(40) - CAMERA.K[0, 2]) / CAMERA.K[0, 0]  # y over x of the ray
    expected = np.maximum(left - slope, 0)
    np.testing.assert_allclose(found[10], expected, atol=1e-12)


def test_the_nearer_box_hides_the_farther() -> None:
    """A small box before a wall: its own depth inside its outline, the wall's around it."""
    near = Box(name="near", center_m=(3.5, 0, 0), size_m=(1, 1, 1), texture="grey")
    found = 1 / inverse_depth(World(name="w", textures=TEXTURES, boxes=(wall(8.0), near)), LOOKING_EAST)
    columns, rows = np.meshgrid(*((np.arange(n) - (n - 1) / 2) / CAMERA.K[0, 0] * 3.0 for n in (40, 30)))
    inside = (np.abs(columns) < 0.5) & (np.abs(rows) < 0.5)
    np.testing.assert_allclose(found[inside], 3.0)
    np.testing.assert_allclose(found[~inside], 8.0)


def test_what_is_behind_the_camera_is_not_seen() -> None:
    """A wall at x = -2 leaves the sky."""
    assert not inverse_depth(World(name="w", textures=TEXTURES, boxes=(wall(-3.0),)), LOOKING_EAST).any()


@pytest.mark.parametrize(
    ("z_m", "stored_mm"),
    [(0.0999, np.nan), (0.1, 100.0), (1.234567, 1234.567), (30.0, 30_000.0), (30.001, np.nan), (np.inf, np.nan)],
)
def test_depth_is_millimetres_within_the_range(z_m: float, stored_mm: float) -> None:
    """0.1 m and 30 m belong to the range; nearer, farther and the sky are NaN; float32."""
    stored = depth_mm(in_range(np.array([[1 / z_m]]), (0.1, 30.0)))
    assert stored.dtype == np.float32
    np.testing.assert_allclose(stored, [[stored_mm]], rtol=1e-7)
