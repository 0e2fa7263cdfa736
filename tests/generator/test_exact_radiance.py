"""Luma and log luma of a pixel against 50 digits: Cramer's rule, clipped polygons, quadrature.

What the closed form takes as affine is taken so here too; how far that is from the truth is measured in
``test_exact_footprint.py``.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.camera import CameraOptions, colour_camera
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import WHITE_DN, Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Rectangle, World
from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from tests.generator.mpmath_world import (
    EPS,
    MP,
    UNIT_SQUARE,
    Hit,
    Plane,
    area,
    clipped,
    footprint,
    meet,
    pattern_average,
    phases,
    planes_of,
    project,
    vector,
    waves_average,
)

CAMERA = colour_camera(CameraOptions(width=360, height=270))
COLUMN, ROW = 211, 97
LIGHT = Light(name="day", ambient=0.8, sky_horizon_rgb=(0.5,) * 3, sky_zenith_rgb=(0.5,) * 3)
DARK, BRIGHT = (0.1, 0.15, 0.05), (0.7, 0.6, 0.5)
PATTERNS = {
    "stripes": StepPattern(kind="stripes", period_m=(1.1, 1.0), angle_deg=33.0, contrast=0.5),
    "checker": StepPattern(kind="checker", period_m=(0.8, 1.1), angle_deg=25.0, contrast=0.5),
    "dashes": StepPattern(kind="dashes", period_m=(1.5, 0.7), duty=(0.4, 0.2), angle_deg=70.0, contrast=0.5),
}
WAVES = WaveBand(longest_m=4.0, shortest_m=0.05, count=6, contrast=0.5, seed=3)
TEXTURES = {"smooth": Texture(dark_rgb=DARK, light_rgb=BRIGHT, waves=(WAVES,))} | {
    kind: Texture(dark_rgb=DARK, light_rgb=BRIGHT, waves=(WAVES,), steps=(pattern,))
    for kind, pattern in PATTERNS.items()
}

angle = st.floats(-180, 180)


def ground(texture: str) -> World:
    return World(
        name="w",
        textures=TEXTURES,
        rectangles=(Rectangle(name="ground", center_m=(0, 0, 0), size_m=(1e5, 1e5), texture=texture),),
    )


def pose_over_ground(yaw_deg: float, grazing_deg: float, roll_deg: float, away_m: float, z_m: float) -> np.ndarray:
    """A camera whose axis meets the ground at a z-depth, so many degrees from being in its plane."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", [yaw_deg, grazing_deg, roll_deg], degrees=True).as_matrix()
    T = T @ CAMERA.T_body_camera
    T[:3, 3] = [away_m, -0.6 * away_m, 0.0] - z_m * T[:3, 2]
    return T


def exact_share(plane: Plane, hit: Hit, a: list, b: list) -> tuple[object, float]:
    """Scalar of the texture, 0 to 1, averaged over the footprint of sides a and b, and a bound on its rounding."""
    texture = plane.texture
    share = MP.mpf(0.5) + waves_average(texture, plane.number, hit.u, hit.v, a, b)
    # A wave errs by its slope times the place, whose own digits and shift from face to face count too.
    place_m = hit.surface_error_m + 4 * EPS * (abs(float(hit.u)) + abs(float(hit.v)))
    slopes = [row[0] * 2 * math.pi * math.hypot(row[1], row[2]) for band in texture.waves for row in band.rows()]
    error = 2 * sum(slopes) * place_m + 16 * EPS
    for pattern in texture.steps:
        half_contrast = MP.mpf(pattern.contrast) / 2
        share += half_contrast * pattern_average(pattern, hit.u, hit.v, a, b)
        error += float(half_contrast) * _edges_error(pattern, hit, a, b, place_m)
    return share, error


def _edges_error(pattern: StepPattern, hit: Hit, a: list, b: list, place_m: float) -> float:
    """An edge that moves by d changes the average, from -1 to 1, by 2 d times its length over the footprint's area."""
    corners = [phases(pattern, hit.u + p * a[0] + q * b[0], hit.v + p * a[1] + q * b[1]) for p, q in UNIT_SQUARE]
    error = 0.0
    for axis, period_m in enumerate(pattern.period_m):
        extent, along = (float(max(c[k] for c in corners) - min(c[k] for c in corners)) for k in (axis, 1 - axis))
        turns = max(float(abs(corner[axis])) for corner in corners)
        moved = place_m / period_m + 8 * EPS * (1 + turns) + hit.depth_error * extent
        error += (2 * math.ceil(extent) + 2) * moved * along / float(area(corners))
    return 4 * error


def require_exact_luma(texture: str, T_world_camera: np.ndarray) -> float:
    """Hold luma and log luma of a pixel to their rounding; return its bound, relative to white."""
    world = ground(texture)
    found_dn = ExactWorld.of(world, LIGHT).luma_dn(CAMERA, T_world_camera)[ROW, COLUMN]
    plane = planes_of(world)[0]
    hit = meet(plane, CAMERA, T_world_camera, COLUMN, ROW)
    share, error = exact_share(plane, hit, *footprint(plane, CAMERA, T_world_camera, COLUMN, ROW))
    dark, bright = (MP.fdot(zip(vector(LUMA_WEIGHTS_RGB), vector(rgb), strict=True)) for rgb in (DARK, BRIGHT))
    expected_dn = WHITE_DN * MP.mpf(LIGHT.ambient) * (dark + share * (bright - dark))
    bound_dn = WHITE_DN * error
    assert abs(found_dn - expected_dn) <= bound_dn
    assert abs(np.log(found_dn) - MP.log(expected_dn)) <= bound_dn / float(expected_dn) + 2 * EPS * 5.6  # ln 255
    return error


@pytest.mark.parametrize("texture", TEXTURES)
@pytest.mark.parametrize(("away_m", "z_m"), [(0.0, 0.1), (0.0, 30.0), (1e3, 2.0)])
@settings(deadline=None, max_examples=5)
@given(yaw=angle, grazing=st.floats(25, 90), roll=angle)
def test_the_luma_of_a_pixel_is_exact(
    texture: str, away_m: float, z_m: float, yaw: float, grazing: float, roll: float
) -> None:
    """Smooth and step-edge textures from 0.1 and 30 m, at the origin and 1 km away: to the rounding of float64."""
    require_exact_luma(texture, pose_over_ground(yaw, grazing, roll, away_m, z_m))


@pytest.mark.parametrize("texture", TEXTURES)
@settings(deadline=None, max_examples=3)
@given(yaw=angle)
def test_the_luma_of_a_pixel_is_exact_at_a_grazing_angle(texture: str, yaw: float) -> None:
    """The pixel's ray lies 2 degrees from the ground, and its footprint is some thirty times as long as wide."""
    row_deg = math.degrees(math.atan((ROW - CAMERA.K[1, 2]) / CAMERA.K[1, 1]))
    require_exact_luma(texture, pose_over_ground(yaw, 2.0 - row_deg, 0.0, 0.0, 3.0 * 11))


@pytest.mark.parametrize(
    ("away_m", "z_m", "most_smooth", "most_sharp"),
    [(0.0, 0.1, 1e-13, 2e-10), (0.0, 30.0, 1e-11, 1e-10), (1e3, 2.0, 1e-10, 2e-8)],
)
def test_the_bound_of_rounding_is_small(away_m: float, z_m: float, most_smooth: float, most_sharp: float) -> None:
    """The bound of the tests above, of full scale. An edge moves with the rounding of the place, which counts most in a
    small pixel and far from the origin: there a place has 13 digits, and a pixel is a few thousandths of it.
    """
    T_world_camera = pose_over_ground(20.0, 50.0, 5.0, away_m, z_m)
    assert 0 < require_exact_luma("smooth", T_world_camera) < most_smooth
    assert 0 < require_exact_luma("checker", T_world_camera) < most_sharp


@settings(deadline=None, max_examples=25)
@given(yaw=st.floats(0, 90), turned=st.floats(-20, 20), at=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)))
def test_a_pixel_on_the_border_of_faces_is_the_sum_of_their_areas(
    yaw: float, turned: float, at: tuple[float, float]
) -> None:
    """A pixel on a corner of a box, where its even faces meet each other and the sky: areas to 1e-8 of a pixel."""
    grey = Texture(dark_rgb=(0.8,) * 3, light_rgb=(0.8,) * 3)
    box = Box(name="box", center_m=(6.0, 0.3, -0.4), size_m=(1.0, 1.5, 1.2), yaw_deg=yaw, texture="grey")
    world = World(name="w", textures={"grey": grey}, boxes=(box,))
    light = replace(LIGHT, ambient=0.4, sun_strength=0.5, sun_azimuth_deg=190.0, sun_elevation_deg=40.0)
    planes = planes_of(world)
    # The box's uppermost corner towards the camera appears within the pixel, ``at`` from its centre.
    upper = planes[4]
    corner_m = min(
        (
            [c + p * 2 * s * u + q * 2 * t * v for c, u, v in zip(upper.center, upper.u, upper.v, strict=True)]
            for p, q in UNIT_SQUARE
            for s, t in [upper.half]
        ),
        key=lambda point: sum(x * x for x in point),
    )
    T_world_camera = aimed(corner_m, COLUMN + at[0], ROW + at[1], turned)
    found_dn = ExactWorld.of(world, light).rgb_dn(CAMERA, T_world_camera)[ROW, COLUMN, 0]
    expected_dn, uncovered = MP.mpf(0), MP.mpf(1)
    for plane in planes:
        if sum(n * c for n, c in zip(plane.normal, plane.center, strict=True)) < 0:  # turned to the camera at 0
            seen = area(seen_in_pixel(plane, T_world_camera))
            toward_sun = max(float(np.array(plane.normal, float) @ light.to_sun), 0.0)
            expected_dn += seen * WHITE_DN * 0.8 * (light.ambient + light.sun_strength * toward_sun)
            uncovered -= seen
    assert uncovered > -1e-12  # the faces of a convex body do not overlap in the image
    expected_dn += uncovered * WHITE_DN * 0.5
    assert abs(found_dn - expected_dn) < 1e-8 * WHITE_DN


def aimed(point_m: list, column: float, row: float, roll_deg: float) -> np.ndarray:
    """A pose at the origin that sees a point at a place of the image."""
    T = np.eye(4)
    T[:3, :3] = CAMERA.T_body_camera[:3, :3]
    target = np.array([float(x) for x in point_m])
    pixel_ray = np.linalg.inv(CAMERA.K) @ [column, row, 1.0]
    rolled = Rotation.from_euler("z", roll_deg, degrees=True).apply(pixel_ray)
    turn = Rotation.align_vectors([target], [T[:3, :3] @ rolled])[0]
    T[:3, :3] = turn.as_matrix() @ T[:3, :3] @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    return T


def seen_in_pixel(plane: Plane, T_world_camera: np.ndarray) -> list:
    """Outline of a face, projected corner by corner, clipped to the pixel."""
    corners = [
        project(
            CAMERA,
            T_world_camera,
            [c + 2 * p * plane.half[0] * u + 2 * q * plane.half[1] * v
             for c, u, v in zip(plane.center, plane.u, plane.v, strict=True)],
        )[:2]
        for p, q in UNIT_SQUARE
    ]  # fmt: skip
    for axis, middle in ((0, COLUMN), (1, ROW)):
        for sign in (1, -1):
            corners = clipped(
                corners, lambda p, axis=axis, middle=middle, sign=sign: MP.mpf(0.5) + sign * (p[axis] - middle)
            )
    return corners
