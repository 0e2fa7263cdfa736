"""A small world that both renderers draw, to compare their images: a floor and boxes."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Rectangle, World

_SMOOTH: Final = Texture(
    dark_rgb=(0.10, 0.12, 0.08),
    light_rgb=(0.70, 0.66, 0.50),
    waves=(WaveBand(longest_m=4.0, shortest_m=0.06, count=10, slope=0.45, seed=1),),
)
_STRIPED: Final = Texture(
    dark_rgb=(0.15, 0.12, 0.10),
    light_rgb=(0.80, 0.70, 0.60),
    waves=(WaveBand(longest_m=2.0, shortest_m=0.1, count=6, contrast=0.4, seed=2),),
    steps=(StepPattern(kind="checker", period_m=(0.6, 0.8), angle_deg=20.0, contrast=0.5),),
)


def _box(name: str, x_m: float, y_m: float, size_m: tuple[float, float, float], texture: str) -> Box:
    return Box(name=name, center_m=(x_m, y_m, size_m[2] / 2), size_m=size_m, yaw_deg=7 * x_m, texture=texture)


WORKBENCH: Final = World(
    name="workbench",
    textures={"smooth": _SMOOTH, "striped": _STRIPED},
    rectangles=(Rectangle(name="floor", center_m=(0.0, 0.0, 0.0), size_m=(60.0, 60.0), texture="smooth"),),
    boxes=(
        _box("near crate", 4.5, 0.9, (0.8, 0.8, 1.2), "striped"),
        _box("far crate", 7.5, -1.6, (1.4, 1.0, 2.2), "smooth"),
        _box("post", 6.0, -0.4, (0.12, 0.12, 3.0), "striped"),
        _box("house", 18.0, 3.5, (5.0, 7.0, 5.0), "striped"),
        _box("wall", 24.0, -6.0, (1.0, 12.0, 3.0), "smooth"),
    ),
)

DAY: Final = Light(
    name="day",
    ambient=0.4,
    sun_strength=0.6,
    sun_azimuth_deg=205.0,
    sun_elevation_deg=50.0,
    sky_horizon_rgb=(0.78, 0.84, 0.90),
    sky_zenith_rgb=(0.42, 0.60, 0.88),
)

FLIGHT: Final = FlightOptions(
    position_m=(0.0, 0.0, 1.7),
    velocity_m_s=(1.6, 0.2, 0.0),
    attitude_deg=(0.0, 6.0, 0.0),
    terms=(
        HarmonicTerm(axis="yaw", amplitude=5.0, frequency_hz=0.5),
        HarmonicTerm(axis="roll", amplitude=3.0, frequency_hz=0.4, phase_deg=60.0),
    ),
)


def path_world_m() -> NDArray[np.float64]:
    """Positions (n, 3) of the camera during the study."""
    return Flight(FLIGHT).states_at(np.arange(0.0, 0.5, 0.02)).positions_world_m
