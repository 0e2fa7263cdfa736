"""The double integral of a cubic spline, of many curves with the same knots at once.

As ``scipy.interpolate.CubicSpline(...).antiderivative(2)``, without the polynomials between: the slopes at the knots
say all, and an interval's integrals are closed forms of its two values and slopes (cubic Hermite interpolation).

Source: C. de Boor, A Practical Guide to Splines, Springer 2001, chapter IV (slopes; the not-a-knot condition).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

Float64 = NDArray[np.float64]

_FEWEST_KNOTS: Final = 4
"""Fewer determine a parabola or a line."""


def integrated_twice(times_s: Float64, values: Float64, at_s: Float64) -> Float64:
    """Return the double integrals (k, n) from the first knot, at ``at_s`` (n,), of k splines through (k, M) values.

    Knots ``times_s`` (M,) increase strictly; there are at least two. Beyond them the outermost cubics go on.
    """
    if len(times_s) < _FEWEST_KNOTS:
        twice: Float64 = CubicSpline(times_s, values, axis=1).antiderivative(2)(at_s)
        return twice
    steps_s = np.diff(times_s)
    slopes = _slopes(steps_s, values)
    left, right, begins, ends = values[:, :-1], values[:, 1:], slopes[:, :-1], slopes[:, 1:]
    once, twice = np.zeros_like(values), np.zeros_like(values)
    np.cumsum(steps_s * ((left + right) / 2 + steps_s / 12 * (begins - ends)), axis=1, out=once[:, 1:])
    grown = steps_s * (7 / 20 * left + 3 / 20 * right + steps_s * (begins / 20 - ends / 30))
    np.cumsum(steps_s * (once[:, :-1] + grown), axis=1, out=twice[:, 1:])
    knot = np.clip(np.searchsorted(times_s, at_s, side="right") - 1, 0, len(times_s) - 2)
    beyond_s, step_s = at_s - times_s[knot], steps_s[knot]
    w = beyond_s / step_s
    of_right, of_end = w**4 / 4 - w**5 / 10, w**5 / 20 - w**4 / 12
    of_left, of_begin = w**2 / 2 - of_right, w**3 / 6 - w**4 / 6 + w**5 / 20
    partly = (of_left * left[:, knot] + of_right * right[:, knot]) + step_s * (
        of_begin * begins[:, knot] + of_end * ends[:, knot]
    )
    integrals: Float64 = twice[:, knot] + once[:, knot] * beyond_s + step_s**2 * partly
    return integrals


def _slopes(steps_s: Float64, values: Float64) -> Float64:
    """Return the slopes (k, M) at knots: second derivatives are continuous, and third ones at the outermost but one."""
    chords = np.diff(values, axis=1) / steps_s
    before, after = steps_s[:-1], steps_s[1:]
    bands = np.empty((3, len(steps_s) + 1))
    bands[1, 1:-1] = 2 * (before + after)
    bands[0, 2:], bands[2, :-2] = before, after
    right = np.empty_like(values)
    right[:, 1:-1] = 3 * (after * chords[:, :-1] + before * chords[:, 1:])
    first, last = steps_s[0] + steps_s[1], steps_s[-1] + steps_s[-2]
    bands[1, 0], bands[0, 1] = steps_s[1], first
    bands[1, -1], bands[2, -2] = steps_s[-2], last
    right[:, 0] = (steps_s[0] + 2 * first) * steps_s[1] * chords[:, 0] + steps_s[0] ** 2 * chords[:, 1]
    right[:, 0] /= first
    right[:, -1] = steps_s[-1] ** 2 * chords[:, -2] + (2 * last + steps_s[-1]) * steps_s[-2] * chords[:, -1]
    right[:, -1] /= last
    slopes: Float64 = solve_banded((1, 1), bands, right.T, overwrite_ab=True, overwrite_b=True, check_finite=False).T
    return slopes
