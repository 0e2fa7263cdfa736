"""Means and distances of distributions that are known by their counts in bins.

Within a bin values count as evenly spread, so that the distribution function is a straight line between its edges.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


def shares_of(counts: NDArray[Any]) -> Float64:
    """Return counts (..., n) as shares of their sum along the last axis, which must not be 0."""
    return np.asarray(counts / counts.sum(axis=-1, keepdims=True), dtype=np.float64)


def mean_of(shares: Float64, edges: Float64) -> Float64:
    """Return the means (...) of distributions given by shares (..., n) in bins of ``edges`` (n + 1,), in their unit."""
    # Values are spread evenly within a bin, so that the mean of a bin is its middle.
    return np.asarray(shares @ ((edges[1:] + edges[:-1]) / 2))


def wasserstein(first: Float64, other: Float64, edges: Float64) -> Float64:
    """Return the Wasserstein distances of order 1 (...) between shares (..., n), in the unit of ``edges`` (n + 1,).

    It is the area between the two distribution functions (Vallender 1974): how far a value must be moved on average to
    turn one distribution into the other.
    """
    # F - G at the right edge of each bin, a straight line within it; then |F - G| at its left and right edge.
    ahead = np.cumsum(first - other, axis=-1)
    before = np.abs(np.concatenate([np.zeros_like(ahead[..., :1]), ahead[..., :-1]], axis=-1))
    after = np.abs(ahead)
    crossing = np.sign(np.roll(ahead, 1, axis=-1)) * np.sign(ahead) < 0
    # np.roll puts the last bin before the first, where F - G is 0 and cannot change its sign.
    crossing[..., 0] = False
    total = before + after
    # Where F - G changes its sign in a bin of width w, |F - G| is two triangles, (a^2 + b^2) / (a + b) w / 2, and not
    # the trapezium (a + b) w / 2.
    squares = np.divide(before**2 + after**2, total, out=np.zeros_like(total), where=total > 0)
    return np.asarray(np.where(crossing, squares, total) @ np.diff(edges) / 2)
