"""How far detection limits of a value that is the worst of several places or times lie apart."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

DETECTION_SIGMAS: Final = 7.0
"""Detection limit in standard errors: 5.3 of the limit that a thousand comparisons of a file share at a false-alarm
rate of 1e-4, Phi^-1(1 - 5e-8), and 1.6 of a power of 95% (``judgement/tolerances.py``)."""

SensitivityRange = tuple[tuple[float, float], tuple[float, float]]
"""Standard error and model error bound where and when the detection limit is lowest, and where it is highest."""


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
    # least = 2 bound + (z + z_power) s (judgement/tolerances.py)
    limits = 2 * bounds + DETECTION_SIGMAS * errors
    lowest, highest = int(np.argmin(limits)), int(np.argmax(limits))
    return (float(errors[lowest]), float(bounds[lowest])), (float(errors[highest]), float(bounds[highest]))
