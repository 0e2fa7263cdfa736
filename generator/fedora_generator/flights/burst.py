"""Bursts of rotation on the spot, each to the same angular speed.

A burst of yaw steps the yaw by ``angle_deg``: the rate is a Gaussian, so its peak gives the standard deviation.

A burst of roll is a sudden start (or stop) sideways. A change of velocity dv spread over sigma asks for the
acceleration g A exp(-x^2 / 2), with x = t / sigma and A = dv / (sigma g sqrt(2 pi)), the tangent of the greatest roll.
The roll is its arc tangent, so the roll rate is (A / sigma) x e / (1 + A^2 e^2) with e = exp(-x^2 / 2), up to its sign.
That is greatest where 1 - x^2 + A^2 e^2 (1 + x^2) = 0; the root is found numerically, and ``sigma`` follows from the
angular speed.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fedora_generator.flights.kinds import QuadrotorOptions, require_few, require_positive
from fedora_generator.flights.route import Route
from fedora_generator.flights.smoothed_line import SmoothedLine
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Floats = NDArray[np.float64]


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
        self._require_possible()
        sigma_s = _yaw_sigma_s(self) if self.axis == "yaw" else _roll_sigma_s(self)
        if self.period_s < 8 * sigma_s:  # at 8 sigma a neighbour adds less than 1e-10 of its peak
            raise ValueError(
                f"Expected period_s >= {8 * sigma_s:.3g}, so that bursts do not run together, got {self.period_s}"
            )
        times_s = self.first_s + self.period_s * np.arange(self.count, dtype=np.float64)
        still = np.zeros((self.count, 3))
        yaw_steps, bends = still[:, :1], still
        if self.axis == "yaw":
            yaw_steps = math.radians(self.angle_deg) * _pattern(self.count, (1, -1))[:, None]
        else:
            bends = _roll_bends(self, sigma_s)
        return Route(
            SmoothedLine(np.array(self.position_m), times_s, still, bends, sigma_s),
            SmoothedLine(np.radians([self.yaw_deg]), times_s, yaw_steps, still[:, :1], sigma_s),
            self.first_s + self.period_s * (self.count - 1),
        )

    def _require_possible(self) -> None:
        require_positive(self, "angular_speed_rad_s", "angle_deg", "period_s")
        if not np.isfinite([*self.position_m, self.yaw_deg, self.first_s]).all():
            raise ValueError(f"Expected finite numbers, got {self.position_m}, {self.yaw_deg} and {self.first_s}")
        if self.count < 1:
            raise ValueError(f"Expected count >= 1, got {self.count}")
        require_few("count", self.count)
        if self.axis == "roll" and self.angle_deg >= 90:
            raise ValueError(f"Expected angle_deg below 90 for a roll, got {self.angle_deg}")


def _yaw_sigma_s(options: BurstOptions) -> float:
    return math.radians(options.angle_deg) / (options.angular_speed_rad_s * math.sqrt(2 * math.pi))


def _roll_sigma_s(options: BurstOptions) -> float:
    tangent = math.tan(math.radians(options.angle_deg))

    def slope(x: float) -> float:
        squared = (tangent * math.exp(-0.5 * x * x)) ** 2
        return 1 - x * x + squared * (1 + x * x)

    farthest = 2 + math.sqrt(2 * math.log1p(tangent**2))  # there A^2 e^2 < e^-4, and the slope is below 0
    x = float(brentq(slope, 1.0, farthest, xtol=1e-14))
    e = math.exp(-0.5 * x * x)
    return tangent * x * e / (1 + (tangent * e) ** 2) / options.angular_speed_rad_s


def _roll_bends(options: BurstOptions, sigma_s: float) -> Floats:
    """Compute the changes of velocity (count, 3) along the body's left."""
    speed_m_s = sigma_s * math.sqrt(2 * math.pi) * STANDARD_GRAVITY_M_S2 * math.tan(math.radians(options.angle_deg))
    yaw_rad = math.radians(options.yaw_deg)
    left = speed_m_s * np.array([-math.sin(yaw_rad), math.cos(yaw_rad), 0.0])
    return np.outer(_pattern(options.count, (1, -1, -1, 1)), left)


def _pattern(count: int, signs: tuple[int, ...]) -> Floats:
    return np.resize(np.array(signs, dtype=np.float64), count)
