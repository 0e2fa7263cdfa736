"""Flow against points taken from pose to pose at 50 digits, in flights as fast as the fastest of the paper."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.camera import Camera, CameraOptions, colour_camera
from fedora_generator.flight import AXES, Flight, FlightOptions, HarmonicTerm
from fedora_generator.flow import flow_px
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Box, Rectangle, World
from tests.generator.mpmath_world import EPS, MP, Vector, first_hit, planes_of, project, ray_of, vector

LIGHT = Light(name="day", ambient=1.0, sky_horizon_rgb=(0.5,) * 3, sky_zenith_rgb=(0.5,) * 3)
WORLD = World(
    name="w",
    textures={"grey": Texture(dark_rgb=(0.5,) * 3, light_rgb=(0.5,) * 3)},
    rectangles=(Rectangle(name="floor", center_m=(0, 0, 0), size_m=(4e3, 4e3), texture="grey"),),
    boxes=(
        Box(name="near", center_m=(1.0, 0.4, 1.4), size_m=(0.5, 0.7, 0.9), yaw_deg=20.0, texture="grey"),
        Box(name="far", center_m=(28.0, 0.0, 5.0), size_m=(2.0, 60.0, 10.0), yaw_deg=-7.0, texture="grey"),
    ),
)
CAMERA = colour_camera(CameraOptions(width=144, height=108, position_body_m=(0.1, 0.0, -0.03), pitch_deg=4.0))
PIXELS = [(0, 0), (143, 107), (60, 70), (100, 30), (71, 53), (10, 100), (128, 64)]  # column, row

FASTEST_RAD_S = 10.7
"""Largest angular speed of the paper's flights."""


def burst(frequency_hz: float, axis: str, away_m: float) -> FlightOptions:
    """Swings about one axis that reach the largest angular speed, while flying; ``away_m`` from the origin."""
    amplitude_deg = float(np.degrees(FASTEST_RAD_S / (2 * np.pi * frequency_hz)))
    return FlightOptions(
        position_m=(away_m, -0.3, 1.5),
        velocity_m_s=(1.5, 0.7, -0.3),
        attitude_deg=(3.0, 5.0, -2.0),
        terms=(
            HarmonicTerm(axis=axis, amplitude=amplitude_deg, frequency_hz=frequency_hz, phase_deg=15.0),
            HarmonicTerm(axis="y", amplitude=0.2, frequency_hz=1.3),
        ),
    )


def exact_pose(options: FlightOptions, camera: Camera, time_us: int) -> np.ndarray:
    """T_world_camera (4, 4) of numbers of MP, from the sums of sines themselves and elementary rotations."""
    t = MP.mpf(time_us) / 10**6
    axes = dict(zip(AXES, vector([*options.position_m, *options.attitude_deg]), strict=True))
    for axis, rate in zip(AXES, options.velocity_m_s, strict=False):
        axes[axis] += MP.mpf(rate) * t
    for term in options.terms:
        turns = MP.mpf(term.frequency_hz) * t + MP.mpf(term.phase_deg) / 360
        axes[term.axis] += MP.mpf(term.amplitude) * MP.sin(2 * MP.pi * turns)
    R = _turn(2, axes["yaw"]) * _turn(1, axes["pitch"]) * _turn(0, axes["roll"])
    mounted = R * MP.matrix(camera.T_body_camera[:3].tolist())
    T = np.array([[mounted[i, j] for j in range(4)] for i in range(3)] + [[MP.mpf(k) for k in (0, 0, 0, 1)]])
    T[:3, 3] += [axes[axis] for axis in "xyz"]
    return T


def _turn(axis: int, angle_deg: object) -> object:
    """Rotation about x, y or z."""
    R, angle = MP.eye(3), angle_deg * MP.pi / 180
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R[j, j], R[j, k], R[k, j], R[k, k] = MP.cos(angle), -MP.sin(angle), MP.sin(angle), MP.cos(angle)
    return R


def exact_flow(T_start: np.ndarray, T_end: np.ndarray, column: int, row: int) -> tuple[Vector, float] | None:
    """Displacement (2,) of what a pixel shows, and a bound on its rounding in float64, px; None where it is invalid."""
    seen = first_hit(planes_of(WORLD), CAMERA, T_start, column, row)
    ray, start_m = ray_of(CAMERA, T_start, column, row), vector(T_start[:3, 3])
    if seen is None:
        return None
    hit = seen[1]
    x, y, ahead = project(CAMERA, T_end, [c + hit.z * r for c, r in zip(start_m, ray, strict=True)])
    if ahead <= 0:
        return None
    # A point that errs by some roundings of the lengths at play, seen in the image at its new depth.
    places_m = sum(float(abs(c)) for T in (T_start, T_end) for c in T[:3, 3])
    parallax_m = float(sum(abs(b - a) for a, b in zip(T_start[:3, 3], T_end[:3, 3], strict=True)))
    error_m = 8 * EPS * (places_m + float(hit.z)) + hit.depth_error * parallax_m
    off_axis = float(abs(x - MP.mpf(CAMERA.K[0, 2])) + abs(y - MP.mpf(CAMERA.K[1, 2])))
    return [x - column, y - row], error_m * (CAMERA.K[0, 0] + off_axis) / float(ahead)


@pytest.mark.parametrize("away_m", [0.0, 900.0])
@pytest.mark.parametrize("axis", ["yaw", "pitch", "roll"])
@settings(deadline=None, max_examples=5)
@given(
    start_us=st.integers(0, 500_000), interval_us=st.sampled_from([20_000, 40_000, 100_000]), hertz=st.floats(1.5, 4)
)
def test_flow_is_exact_from_the_flight_to_the_file(
    axis: str, away_m: float, start_us: int, interval_us: int, hertz: float
) -> None:
    """From sums of sines to float32 pixels, at 10.7 rad/s: half a unit in the last place, and 1e-8 px besides.

    Points that pass behind the camera are invalid, as they are in 50 digits.
    """
    options = burst(hertz, axis, away_m)
    T_start, T_end = CAMERA.poses_at(Flight(options), np.array([start_us, start_us + interval_us]))
    inverse_depth = ExactWorld.of(WORLD, LIGHT).inverse_depth_per_m(CAMERA, T_start)
    inverse_depth[inverse_depth == 0] = np.nan
    stored = flow_px(inverse_depth, CAMERA.K, T_start, T_end)
    poses = [exact_pose(options, CAMERA, time_us) for time_us in (start_us, start_us + interval_us)]
    for column, row in PIXELS:
        expected = exact_flow(*poses, column, row)
        if expected is None:
            assert np.isnan(stored[row, column]).all()
            continue
        for found, exact in zip(stored[row, column].tolist(), expected[0], strict=True):
            assert abs(found - exact) <= 0.5 * np.spacing(np.float32(abs(exact))) + expected[1]


def test_the_bound_of_rounding_is_far_below_what_is_stored() -> None:
    """The bound of the test above: below 1e-9 px at the origin, and 1e-8 px at 900 m."""
    for away_m, most_px in ((0.0, 1e-9), (900.0, 1e-8)):
        poses = [exact_pose(burst(2.0, "yaw", away_m), CAMERA, time_us) for time_us in (300_000, 320_000)]
        bounds_px = [flow[1] for column, row in PIXELS if (flow := exact_flow(*poses, column, row))]
        assert 0 < max(bounds_px) < most_px
