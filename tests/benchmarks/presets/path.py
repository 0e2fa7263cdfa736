"""Length, distance and greatest speeds of a scene's whole flight."""

from typing import Final

import numpy as np

from fedora_generator.scene import Scene

_STEP_S: Final = 2e-3


def flown(scene: Scene) -> tuple[float, float, float, float]:
    """Length s, distance m, greatest speed m/s and angular speed rad/s, by the midpoint rule."""
    length_s = scene.remaining_s
    if length_s is None:
        raise ValueError(f"Expected a flight with an end, got that of {scene.name}")
    states = scene.fly().states_at(np.arange(0.5 * _STEP_S, length_s, _STEP_S))
    speeds_m_s = np.linalg.norm(states.velocities_world_m_s, axis=1)
    angular_speeds_rad_s = np.linalg.norm(states.angular_velocities_body_rad_s, axis=1)
    return length_s, float(speeds_m_s.sum() * _STEP_S), float(speeds_m_s.max()), float(angular_speeds_rad_s.max())
