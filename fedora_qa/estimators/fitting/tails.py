"""Tails of the usual distributions, by the special functions behind them, and of the largest of many values.

`scipy.stats` returns the same numbers, but takes longer to import than the rest of SciPy, and each call takes a hundred
times as long.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betainc, chdtri, fdtri, ndtri, stdtr, stdtrit

from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA

Float64 = NDArray[np.float64]

FEWEST_VALUES: Final = 8
"""Number of values below which the relative standard error of their scatter exceeds a quarter."""

_FREEDOM: Final = 1 / (2 * 1.36)
"""Degrees of freedom a value: the squared median absolute deviation of n normal values has the relative variance
4 * 1.36 / n (an efficiency of 37%; F. R. Hampel, J. Am. Stat. Assoc. 69 (1974)), a variance with v degrees of freedom
2 / v."""

_OUTLYING: Final = 5.0
"""Deviate beyond which a value is an outlier."""

_MOST_OUTLIERS: Final = 0.25
"""Largest share of outliers. With more of them (noise that lasts for half of the time) the width of the others is not
that of the values."""


def normal_beyond(chance: float) -> float:
    """Return the value that a standard normal deviate exceeds with this probability."""
    return float(-ndtri(chance))


def student_beyond(chance: float, freedom: float) -> float:
    """Return the value that Student's t exceeds with this probability."""
    # The distribution is symmetric; the lower tail keeps all digits, 1 - chance would not.
    return float(-stdtrit(freedom, chance))


def chance_of_student(value: float, freedom: float) -> float:
    """Return the probability that Student's t exceeds a value."""
    return float(stdtr(freedom, -value))


def chi_squared_beyond(chance: float, freedom: float) -> float:
    """Return the value that chi squared exceeds with this probability."""
    return float(chdtri(freedom, chance))


def fisher_beyond(chance: float, above: ArrayLike, below: ArrayLike) -> NDArray[np.float64]:
    """Return the value that Fisher's F exceeds with this probability.

    Parameters
    ----------
    chance
        Probability of a larger value.
    above, below
        Degrees of freedom of the numerator and of the denominator, of any shape.
    """
    # F(a, b) exceeds x exactly where F(b, a) lies below 1 / x: a small lower tail keeps all digits.
    return np.asarray(1.0 / fdtri(below, above, chance), dtype=np.float64)


def log_chance_of_hits(hits: ArrayLike, trials: ArrayLike, share: float) -> NDArray[np.float64]:
    """Return the logarithm of the probability of so many hits or more in ``trials`` (binomial distribution).

    By the incomplete beta function (Abramowitz and Stegun, 26.5.24).

    Parameters
    ----------
    hits, trials
        Of any shape.
    share
        Probability of a hit, 0 to 1.

    Returns
    -------
    NDArray[np.float64]
        Natural logarithm; minus infinity where the probability is 0.
    """
    hits, trials = np.asarray(hits, dtype=np.float64), np.asarray(trials, dtype=np.float64)
    any_hit = hits > 0
    # P(X >= k) = I_p(k, n - k + 1); of no hits at all it is 1.
    chances = np.where(
        any_hit, betainc(np.where(any_hit, hits, 1.0), np.where(any_hit, trials - hits, trials) + 1.0, share), 1.0
    )
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(chances), dtype=np.float64)


def chance_of_largest(values: Float64, errors: Float64) -> float:
    """Return how probable it is that the largest of n vectors is a draw from the normal distribution of most of them.

    Each component is compared with its median, with the width of most values (1.4826 times the median absolute
    deviation) and their usual error together. As the width itself is estimated from n values, deviates follow
    Student's distribution; the chance that one of m exceeds z is no more than m times that of one (Bonferroni). 1 for
    few values, which give no width, and where more than a few are outliers.

    Parameters
    ----------
    values, errors
        (n, k) components and their standard errors; rows that are not finite do not count.

    Returns
    -------
    float
        Upper bound of the probability, 0 to 1.
    """
    finite = np.isfinite(values).all(axis=1) & np.isfinite(errors).all(axis=1)
    values, errors = values[finite], errors[finite]
    if len(values) < FEWEST_VALUES:
        return 1.0
    deviations = np.abs(values - np.median(values, axis=0))
    # At least the usual standard error: if most values are equal, they have no scatter.
    widths = np.hypot(MAD_TO_SIGMA * np.median(deviations, axis=0), np.median(errors, axis=0))
    deviates = np.max(deviations / np.maximum(widths, 1e-300), axis=1)
    if np.mean(deviates > _OUTLYING) > _MOST_OUTLIERS:
        return 1.0
    # Bonferroni over all components, both signs.
    return min(1.0, 2 * values.size * chance_of_student(float(deviates.max()), _FREEDOM * len(values)))
