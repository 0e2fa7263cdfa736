"""Samples that were written again without being refreshed."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_TYPICAL_SHARE: Final = 0.1
_ROUNDINGS: Final = 16.0
"""Units of rounding by which neighbours of a steady motion may differ: rotating a vector takes fifteen operations (nine
products, six sums), each of which errs by half a unit at most, in either neighbour."""


def unmoved(*samples: Float64, roundings: Sequence[float]) -> Indices:
    """Return the indices of samples that repeat the one before exactly, in every array, in the midst of motion.

    A body that comes to rest slows down before: a run of repeats counts only where the change next to it, before or
    after, is at least a tenth of a typical one. Where everything repeats nothing counts. Nor does it where values
    change by no more than rounding makes of a steady motion; ``roundings`` is the unit of rounding of each array.
    """
    changes = [np.abs(np.diff(values, axis=0)).max(axis=-1, initial=0.0) for values in samples]
    still = np.all([change == 0 for change in changes], axis=0)
    if not len(still) or still.all() or not still.any():
        return np.empty(0, dtype=np.intp)
    moves = np.zeros(len(still), dtype=np.bool_)
    for change, rounding in zip(changes, roundings, strict=True):
        if np.any(change > 0):
            typical = float(np.median(change[change > 0]))
            moves |= change >= max(_TYPICAL_SHARE * typical, _ROUNDINGS * rounding)
    starts = np.flatnonzero(still & ~np.insert(still[:-1], 0, False))
    stops = np.flatnonzero(still & ~np.append(still[1:], False)) + 1
    padded = np.concatenate(([False], moves, [False]))
    runs = [np.arange(a, b) + 1 for a, b in zip(starts, stops, strict=True) if padded[a] or padded[b + 1]]
    return np.concatenate(runs) if runs else np.empty(0, dtype=np.intp)
