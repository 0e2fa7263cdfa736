"""Bursts of rotation on the spot, each to the same angular speed.

A burst of yaw steps the yaw by ``angle_deg``: the rate is a Gaussian, so its peak gives the standard deviation.

A burst of roll is a sudden start (or stop) sideways. A change of velocity dv spread over sigma needs the
acceleration g A exp(-x^2 / 2), with x = t / sigma and A = dv / (sigma g sqrt(2 pi)), the tangent of the greatest roll.
The roll is its arc tangent, so the roll rate is (A / sigma) x e / (1 + A^2 e^2) with e = exp(-x^2 / 2), up to its sign.
That is greatest where 1 - x^2 + A^2 e^2 (1 + x^2) = 0; the root is found numerically, and ``sigma`` follows from the
angular speed.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from fedora_generator.flights.kinds import QuadrotorOptions, require_few, require_positive
from fedora_generator.flights.route import Route
from fedora_generator.flights.smoothed_line import SmoothedLine
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstOptions(QuadrotorOptions):
    """``count`` bursts, ``period_s`` apart, the first at ``first_s``, each peaking at ``angular_speed_rad_s``.

    ``axis = "yaw"``: turns by ``angle_deg``, left and right in turn. ``axis = "roll"``: starts and stops to the left,
    then to the right, and so on, leaning up to ``angle_deg``. The peak is exact without drag and wind.
    """

    kind: Literal["burst"] = "burst"
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    axis: Literal["yaw", "roll"] = "yaw"
    angular_speed_rad_s: float
    angle_deg: float = 40.0
    first_s: float = 0.5
    period_s: float = 1.0
    count: int = 8

    def route(self) -> Route:
        """Hover with corners of yaw, or of velocity, at each burst."""
        require_positive(self, "angular_speed_rad_s", "angle_deg", "period_s")
        if not np.isfinite([*self.position_m, self.yaw_deg, self.first_s]).all():
            raise ValueError(f"Expected finite numbers, got {self.position_m}, {self.yaw_deg} and {self.first_s}")
        if self.count < 1:
            raise ValueError(f"Expected count >= 1, got {self.count}")
        require_few("count", self.count)
        if self.axis == "roll" and self.angle_deg >= 90:
            raise ValueError(f"Expected angle_deg below 90 for a roll, got {self.angle_deg}")

        angle_rad = math.radians(self.angle_deg)
        if self.axis == "yaw":
            # The peak of a Gaussian yaw rate: angle / (sigma sqrt(2 pi)).
            sigma_s = angle_rad / (self.angular_speed_rad_s * math.sqrt(2 * math.pi))
        else:
            sigma_s = _roll_sigma_s(math.tan(angle_rad), self.angular_speed_rad_s)
        if self.period_s < 8 * sigma_s:  # at 8 sigma a neighbour adds less than 1e-10 of its peak
            raise ValueError(
                f"Expected period_s >= {8 * sigma_s:.3g}, so that bursts do not run together, got {self.period_s}"
            )
        times_s = self.first_s + self.period_s * np.arange(self.count, dtype=np.float64)
        zeros = np.zeros((self.count, 3))
        yaw_steps, bends = zeros[:, :1], zeros
        if self.axis == "yaw":
            signs = np.resize(np.array((1, -1), dtype=np.float64), self.count)
            yaw_steps = angle_rad * signs[:, None]
        else:
            # Changes of velocity dv = A sigma g sqrt(2 pi) along the body's left: start and stop, left and then right.
            signs = np.resize(np.array((1, -1, -1, 1), dtype=np.float64), self.count)
            speed_m_s = sigma_s * math.sqrt(2 * math.pi) * STANDARD_GRAVITY_M_S2 * math.tan(angle_rad)
            yaw_rad = math.radians(self.yaw_deg)
            left_m_s = speed_m_s * np.array([-math.sin(yaw_rad), math.cos(yaw_rad), 0.0])
            bends = np.outer(signs, left_m_s)
        return Route(
            SmoothedLine(np.array(self.position_m), times_s, zeros, bends, sigma_s),
            SmoothedLine(np.radians([self.yaw_deg]), times_s, yaw_steps, zeros[:, :1], sigma_s),
            self.first_s + self.period_s * (self.count - 1),
        )


def _roll_sigma_s(tangent: float, angular_speed_rad_s: float) -> float:
    """Compute the standard deviation of a change of velocity whose roll rate peaks at a speed; ``tangent`` is A."""

    def slope(x: float) -> float:
        squared = (tangent * math.exp(-0.5 * x * x)) ** 2
        return 1 - x * x + squared * (1 + x * x)

    farthest = 2 + math.sqrt(2 * math.log1p(tangent**2))  # there A^2 e^2 < e^-4, and the slope is below 0
    x = float(brentq(slope, 1.0, farthest, xtol=1e-14))
    e = math.exp(-0.5 * x * x)
    return tangent * x * e / (1 + (tangent * e) ** 2) / angular_speed_rad_s
