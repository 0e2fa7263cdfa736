"""A quadrotor that flies a route."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.flights.flatness import attitude_of_thrust
from fedora_generator.flights.gusts import Gusts
from fedora_generator.flights.route import Route
from fedora_generator.flights.smoothed_line import Derivatives
from fedora_generator.flights.state import FlightState
from fedora_generator.rotations import matrices_from_quaternions, quaternions_from_zyx
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Floats = NDArray[np.float64]

_UP_M_S2: Final = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])


@dataclass(frozen=True, slots=True)
class Quadrotor:
    """The states along a route with drag ``-drag_per_s * (velocity - wind)`` (per mass), displaced by gusts.

    The attitude follows from standard gravity, also where a scene sets another gravity for the inertial unit.
    """

    route: Route
    drag_per_s: float
    gusts: Gusts | None = None

    def states_at(self, times_s: Floats) -> FlightState:
        """State at ``times_s`` (n,), seconds, in closed form; before and after the route it hovers."""
        motion = self.route.position_world_m.at(times_s)
        wind_m_s, wind_rate_m_s2 = np.zeros(3), np.zeros(3)
        if self.gusts is not None:
            displacement, wind_m_s, wind_rate_m_s2 = self.gusts.at(times_s)
            motion = Derivatives(*(planned + gust for planned, gust in zip(motion, displacement, strict=True)))
        positions, velocities, accelerations, jerks = motion
        yaw_rad, yaw_rates_rad_s = (column[:, 0] for column in self.route.yaw_rad.at(times_s)[:2])
        attitude = attitude_of_thrust(
            accelerations + _UP_M_S2 + self.drag_per_s * (velocities - wind_m_s),
            jerks + self.drag_per_s * (accelerations - wind_rate_m_s2),
            yaw_rad,
            yaw_rates_rad_s,
        )
        orientations_xyzw = quaternions_from_zyx(*np.moveaxis(attitude.yaw_pitch_roll_rad, -1, 0))
        return FlightState(
            positions_world_m=positions,
            orientations_xyzw=orientations_xyzw,
            R_world_body=matrices_from_quaternions(orientations_xyzw),
            velocities_world_m_s=velocities,
            accelerations_world_m_s2=accelerations,
            angular_velocities_body_rad_s=attitude.angular_velocities_body_rad_s,
        )
