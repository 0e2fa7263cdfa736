"""Two walls before a camera that sways, one smooth and one with sharp edges, and their closed form at any instant."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera, CameraOptions, event_camera
from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Rectangle, World

Floats = NDArray[np.float64]

SIZE: Final = CameraOptions(width=90, height=68)
"""Of the colour camera: the event camera has 40x30 pixels."""

SWAY: Final = FlightOptions(
    position_m=(0.0, 0.0, 2.0),
    velocity_m_s=(0.0, 2.0, 0.0),
    terms=(
        HarmonicTerm(axis="z", amplitude=0.1, frequency_hz=1.5),
        HarmonicTerm(axis="roll", amplitude=6.0, frequency_hz=2.0, phase_deg=30.0),
        HarmonicTerm(axis="yaw", amplitude=1.0, frequency_hz=4.0),
    ),
)
DARK, LIGHT = (0.05, 0.05, 0.05), (0.95, 0.95, 0.95)
TEXTURES: Final = {
    "smooth": Texture(dark_rgb=DARK, light_rgb=LIGHT, waves=(WaveBand(longest_m=1.0, shortest_m=0.4, count=4),)),
    "sharp": Texture(
        dark_rgb=DARK, light_rgb=LIGHT, steps=(StepPattern(kind="checker", period_m=(0.7, 0.9), angle_deg=20.0),)
    ),
}
NOON: Final = Light(
    name="noon",
    ambient=0.5,
    sun_strength=0.5,
    sun_azimuth_deg=180.0,
    sun_elevation_deg=45.0,
    sky_horizon_rgb=(0.7, 0.8, 0.9),
    sky_zenith_rgb=(0.4, 0.6, 0.9),
)


def wall_of(texture: str) -> World:
    """Return the world that is a wall with one of TEXTURES, 3 m ahead."""
    wall = Rectangle(
        name="wall",
        center_m=(3.0, 0.0, 2.0),
        size_m=(40.0, 40.0),
        texture=texture,
        u_axis=(0.0, -1.0, 0.0),
        v_axis=(0.0, 0.0, 1.0),
    )
    return World(name=texture, textures={texture: TEXTURES[texture]}, rectangles=(wall,))


@dataclass(frozen=True, slots=True)
class TimingScene:
    """A world, its camera and flight; log luminance is a function of time alone for each pixel."""

    world: ExactWorld
    camera: Camera
    flight: Flight

    @classmethod
    def named(cls, texture: str) -> "TimingScene":
        """Return the wall with one of TEXTURES."""
        return cls(ExactWorld.of(wall_of(texture), NOON), event_camera(SIZE), Flight(SWAY))

    def luma_dn(self, time_s: float) -> Floats:
        """Luma (height, width) at any time, not only whole microseconds."""
        return self.world.luma_dn(self.camera, self._pose(time_s))

    def log_luma(self, column: int, row: int, time_s: float) -> float:
        """L of one pixel: the image of a camera that has no other."""
        K = self.camera.K.copy()
        K[:2, 2] -= column, row
        alone = replace(self.camera, width=1, height=1, K=K)
        return float(np.log(self.world.luma_dn(alone, self._pose(time_s))[0, 0]))

    def _pose(self, time_s: float) -> Floats:
        state = self.flight.states_at(np.array([time_s]))
        T_world_body = np.eye(4)
        T_world_body[:3, :3], T_world_body[:3, 3] = state.R_world_body[0], state.positions_world_m[0]
        return T_world_body @ self.camera.T_body_camera
