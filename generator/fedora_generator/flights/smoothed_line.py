"""A line with corners, averaged over time with a Gaussian: C-infinity, and every derivative in closed form.

Let the line jump by ``step`` and bend by ``bend`` (change its slope) at a corner, tau after it and z = tau / sigma.
The average of a jump is the normal distribution Phi(z), that of a bend tau Phi(z) + sigma phi(z). An average never
leaves the convex hull of the averaged values: the curve stays within the hull of the line, and its derivative within
that of the slopes (and steps). So a smoothed route cuts corners, overshoots none, and is nowhere faster than ordered.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Floats = NDArray[np.float64]

REACH_SIGMAS: Final = 9.0
"""Farther from a corner than this its average is the line to rounding: Phi(-9) = 1e-19."""


class Derivatives(NamedTuple):
    """A quantity (n, k) and its first three derivatives with respect to time in seconds."""

    value: Floats
    first: Floats
    second: Floats
    third: Floats


@dataclass(frozen=True, slots=True)
class SmoothedLine:
    """A piecewise linear quantity of k columns, averaged with a Gaussian of standard deviation ``sigma_s``.

    Parameters
    ----------
    start
        (k,) value before the first corner, where the line is level.
    times_s
        (m,) corners, ascending.
    steps, bends
        (m, k) jump of the value, and change of the slope per second, at each corner.
    """

    start: Floats
    times_s: Floats
    steps: Floats
    bends: Floats
    sigma_s: float

    def at(self, times_s: Floats) -> Derivatives:
        """Value and derivatives at ``times_s`` (n,), seconds, in the unit of ``start`` per s, s^2 and s^3."""
        # Corners before ``first_corner`` bend the line fully; those from ``stop_corner`` on do not act yet. Between the
        # two, each corner adds its average.
        reach_s = REACH_SIGMAS * self.sigma_s
        first_corner = np.searchsorted(self.times_s, times_s - reach_s)
        stop_corner = np.searchsorted(self.times_s, times_s + reach_s)

        # Value and slope (n, k) of the line that is bent by the corners before ``first_corner`` only.
        slopes = np.vstack([np.zeros_like(self.start), np.cumsum(self.bends, axis=0)])
        rises = slopes[:-1] * np.diff(self.times_s, prepend=self.times_s[:1])[:, None] + self.steps
        vertices = self.start + np.vstack([np.zeros_like(self.start), np.cumsum(rises, axis=0)])
        corner_times_s = np.concatenate([[0.0], self.times_s])
        slope = slopes[first_corner]
        value = vertices[first_corner] + slope * (times_s - corner_times_s[first_corner])[:, None]
        total = Derivatives(value, slope, np.zeros_like(value), np.zeros_like(value))

        # Rows have different numbers of corners in reach: the k-th corner of every row that has one is added at once.
        for k in range(int(np.max(stop_corner - first_corner, initial=0))):
            rows = np.flatnonzero(first_corner + k < stop_corner)
            corners = first_corner[rows] + k
            steps, bends = self.steps[corners], self.bends[corners]
            tau_s = (times_s[rows] - self.times_s[corners])[:, None]
            z = tau_s / self.sigma_s
            phi = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
            # First, second and third derivative of Phi(z) with respect to time.
            density = phi / self.sigma_s
            density_rate = -z / self.sigma_s * density
            density_curvature = (z**2 - 1) / self.sigma_s**2 * density
            total.value[rows] += steps * ndtr(z) + bends * (tau_s * ndtr(z) + self.sigma_s * phi)
            total.first[rows] += steps * density + bends * ndtr(z)
            total.second[rows] += steps * density_rate + bends * density
            total.third[rows] += steps * density_curvature + bends * density_rate
        return total
