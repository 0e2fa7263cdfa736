"""How far events may appear shifted against frames although they are in place.

An event camera's pixel leaves its level open by a threshold C: what its events sum to differs from the change of the
level by e, of variance 2/3 C^2 between two frames. Where the picture has slope g, the peak of a correlation moves by
the regression of e on g.
"""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.shift_kernels import USABLE, add_slopes

Float64 = NDArray[np.float64]


def slope_sums(level: NDArray[np.floating], change: Float64, usable: NDArray[np.bool_]) -> Float64:
    """Return sums over usable pixels (3, 2), to the right and down.

    They are of the slopes of the level and of their squares, and of the squares of the slopes of its change.
    """
    sums = np.zeros((3, 2))
    add_slopes(level, change, usable.view(np.uint8), USABLE, (0, usable.shape[0], 0, usable.shape[1]), sums)
    return sums


def open_level_errors(sums: Float64, threshold: float) -> tuple[Float64, Float64]:
    """Return the standard error (2,) and the lag (2,), px, to the right and down, from ``slope_sums`` of an interval.

    Standard error: C sqrt(2/3 / sum g^2), g the slope of the change. Where little moves e hardly changes from interval
    to interval, so this is not divided by their number. Lag: a level that has risen lies above its reference, by C/2 on
    average, so that events follow the motion by at most C/2 mean|g| / mean g^2, g the slope of the level.
    """
    level, level_squares, change_squares = sums
    errors = threshold * np.sqrt(2 / 3 / np.maximum(change_squares, 1e-300))
    lags = threshold / 2 * level / np.maximum(level_squares, 1e-300)
    return errors, lags
