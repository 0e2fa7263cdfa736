"""Fit a regular clock to stamps: its period, its jitter, and what is missing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class RegularClock:
    """Stamps seen as ``start + period * n`` with noise.

    Attributes
    ----------
    period_ns, period_error_ns
        Least-squares slope over the sample numbers n, and its standard error from the scatter of the residuals.
    jitter_ns
        Robust standard deviation of the residuals (median absolute deviation / 0.6745).
    missing
        Samples that the gaps would have held.
    gap_after
        Rows behind which a gap lies.
    tick_ns
        Greatest common divisor of the steps: the grid on which the stamps lie.
    """

    period_ns: float
    period_error_ns: float
    jitter_ns: float
    missing: int
    gap_after: NDArray[np.intp]
    tick_ns: int

    @property
    def regular(self) -> bool:
        """Whether jitter is small enough (a fifth of a period, five sigma) for a gap to be told from it."""
        return self.jitter_ns < self.period_ns / 10


def fit_regular_clock(times_ns: NDArray[np.int64]) -> RegularClock | None:
    """Fit strictly increasing stamps, (N,) ns; None with fewer than three.

    The number of each sample counts the periods (the median step) that have passed, so that a gap shifts nothing.
    """
    if len(times_ns) < 3:
        return None
    steps = np.diff(times_ns)
    passed = np.maximum(np.rint(steps / np.median(steps)), 1.0)
    numbers = np.concatenate(([0.0], np.cumsum(passed)))
    elapsed = (times_ns - times_ns[0]).astype(np.float64)
    centred = numbers - numbers.mean()
    spread = float(centred @ centred)
    period = float(centred @ elapsed) / spread
    residuals = elapsed - elapsed.mean() - period * centred
    sigma = float(np.sqrt(residuals @ residuals / max(len(times_ns) - 2, 1)))
    return RegularClock(
        period_ns=period,
        period_error_ns=sigma / np.sqrt(spread),
        jitter_ns=float(np.median(np.abs(residuals - np.median(residuals)))) / 0.6745,
        missing=int(np.sum(passed - 1)),
        gap_after=np.flatnonzero(passed > 1),
        tick_ns=int(np.gcd.reduce(steps)),
    )
