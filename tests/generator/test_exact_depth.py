"""Depth against ray and plane by Cramer's rule at 50 digits: to rounding, and as it is stored."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.camera import CameraOptions, colour_camera
from fedora_generator.render import ExactWorld
from fedora_generator.streams import depth_mm, in_range
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Box, Rectangle, World
from tests.generator.mpmath_world import first_hit, meet, planes_of

LIGHT = Light(name="day", ambient=1.0, sky_horizon_rgb=(0.5,) * 3, sky_zenith_rgb=(0.5,) * 3)
TEXTURES = {"grey": Texture(dark_rgb=(0.5,) * 3, light_rgb=(0.5,) * 3)}
CAMERA = colour_camera(CameraOptions(width=36, height=27))
PIXELS = [(0, 0), (35, 0), (17, 13), (5, 22), (35, 26)]  # column, row

angle = st.floats(-180, 180)
place = st.tuples(*[st.floats(-1, 1)] * 3)


def transform(rotation: Rotation, position_m: tuple[float, ...]) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), position_m
    return T


def plane_ahead(T_world_camera: np.ndarray, turned: Rotation, z_m: float) -> Rectangle:
    """A plane through the optical axis at a z-depth, its normal towards the camera and then turned."""
    axes = T_world_camera[:3, :3] @ turned.as_matrix() @ np.diag([1.0, -1.0, -1.0])
    center_m = T_world_camera[:3, 3] + z_m * T_world_camera[:3, 2]
    return Rectangle(
        name="plane",
        center_m=tuple(center_m.tolist()),
        size_m=(1e6, 1e6),
        texture="grey",
        u_axis=tuple(axes[:, 0].tolist()),
        v_axis=tuple(axes[:, 1].tolist()),
    )


def require_exact_depth(world: World, T_world_camera: np.ndarray) -> None:
    """Hold 1 / z to its rounding, and what is stored of it to half a unit in the last place of float32."""
    found = ExactWorld.of(world, LIGHT).inverse_depth_per_m(CAMERA, T_world_camera)
    stored = depth_mm(found)
    planes = planes_of(world)
    for column, row in PIXELS:
        seen = first_hit(planes, CAMERA, T_world_camera, column, row)
        if seen is None:
            assert found[row, column] == 0
            continue
        z_m, error = seen[1].z, seen[1].depth_error
        assert abs(found[row, column] * z_m - 1) <= error
        z_mm = float(1000 * z_m)
        assert abs(float(stored[row, column]) - z_mm) <= 0.5 * np.spacing(np.float32(z_mm)) + error * z_mm


@pytest.mark.parametrize("away_m", [0.0, 1e3])
@pytest.mark.parametrize("z_m", [0.1, 1.7, 30.0])
@settings(deadline=None, max_examples=12)
@given(angle, angle, angle, st.tuples(st.floats(-55, 55), st.floats(-55, 55)), place)
def test_the_depth_of_any_plane_is_exact(
    away_m: float, z_m: float, yaw: float, pitch: float, roll: float, turned: tuple[float, float], at: tuple[float, ...]
) -> None:
    """A plane in any direction from a camera in any pose, from 0.1 to 30 m ahead, at the origin and 1 km from it."""
    position_m = (at[0] + away_m, at[1] - 0.6 * away_m, at[2])
    T_world_camera = transform(Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True), position_m)
    plane = plane_ahead(T_world_camera, Rotation.from_euler("XY", turned, degrees=True), z_m)
    require_exact_depth(World(name="w", textures=TEXTURES, rectangles=(plane,)), T_world_camera)


@pytest.mark.parametrize("grazing_deg", [1.0, 0.01, 1e-4])
@settings(deadline=None, max_examples=12)
@given(angle, angle, angle)
def test_the_depth_of_a_plane_in_the_line_of_sight_is_exact(
    grazing_deg: float, yaw: float, pitch: float, roll: float
) -> None:
    """Seen along its surface, 1 / z is a difference that loses digits; no more than the numbers of the plane do."""
    T_world_camera = transform(Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True), (3.0, -2.0, 1.0))
    plane = plane_ahead(T_world_camera, Rotation.from_euler("X", 90 - grazing_deg, degrees=True), 2.0)
    require_exact_depth(World(name="w", textures=TEXTURES, rectangles=(plane,)), T_world_camera)


def test_the_bound_of_rounding_is_a_few_units_in_the_last_place() -> None:
    """The bound of the tests above is small where nothing cancels: 2e-15 face on, 4e-12 at a kilometre."""
    errors = []
    for away_m in (0.0, 1e3):
        T_world_camera = transform(Rotation.from_euler("ZYX", [30.0, 20.0, 10.0], degrees=True), (away_m, 0.0, 0.0))
        world = World(name="w", textures=TEXTURES, rectangles=(plane_ahead(T_world_camera, Rotation.identity(), 2.0),))
        errors.append(meet(planes_of(world)[0], CAMERA, T_world_camera, 17, 13).depth_error)
    assert errors[0] < 1e-14
    assert errors[1] < 4e-12


@settings(deadline=None, max_examples=40)
@given(st.floats(-60, 60), st.integers(2, 33), st.floats(-40, 40), st.floats(0.2, 25))
def test_no_ray_slips_between_two_faces_that_meet(yaw_deg: float, column: int, turned_deg: float, z_m: float) -> None:
    """The upright edge of a box passes through the centres of a column: all of them see the edge's depth.

    Rounding may choose either of the faces, but never what is behind them.
    """
    T_world_camera = transform(Rotation.from_euler("ZYX", [yaw_deg, 0, 0], degrees=True), (1.0, 2.0, 0.3))
    T_world_camera = T_world_camera @ CAMERA.T_body_camera
    ray = T_world_camera[:3, :3] @ [(column - CAMERA.K[0, 2]) / CAMERA.K[0, 0], 0.0, 1.0]
    edge_m = T_world_camera[:3, 3] + z_m * ray
    towards_deg = float(np.degrees(np.arctan2(ray[1], ray[0]))) + turned_deg
    center_m = edge_m + Rotation.from_euler("Z", towards_deg, degrees=True).apply([np.sqrt(0.5), 0.0, 0.0])
    box = Box(
        name="box", center_m=tuple(center_m.tolist()), size_m=(1, 1, 500), yaw_deg=towards_deg + 45, texture="grey"
    )
    found = ExactWorld.of(World(name="w", textures=TEXTURES, boxes=(box,)), LIGHT)
    inverse_depth = found.inverse_depth_per_m(CAMERA, T_world_camera)[:, column]
    np.testing.assert_allclose(inverse_depth, 1 / z_m, rtol=1e-12)


@pytest.mark.parametrize("z_m", [0.1, 30.0])
@settings(deadline=None, max_examples=25)
@given(angle, angle, angle, place)
def test_both_ends_of_the_range_are_valid_whatever_the_rounding(
    z_m: float, yaw: float, pitch: float, roll: float, at: tuple[float, ...]
) -> None:
    """A wall at exactly the nearest or the farthest depth has no holes: both ends belong to the range."""
    T_world_camera = transform(Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True), at)
    wall = plane_ahead(T_world_camera, Rotation.identity(), z_m)
    world = World(name="w", textures=TEXTURES, rectangles=(wall,))
    found = ExactWorld.of(world, LIGHT).inverse_depth_per_m(CAMERA, T_world_camera)
    stored = depth_mm(in_range(found, (0.1, 30.0)))
    np.testing.assert_array_equal(stored, np.float32(1000 * z_m))
