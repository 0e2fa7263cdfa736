"""Tail probabilities and quantiles of the usual distributions, and standard errors from few groups.

An error that is estimated from the scatter of nu + 1 groups has itself the relative standard error 1 / sqrt(2 nu).
Values divided by such errors follow Student's distribution, which has heavier tails than the normal distribution. The
difference matters at the small probabilities at which alarms are raised.

The functions call ``scipy.special``. ``scipy.stats`` returns the same numbers, but takes longer to import than the rest
of SciPy, and each call takes a hundred times as long.
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
"""Degrees of freedom of the squared median absolute deviation, for each value. With n normal values its relative
variance is 4 * 1.36 / n (an efficiency of 37%; F. R. Hampel, J. Am. Stat. Assoc. 69 (1974)); the relative variance of a
variance with v degrees of freedom is 2 / v."""

_OUTLYING: Final = 5.0
"""Deviate beyond which a value is an outlier."""

_MOST_OUTLIERS: Final = 0.25
"""Largest share (0 to 1) of outliers. With more outliers (noise that lasts for half of the time) the width of most
values does not describe the distribution of all."""

TAIL: Final = 1e-6
"""Tail probability at which Student's distribution is compared with the normal one: a false-alarm rate of 1e-4 a file,
shared by a hundred comparisons."""

BEYOND_CHANCE: Final = 0.05
"""Probability that chance alone makes the scatter of groups significant. It is large because an error that is too small
costs more than an error that is widened without need."""


def normal_beyond(chance: float) -> float:
    """Return the value that a standard normal deviate exceeds with the probability ``chance`` (0 to 1)."""
    return float(-ndtri(chance))


def student_beyond(chance: float, freedom: float) -> float:
    """Return the value that Student's t exceeds with a given probability.

    Parameters
    ----------
    chance
        Probability of a larger value, 0 to 1.
    freedom
        Degrees of freedom, above 0.

    Returns
    -------
    float
        The quantile of 1 - ``chance``.
    """
    # The distribution is symmetric. The lower tail keeps all digits; 1 - chance would round them off.
    return float(-stdtrit(freedom, chance))


def chance_of_student(value: float, freedom: float) -> float:
    """Return the probability that Student's t exceeds a value.

    Parameters
    ----------
    value
        The deviate.
    freedom
        Degrees of freedom, above 0.

    Returns
    -------
    float
        Probability of one tail, 0 to 1.
    """
    return float(stdtr(freedom, -value))


def chi_squared_beyond(chance: float, freedom: float) -> float:
    """Return the value that chi squared exceeds with a given probability.

    Parameters
    ----------
    chance
        Probability of a larger value, 0 to 1.
    freedom
        Degrees of freedom, above 0.

    Returns
    -------
    float
        The quantile of 1 - ``chance``.
    """
    return float(chdtri(freedom, chance))


def fisher_beyond(chance: float, above: ArrayLike, below: ArrayLike) -> NDArray[np.float64]:
    """Return the value that Fisher's F exceeds with a given probability.

    Parameters
    ----------
    chance
        Probability of a larger value, 0 to 1.
    above, below
        Degrees of freedom of the numerator and of the denominator, of any shape.

    Returns
    -------
    NDArray[np.float64]
        Quantiles of 1 - ``chance``, of the broadcast shape of both.
    """
    # F(a, b) exceeds x exactly where F(b, a) lies below 1 / x: a small lower tail keeps all digits.
    return np.asarray(1.0 / fdtri(below, above, chance), dtype=np.float64)


def log_chance_of_hits(hits: ArrayLike, trials: ArrayLike, share: ArrayLike) -> NDArray[np.float64]:
    """Return the logarithm of the probability of so many hits or more in ``trials`` (binomial distribution).

    Parameters
    ----------
    hits, trials
        Numbers of hits and of trials, of any shape.
    share
        Probability of a hit in one trial, 0 to 1, of any shape.

    Returns
    -------
    NDArray[np.float64]
        Natural logarithm, of the broadcast shape; minus infinity where the probability is 0.

    Sources
    -------
    M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964), 26.5.24: binomial tail by the incomplete
    beta function.
    """
    hits, trials = np.asarray(hits, dtype=np.float64), np.asarray(trials, dtype=np.float64)
    # P(X >= k) = I_p(k, n - k + 1) for k > 0 (26.5.24), and P(X >= 0) = 1.
    chances = np.where(hits > 0, betainc(np.maximum(hits, 1.0), trials - hits + 1.0, share), 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(chances), dtype=np.float64)


def chance_of_largest(values: Float64, errors: Float64) -> float:
    """Return a bound of the probability that the largest of n vectors is from the normal distribution of the others.

    The deviation of each component from the median is divided by its scale: the width of most values (1.4826 times the
    median absolute deviation) and their median standard error, added in squares. The width is itself estimated from n
    values, so that these deviates follow Student's distribution. The probability that one of m deviates exceeds z is at
    most m times the probability for one (Bonferroni).

    Parameters
    ----------
    values, errors
        (n, k) components and their standard errors, in one unit; rows that are not finite do not count.

    Returns
    -------
    float
        Upper bound of the probability, 0 to 1. It is 1 where there are fewer than eight vectors, because their width is
        too uncertain, and where more than a quarter of the vectors are outliers.
    """
    finite = np.isfinite(values).all(axis=1) & np.isfinite(errors).all(axis=1)
    values, errors = values[finite], errors[finite]
    if len(values) < FEWEST_VALUES:
        return 1.0
    deviations = np.abs(values - np.median(values, axis=0))
    # Not less than the median standard error: if most values are equal, their scatter is 0.
    widths = np.hypot(MAD_TO_SIGMA * np.median(deviations, axis=0), np.median(errors, axis=0))
    deviates = np.max(deviations / np.maximum(widths, 1e-300), axis=1)
    if np.mean(deviates > _OUTLYING) > _MOST_OUTLIERS:
        return 1.0
    # p <= 2 n k P(t > z): Bonferroni over all components and both signs.
    return min(1.0, 2 * values.size * chance_of_student(float(deviates.max()), _FREEDOM * len(values)))


def student_factor(freedom: float) -> float:
    """Return the factor that widens an estimated error, so that it can be judged as an exact one.

    Parameters
    ----------
    freedom
        Degrees of freedom of the error; below 1 it counts as 1.

    Returns
    -------
    float
        1 at least: the ratio of Student's deviate to the normal deviate at the tail probability ``TAIL``.
    """
    # factor = t / z: deviates of Student's and of the normal distribution at the same tail probability.
    return student_beyond(TAIL, max(freedom, 1.0)) / normal_beyond(TAIL)


def shared_errors(by_part: Float64 | float, parts: float, by_group: Float64 | float, groups: float) -> Float64:
    """Return standard errors of an estimate from many parts, where the parts of a group may share errors.

    The result is the larger of both errors. Where the groups scatter significantly more than the parts imply (Fisher's
    F at ``BEYOND_CHANCE``), the error by groups is first widened by ``student_factor``.

    Parameters
    ----------
    by_part, by_group
        Standard errors of the same estimate by the scatter of the parts and by that of the groups, of any shape, in one
        unit.
    parts, groups
        Numbers of parts and of groups; the degrees of freedom are one less.

    Returns
    -------
    Float64
        Of the shape of ``by_part``, in its unit.
    """
    # F = (by_group / by_part)^2, the ratio of two variance estimates. They are only nearly independent, because the
    # groups consist of the parts.
    ratio = (by_group / np.maximum(by_part, 1e-300)) ** 2
    shared = ratio > fisher_beyond(BEYOND_CHANCE, max(groups - 1, 1), max(parts - 1, 1))
    errors: Float64 = np.maximum(by_part, np.where(shared, student_factor(groups - 1), 1.0) * by_group)
    return errors
