"""Compiled order statistics of unsorted numbers. The versions that Numba provides take 3 to 4 s each to compile."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]


@njit(cache=True)
def median_of(values: Float64) -> float:
    """Return the median of values (n,), as ``numpy.median``; NaN where there is no value or a value is NaN."""
    return percentile_of(values, 50.0)


@njit(cache=True)
def percentile_of(values: Float64, percent: float) -> float:
    """Return a percentile of values, interpolated linearly between neighbours, as ``numpy.percentile``.

    Parameters
    ----------
    values
        (n,) in any order; not changed.
    percent
        Percentile, 0 to 100.

    Returns
    -------
    float
        In the unit of the values; NaN where there is no value or a value is NaN.
    """
    count = len(values)
    if count == 0:
        return np.nan
    # Selection rearranges in place: a copy leaves the caller's values in order.
    ranked = values.copy()
    for value in ranked:
        if np.isnan(value):
            return np.nan
    position = percent / 100.0 * (count - 1)
    rank = int(position)
    low = _select(ranked, rank)
    fraction = position - rank
    if fraction == 0.0 or rank + 1 >= count:
        return float(low)
    high = ranked[rank + 1]  # after the selection all values behind the rank are not smaller
    for i in range(rank + 2, count):
        high = min(high, ranked[i])
    if high == low:
        return float(low)  # the difference of two infinities would be NaN
    # As numpy.percentile: from the nearer end, so that the result equals ``low`` and ``high`` exactly at both ends.
    return float(low + fraction * (high - low) if fraction < 0.5 else high - (1.0 - fraction) * (high - low))


@njit(cache=True)
def _select(values: Float64, rank: int) -> float:
    """Return the value of a rank, counted from 0, and partition the values in place.

    Afterwards no value before the rank is larger than the result, and no value behind it is smaller. The method is
    Hoare's selection (CACM 4, 1961, algorithm 65) with the median of three as pivot.
    """
    # Median of three: with a pivot from one end, sorted values would take n^2 steps.
    left, right = 0, len(values) - 1
    while left < right:
        first, middle, last = values[left], values[(left + right) // 2], values[right]
        pivot = max(min(first, middle), min(max(first, middle), last))
        i, j = left, right
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            right = j
        elif rank >= i:
            left = i
        else:
            break
    return float(values[rank])
