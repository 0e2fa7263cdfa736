"""Whether the largest of many values is a draw from the distribution of the others, or an outlier."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.estimators.fitting.tails import chance_of_student

Float64 = NDArray[np.float64]

FEWEST: Final = 8
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
    if len(values) < FEWEST:
        return 1.0
    deviations = np.abs(values - np.median(values, axis=0))
    # At least the usual standard error: if most values are equal, they have no scatter.
    widths = np.hypot(MAD_TO_SIGMA * np.median(deviations, axis=0), np.median(errors, axis=0))
    deviates = np.max(deviations / np.maximum(widths, 1e-300), axis=1)
    if np.mean(deviates > _OUTLYING) > _MOST_OUTLIERS:
        return 1.0
    # Bonferroni over all components, both signs.
    return min(1.0, 2 * values.size * chance_of_student(float(deviates.max()), _FREEDOM * len(values)))
