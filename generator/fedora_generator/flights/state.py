"""The state of a flight: pose, velocities and accelerations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FlightState:
    """Ground truth at n instants, float64; ``p_world = R_world_body p_body + position``."""

    positions_world_m: Floats
    """(n, 3)"""
    orientations_xyzw: Floats
    """(n, 4), unit, body to world, the sign continuous in time"""
    R_world_body: Floats
    """(n, 3, 3)"""
    velocities_world_m_s: Floats
    """(n, 3)"""
    accelerations_world_m_s2: Floats
    """(n, 3), without gravity"""
    angular_velocities_body_rad_s: Floats
    """(n, 3)"""
