"""Timestamps of a regular clock that were rounded to a grid which does not divide its period."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Int64 = NDArray[np.int64]

_SEGMENT: Final = 64
"""Samples of a segment: a grid that holds for a part of the stream only is detected there."""

_FEWEST_ODD: Final = 4
"""Steps of the rarer length in a segment: fewer could be single gaps."""

_OF_A_GRID: Final = 1.1
"""Extent of correct rounding about the fitted line, in grids: one about the true line, a little off the fitted."""


def rounding_grid_ns(times_ns: Int64, *, resolution_ns: int) -> int:
    """Return the grid to which the timestamps of a regular clock were rounded, ns; 0 where there is none.

    A period rounded to a grid that does not divide it gives steps of just two lengths, the multiples of the grid next
    to it, in even turns: they never stray from a straight line by more than half a grid. Jitter gives steps of
    many lengths, lost samples stray from the line.

    Parameters
    ----------
    times_ns
        (N,) timestamps; segments where they decrease show no grid.
    resolution_ns
        Unit of all timestamps, ns: only coarser grids count.

    Returns
    -------
    int
        ns, the median of the segments' grids.
    """
    segments = times_ns[: len(times_ns) // _SEGMENT * _SEGMENT].reshape(-1, _SEGMENT)
    if not len(segments):
        return 0
    steps = np.diff(segments, axis=1)
    short, long = steps.min(axis=1), steps.max(axis=1)
    coarse = (short >= 0) & (long - short > resolution_ns)
    grids = [grid for grid in map(_grid_of, segments[coarse]) if grid]
    return int(np.median(grids)) if grids else 0


def _grid_of(times_ns: Int64) -> int:
    steps = np.diff(times_ns)
    short, long = int(steps.min()), int(steps.max())
    # Both steps are multiples of the grid, next to each other: their difference is the grid.
    grid = long - short
    rarer = min(np.count_nonzero(steps == short), np.count_nonzero(steps == long))
    if short % grid or rarer < _FEWEST_ODD or not np.isin(steps, (short, long)).all():
        return 0
    # Extent of the timestamps about the line of least squares.
    numbers = np.arange(len(times_ns)) - (len(times_ns) - 1) / 2
    elapsed = (times_ns - times_ns[0]).astype(np.float64)
    slope = float(numbers @ elapsed) / float(numbers @ numbers)
    extent_ns = float(np.ptp(elapsed - slope * numbers))
    return grid if extent_ns <= _OF_A_GRID * grid else 0
