"""Tails of the usual distributions, by the special functions behind them.

`scipy.stats` returns the same numbers, but takes longer to import than the rest of SciPy, and each call takes a hundred
times as long.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betainc, chdtri, fdtri, ndtri, stdtr, stdtrit


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
