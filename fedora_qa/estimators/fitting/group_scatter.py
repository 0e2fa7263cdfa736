"""Standard errors estimated from few groups, and their own uncertainty.

An error estimated from the scatter of nu + 1 groups has itself the relative standard error 1 / sqrt(2 nu). This matters
far out in the tail, where alarms are raised: values over such errors follow Student's distribution, not the normal one.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.tails import fisher_beyond, normal_beyond, student_beyond

Float64 = NDArray[np.float64]

TAIL: Final = 1e-6
"""Tail at which Student's distribution is compared with the normal one: 1e-4 of a file over a hundred comparisons."""

BEYOND_CHANCE: Final = 0.05
"""Probability at which groups scatter by chance as much more than their parts imply that they are taken to share
errors: to overlook it costs more than to widen an error without need."""


def student_factor(freedom: float) -> float:
    """Return the factor by which an error with so many degrees of freedom is widened, to be judged as an exact one.

    Parameters
    ----------
    freedom
        Degrees of freedom of the error; below 1 it counts as 1.

    Returns
    -------
    float
        1 at least: the ratio of both distributions' deviates at the probability ``TAIL``.
    """
    return student_beyond(TAIL, max(freedom, 1.0)) / normal_beyond(TAIL)


def shared_errors(by_part: Float64 | float, parts: float, by_group: Float64 | float, groups: float) -> Float64:
    """Return standard errors by the scatter of few groups of the many parts, where groups share errors.

    Where groups scatter beyond what parts imply by more than chance (Fisher's F), theirs are the errors, by Student's
    distribution; elsewhere they are the larger of both.

    Parameters
    ----------
    by_part, by_group
        Standard errors, of any shape, by the scatter of the parts and of the groups.
    parts, groups
        Numbers of parts and of groups; degrees of freedom are one less.

    Returns
    -------
    Float64
        Of the shape of ``by_part``, in its unit.
    """
    # Fisher's F, the ratio of two independent variance estimates; independence is approximate: groups hold the parts.
    ratio = (by_group / np.maximum(by_part, 1e-300)) ** 2
    shared = ratio > fisher_beyond(BEYOND_CHANCE, max(groups - 1, 1), max(parts - 1, 1))
    errors: Float64 = np.maximum(by_part, np.where(shared, student_factor(groups - 1), 1.0) * by_group)
    return errors
