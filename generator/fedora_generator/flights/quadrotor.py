"""A quadrotor that flies a route: its state, and the attitude that its path demands.

Thrust has the direction that the acceleration needs, and yaw is free.

Sources: D. Mellinger and V. Kumar, Minimum Snap Trajectory Generation and Control for Quadrotors (ICRA 2011), section
III; M. Faessler, A. Franchi, D. Scaramuzza, Differential Flatness of Quadrotor Dynamics Subject to Rotor Drag (RA-L
2018), eq. 8 to 16, here with the same drag in all directions. The intermediate axis is y_C, as in the second source: so
the yaw of the route is the yaw of the intrinsic Z-Y-X angles.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.flights.gusts import Gusts
from fedora_generator.flights.route import Derivatives, Route
from fedora_generator.rotations import body_rates_from_zyx, matrices_from_quaternions, quaternions_from_zyx
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Floats = NDArray[np.float64]

_UP_M_S2: Final = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])


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


@dataclass(frozen=True, slots=True)
class Attitude:
    """Intrinsic Z-Y-X angles and the body's angular velocity."""

    yaw_pitch_roll_rad: Floats
    """(n, 3)"""
    angular_velocities_body_rad_s: Floats
    """(n, 3)"""


def attitude_of_thrust(
    thrusts_world_m_s2: Floats, thrust_rates_world_m_s3: Floats, yaw_rad: Floats, yaw_rates_rad_s: Floats
) -> Attitude:
    """Attitude, body to world (ENU), with body Z along the thrust.

    Parameters
    ----------
    thrusts_world_m_s2, thrust_rates_world_m_s3
        (n, 3) thrust per mass, acceleration - gravity + drag, and its derivative, in the world frame.
    yaw_rad, yaw_rates_rad_s
        (n,) yaw of the route, counter-clockwise from east, and its derivative.

    Returns
    -------
    Attitude
        Angles in rad and angular velocities in rad/s, (n, 3) each.

    Raises
    ------
    SceneError
        A thrust does not point above the horizon: the quadrotor would have to turn over.
    """
    if thrusts_world_m_s2.size and not (lowest := float(thrusts_world_m_s2[:, 2].min())) > 0:
        raise SceneError(f"Expected a thrust that points up, got {lowest:.3g} m/s^2; fly slower, or turn less sharply")
    x, y, z = _in_yaw_frame(thrusts_world_m_s2, yaw_rad)
    x_rate, y_rate, z_rate = _in_yaw_frame(thrust_rates_world_m_s3, yaw_rad)
    # The yaw frame turns with the body: the thrust turns the other way in it.
    x_rate, y_rate = x_rate + yaw_rates_rad_s * y, y_rate - yaw_rates_rad_s * x
    forward = np.hypot(x, z)
    forward_rate = (x * x_rate + z * z_rate) / forward
    pitch_rad, roll_rad = np.arctan2(x, z), np.arctan2(-y, forward)
    pitch_rates = (z * x_rate - x * z_rate) / forward**2
    roll_rates = (y * forward_rate - forward * y_rate) / (forward**2 + y**2)
    zyx_rates = np.stack([yaw_rates_rad_s, pitch_rates, roll_rates], axis=-1)
    return Attitude(
        np.stack([yaw_rad, pitch_rad, roll_rad], axis=-1), body_rates_from_zyx(pitch_rad, roll_rad, zyx_rates)
    )


def _in_yaw_frame(vectors_world: Floats, yaw_rad: Floats) -> tuple[Floats, Floats, Floats]:
    """Components of vectors (n, 3) along x_C, y_C (the axes turned by the yaw) and up."""
    x, y, z = np.moveaxis(vectors_world, -1, 0)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return cos * x + sin * y, cos * y - sin * x, z
