"""Robust scale, the delete-one jackknife, and the range of detection limits of a worst value."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]

SensitivityRange = tuple[tuple[float, float], tuple[float, float]]
"""Standard error and model error bound where and when the detection limit is lowest, and where it is highest."""

MAD_TO_SIGMA: Final = 1.4826
"""Standard deviation over median absolute deviation (MAD) of a normal distribution, to five digits.

Half of all deviations are below the MAD, so that ``Phi(MAD / sigma) - Phi(-MAD / sigma) = 1/2`` and
``MAD / sigma = Phi^-1(3/4) = 0.674490``; its reciprocal is 1.482602.
Source: F. R. Hampel, The influence curve and its role in robust estimation, J. Am. Stat. Assoc. 69 (1974) 383.
"""

NORMAL_QUARTILE: Final = 0.6745
"""``Phi^-1(3/4)``, the third quartile of the standard normal distribution, to four digits: ``1 / MAD_TO_SIGMA``."""

DETECTION_SIGMAS: Final = 7.0
"""Detection limit in standard errors: 5.3 of the limit that a thousand comparisons of a file share at a false-alarm
rate of 1e-4, Phi^-1(1 - 5e-8), and 1.6 of a power of 95% (``judgement/judge.py``)."""


def robust_sigma(values: ArrayLike, middle: ArrayLike | None = None) -> Float64:
    """Return the standard deviation that the median absolute deviation implies for normal values.

    Parameters
    ----------
    values
        (n,) or (n, k) values.
    middle
        Centre of the deviations, broadcast against ``values``; the median of each column where None.

    Returns
    -------
    ndarray
        (), or (k,), in the unit of the values; NaN where a value is NaN.
    """
    # sigma = 1.4826 median |x - middle|
    values = np.asarray(values, dtype=np.float64)
    about = np.median(values, axis=0) if middle is None else np.asarray(middle)
    return np.asarray(MAD_TO_SIGMA * np.median(np.abs(values - about), axis=0))


def jackknife_errors(left_out: ArrayLike) -> Float64:
    """Return the standard errors of estimates by the delete-one jackknife.

    Parameters
    ----------
    left_out
        (n, ...) estimates that leave out one of n parts each; with n = 1 the error is 0.

    Returns
    -------
    ndarray
        (...) standard errors, in the unit of the estimates.

    Sources
    -------
    B. Efron and C. Stein, The jackknife estimate of variance, Ann. Statist. 9 (1981) 586, eq. 1.4.
    """
    estimates = np.asarray(left_out, dtype=np.float64)
    # error^2 = (n - 1) / n sum_i (theta_i - mean theta)^2 = (n - 1) variance, with divisor n.
    errors: Float64 = np.sqrt((len(estimates) - 1) * np.var(estimates, axis=0))
    return errors


def sensitivity_range(standard_errors: ArrayLike, model_error_bounds: ArrayLike) -> SensitivityRange | None:
    """Return the range of the sensitivity of a value that is the worst of several places or times.

    Parameters
    ----------
    standard_errors, model_error_bounds
        Of each comparison, in the unit of the value; arrays that broadcast against each other. Comparisons without a
        finite error or bound are left out.

    Returns
    -------
    tuple or None
        None where no comparison is left.
    """
    arrays = np.broadcast_arrays(np.asarray(standard_errors, float), np.asarray(model_error_bounds, float))
    errors, bounds = (array.ravel() for array in arrays)
    finite = np.isfinite(errors) & np.isfinite(bounds)
    if not finite.any():
        return None
    errors, bounds = errors[finite], bounds[finite]
    # least = 2 bound + (z + z_power) s (judgement/judge.py)
    limits = 2 * bounds + DETECTION_SIGMAS * errors
    lowest, highest = int(np.argmin(limits)), int(np.argmax(limits))
    return (float(errors[lowest]), float(bounds[lowest])), (float(errors[highest]), float(bounds[highest]))
