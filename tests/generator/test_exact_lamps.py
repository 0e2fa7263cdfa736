"""Light of a lamp over a footprint: against spherical triangles at 50 digits, and a render against many rays."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fedora_generator.camera import CameraOptions, colour_camera
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.shading_kernels import lamp_average
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Lamp, Rectangle, World
from tests.generator.mpmath_world import MP, cross, dot
from tests.generator.reference_world import radiance_rgb_dn

place_m = st.floats(-50, 50)
side_m = st.tuples(st.floats(-180, 180), st.floats(-4, 2).map(lambda power: 10.0**power))


def girard(corners: list) -> object:
    """Solid angle of a spherical triangle: its angles, each between two of the planes through the apex, less pi."""
    angles = []
    for k in range(3):
        p, q, r = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
        one, other = cross(p, q), cross(p, r)
        angles.append(MP.acos(dot(one, other) / MP.sqrt(dot(one, one) * dot(other, other))))
    return MP.fsum(angles) - MP.pi


@settings(deadline=None, max_examples=300)
@given(place_m, place_m, st.floats(-2, 2).map(lambda power: 10.0**power), side_m, side_m)
@example(u=0.0, v=0.0, height_m=0.01, one=(0.0, 1.0), other=(1.0, 10.0))
@example(u=0.0, v=0.0, height_m=0.1, one=(0.0, 100.0), other=(1.0, 1.0))
def test_the_mean_is_a_solid_angle(
    u: float, v: float, height_m: float, one: tuple[float, float], other: tuple[float, float]
) -> None:
    """Over any footprint, from 0.1 mm to 100 m wide, from 1 cm to 100 m below the lamp: to 1e-11 of itself.

    Or, of those more than 200 times as long as they are far, to a rounding times the square of that: a tenth of it was
    the worst of 12,000, 1e-9 at 6000 times. The sides' own angle must be known to as many digits: the area of one that
    is nearly a thread is not.
    """
    (au, av), (bu, bv) = ((r * math.cos(math.radians(d)), r * math.sin(math.radians(d))) for d, r in (one, other))
    area = MP.mpf(au) * bv - MP.mpf(av) * bu
    if abs(area) < 1e-6 * one[1] * other[1]:
        return
    found = lamp_average(u, v, height_m**2, au, av, bu, bv)
    # What the kernel is given is the square, rounded.
    height = MP.sqrt(MP.mpf(height_m**2))
    sides = [MP.mpf(x) for x in (au, av, bu, bv)]

    def corner(a: int, b: int) -> list:
        half = MP.mpf("0.5")
        return [u + half * (a * sides[0] + b * sides[2]), v + half * (a * sides[1] + b * sides[3]), height]

    p, q, r, s = corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)
    exact = (girard([p, q, r]) + girard([p, r, s])) / (height * abs(area))
    rounding = float(np.finfo(float).eps) * (max(one[1], other[1]) / height_m) ** 2
    assert found == pytest.approx(float(exact), rel=max(1e-11, rounding))


@given(place_m, place_m, st.floats(-2, 2).map(lambda power: 10.0**power))
def test_of_a_point_it_is_the_inverse_square_law(u: float, v: float, height_m: float) -> None:
    """A footprint without an area, and one without a length, are the light at a point."""
    there = (u * u + v * v + height_m**2) ** -1.5
    thread = 1e-9 * height_m
    for sides in ((0.0, 0.0, 0.0, 0.0), (thread, 0.0, 0.0, 0.0), (thread, thread, -thread, -thread)):
        assert lamp_average(u, v, height_m**2, *sides) == pytest.approx(there, rel=1e-7)


@given(st.floats(0, 2), st.floats(1, 100))
def test_a_thread_through_the_foot_of_the_lamp_is_finite(height_power: float, length_m: float) -> None:
    """Up to 10 000 times its height: the mean over a line of length L at height H is 1 / (H^2 sqrt(H^2 + L^2 / 4))."""
    height_m = 10.0**-height_power
    expected = 1 / (height_m**2 * math.sqrt(height_m**2 + length_m**2 / 4))
    assert lamp_average(0.0, 0.0, height_m**2, length_m, 0.0, 0.0, 0.0) == pytest.approx(expected, rel=1e-6)


def test_a_pixel_far_down_the_street_has_the_light_of_its_whole_footprint() -> None:
    """Pixels of 5 m between two lamps: within 3% of 64 x 64 rays each; the light at their centres is 27% off."""
    white = Texture(dark_rgb=(1.0,) * 3, light_rgb=(1.0,) * 3)
    street = Rectangle(name="street", center_m=(0, 0, 0), size_m=(400, 400), texture="white")
    lamps = (Lamp(position_m=(30.0, 1.5, 4.0), strength=60.0), Lamp(position_m=(38.0, -1.5, 4.0), strength=60.0))
    world = World(name="w", textures={"white": white}, rectangles=(street,), lamps=lamps)
    light = Light(name="night", ambient=0.02, lamp_scale=1.0, sky_horizon_rgb=(0.02,) * 3, sky_zenith_rgb=(0.02,) * 3)
    camera = colour_camera(CameraOptions(width=120, height=90))
    row_of_34_m = round(camera.K[1, 2] + camera.K[1, 1] * 1.7 / 34.0)
    below = replace(camera, height=3, K=camera.K - [[0, 0, 0], [0, 0, row_of_34_m - 1], [0, 0, 0]])
    T_world_camera = camera.T_body_camera.copy()
    T_world_camera[2, 3] = 1.7
    closed = ExactWorld.of(world, light).rgb_dn(below, T_world_camera)[..., 0]
    rays = radiance_rgb_dn(world, light, below, T_world_camera, samples=64)[..., 0]
    centres = radiance_rgb_dn(world, light, below, T_world_camera, samples=1)[..., 0]
    assert np.abs(centres / rays - 1).max() > 0.25
    assert np.abs(closed / rays - 1).max() < 0.03
