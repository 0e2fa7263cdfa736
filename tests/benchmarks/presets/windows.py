"""Where in a long flight to look: short windows, drawn more densely where the image moves faster.

Events come where the image moves: most of a slow flight's may come in its few turns. Windows spread evenly over time
would see few turns or none. Here they are spread evenly over the motion of the image, one at random in each of n equal
parts of it, and weighted with what time each stands for (importance and stratified sampling: W. G. Cochran, Sampling
Techniques, 1977, ch. 5 and 9A).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.flight import Flight

Floats = NDArray[np.float64]

TYPICAL_DEPTH_M: Final = 5.0
"""Turns move the image as fast as forward motion at this depth; the estimate is right with any, and best near this."""

_GRID_S: Final = 0.01
_AT_REST: Final = 0.1
"""Share of the mean motion that is added everywhere: what stands still is looked at all the same."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Starts of n windows, ascending, and their weights, whose mean is 1 but for chance."""

    starts_s: Floats
    """(n,)"""
    weights: Floats
    """(n,)"""

    def mean(self, values: Floats) -> tuple[float, float]:
        """Mean over the flight of what was measured in the windows (n,), and its standard error.

        Neighbours in motion are alike, so the variance within the parts follows from successive differences (Cochran,
        section 8.12); it errs to the large side.
        """
        terms = self.weights * values
        return float(terms.mean()), float(np.sqrt((np.diff(terms) ** 2).mean() / 2 / terms.size))


def spread_windows(flight: Flight, flight_s: float, window_s: float, count: int, rng: np.random.Generator) -> Windows:
    """Spread windows of ``window_s`` over a flight's first ``flight_s`` seconds."""
    edges_s = np.linspace(0.0, flight_s, round(flight_s / _GRID_S) + 1)
    moved_rad = np.concatenate([[0.0], np.cumsum(image_motion_rad_s(flight, edges_s[:-1]) * np.diff(edges_s))])
    starts_s = edges_s[edges_s <= flight_s - window_s]
    motion = np.interp(starts_s + window_s, edges_s, moved_rad) - np.interp(starts_s, edges_s, moved_rad)
    motion = motion + _AT_REST * motion.mean()
    share = np.cumsum(motion) / motion.sum()
    places = np.searchsorted(share, (np.arange(count) + rng.random(count)) / count)
    return Windows(starts_s[places], motion.mean() / motion[places])


def image_motion_rad_s(flight: Flight, times_s: Floats) -> Floats:
    """How fast (n,) the image moves, roughly: turning, and passing by what lies at a typical depth."""
    states = flight.states_at(times_s)
    turning_rad_s = np.linalg.norm(states.angular_velocities_body_rad_s, axis=1)
    speeds_m_s = np.linalg.norm(states.velocities_world_m_s, axis=1)
    return np.asarray(turning_rad_s + speeds_m_s / TYPICAL_DEPTH_M)
