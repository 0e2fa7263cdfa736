"""Stamps of a regular clock that were rounded to a grid which does not divide its period."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Int64 = NDArray[np.int64]

_STRETCH: Final = 64
"""Samples looked at together: a grid that holds for a part of the stream only is found there."""

_FEWEST_ODD: Final = 4
"""Steps of the rarer length in a stretch: fewer could be single gaps."""

_OF_A_GRID: Final = 1.1
"""Extent of honest rounding about the fitted line, in grids: one about the true line, a little off the fitted."""


def rounding_grid_ns(times_ns: Int64, *, resolution_ns: int) -> int:
    """Return the grid to which the stamps of a regular clock were rounded, ns; 0 where there is none.

    A period rounded to a grid that does not divide it gives steps of just two lengths, the multiples of the grid next
    to it, in even turns: the stamps never stray from a straight line by more than half a grid. Jitter gives steps of
    many lengths, lost samples stray from the line.

    Parameters
    ----------
    times_ns
        (N,) stamps; stretches where they decrease show no grid.
    resolution_ns
        What stamps are rounded to anyway: only coarser grids count.
    """
    stretches = times_ns[: len(times_ns) // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    if not len(stretches):
        return 0
    steps = np.diff(stretches, axis=1)
    short, long = steps.min(axis=1), steps.max(axis=1)
    coarse = (short >= 0) & (long - short > resolution_ns)
    found = [grid for grid in map(_grid_of, stretches[coarse]) if grid]
    return int(np.median(found)) if found else 0


def _grid_of(times_ns: Int64) -> int:
    steps = np.diff(times_ns)
    short, long = int(steps.min()), int(steps.max())
    grid = long - short
    rarer = min(np.count_nonzero(steps == short), np.count_nonzero(steps == long))
    if short % grid or rarer < _FEWEST_ODD or not np.isin(steps, (short, long)).all():
        return 0
    return grid if _strays_ns(times_ns) <= _OF_A_GRID * grid else 0


def _strays_ns(times_ns: Int64) -> float:
    """Return the extent of the stamps about the line of least squares."""
    numbers = np.arange(len(times_ns)) - (len(times_ns) - 1) / 2
    elapsed = (times_ns - times_ns[0]).astype(np.float64)
    slope = float(numbers @ elapsed) / float(numbers @ numbers)
    return float(np.ptp(elapsed - slope * numbers))
