"""A declared random walk of a sensor's bias within a segment of time.

Given its values at both ends of a segment, a Wiener process is the straight line between them and a Brownian bridge,
which is independent of the ends and of everything outside of the segment (I. Karatzas, S. Shreve, Brownian Motion and
Stochastic Calculus, Springer 1991, section 5.6.B). So the biases at the ends of each segment are unknowns of a fit, and
the bridge belongs to the noise of the rows. In the middle of a segment of length L it has the variance ``w^2 L/4``, on
average ``w^2 L/6``, for a walk of density w.

The bias of a row is a mean over the time that the row compares. Means over separate times have the covariance of the
bias at the middles, ``w^2 min(s, t)``. The variance of a mean over the length h from a on is ``w^2 (a + h/3)``, which
is ``w^2 h/6`` less than at the middle.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

BRIDGE_SQUARES: Final = 0.4
"""Sum of the squared eigenvalues of the covariance of a Brownian bridge, over the square of their sum: they are
``1/(pi k)^2``, and ``(pi^4/90) / (pi^2/6)^2 = 0.4``."""


@dataclass(frozen=True, slots=True)
class SegmentWalk:
    """The random walk of a bias at the n rows of one segment.

    Attributes
    ----------
    density
        Of the walk, rad/s^2/sqrt(Hz) or m/s^3/sqrt(Hz).
    times_s
        (n,) middle of the time that each row compares, s from the instant at which the bias was 0.
    start_s, stop_s
        Ends of the segment, s, outside of ``times_s``.
    lengths_s
        (n,) time over which the bias is averaged at each row, s; 0 counts more of its fast part than a mean has.
    """

    density: float
    times_s: Float64
    start_s: float
    stop_s: float
    lengths_s: Float64

    def select(self, rows: NDArray[np.bool_]) -> "SegmentWalk":
        """Return the walk at the rows where a mask (n,) is True; the ends stay."""
        return replace(self, times_s=self.times_s[rows], lengths_s=self.lengths_s[rows])

    @property
    def shares(self) -> Float64:
        """Shares (n, 2) of the biases at start and stop in the straight line between them."""
        of_stop = (self.times_s - self.start_s) / (self.stop_s - self.start_s)
        return np.stack([1.0 - of_stop, of_stop], axis=1)

    @property
    def variances(self) -> Float64:
        """Variance (n,) of the bias at the middle of a row, in its unit squared."""
        # Wiener process from zero: E[b(t)^2] = w^2 t.
        variances: Float64 = self.density**2 * np.maximum(self.times_s, 0.0)
        return variances

    @property
    def bridge_variances(self) -> Float64:
        """Variance (n,) of the bias at the middle of a row about the straight line between both ends."""
        # Brownian bridge: w^2 (t - a) (b - t) / (b - a).
        of_start, of_stop = self.shares.T
        variances: Float64 = self.density**2 * of_start * of_stop * (self.stop_s - self.start_s)
        return variances

    @property
    def mean_deficits(self) -> Float64:
        """Variance (n,) by which the mean over a row varies less than the bias at its middle."""
        deficits: Float64 = self.density**2 * self.lengths_s / 6
        return deficits

    @property
    def bridge_information(self) -> Float64:
        """Inverse of the covariance of the bridge at the middles: bands (2, n), in the upper form of SciPy."""
        # The steps between neighbouring instants, both ends included, are independent and have the variances w^2 dt.
        of_steps = 1.0 / (self.density**2 * np.diff(self.times_s, prepend=self.start_s, append=self.stop_s))
        return np.stack([-of_steps[:-1], of_steps[:-1] + of_steps[1:]])
