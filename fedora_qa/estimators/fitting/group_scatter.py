"""Standard errors estimated from few groups, and their own uncertainty.

An error that is estimated from the scatter of nu + 1 groups has itself the relative standard error 1 / sqrt(2 nu).
Values divided by such errors follow Student's distribution, which has heavier tails than the normal distribution. The
difference matters at the small probabilities at which alarms are raised.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.tails import fisher_beyond, normal_beyond, student_beyond

Float64 = NDArray[np.float64]

TAIL: Final = 1e-6
"""Tail probability at which Student's distribution is compared with the normal one: a false-alarm rate of 1e-4 a file,
shared by a hundred comparisons."""

BEYOND_CHANCE: Final = 0.05
"""Probability that chance alone makes the scatter of groups significant. It is large because an error that is too small
costs more than an error that is widened without need."""


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
