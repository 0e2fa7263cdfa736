"""The figures of the FEDORA paper's five sequences."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Figures:
    """Length, distance, greatest speed, greatest angular speed, mean event rate."""

    length_s: float
    distance_m: float
    speed_m_s: float
    angular_speed_rad_s: float
    million_events_s: float


PAPER: Final = {
    "baylands-day1": Figures(165, 594.87, 5.032, 1.233, 1.12),
    "baylands-day2": Figures(220, 386.31, 2.531, 2.845, 1.44),
    "baylands-ngt1": Figures(159, 268.47, 2.416, 10.718, 1.69),
    "racetrack-day": Figures(112, 188.86, 2.218, 2.374, 2.01),
    "racetrack-ngt": Figures(112, 188.36, 2.058, 2.098, 1.79),
}

PAPER_MEAN_FLOW_PX: Final = {10: 18.841, 25: 10.392, 50: 6.15}
"""Of the three Baylands sequences together, by rate in Hz."""
