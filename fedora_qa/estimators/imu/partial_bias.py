"""A bias of the sensor in a part of a sequence, by the residuals of IMU and poses.

With the jacobian J of the residuals r by a bias, and their weights W, a bias of some rows is ``A^-1 b`` and removes
``b^T A^-1 b`` of their weighted squares, where ``A = sum J^T W J`` and ``b = sum J^T W r``. Sums over a part are
differences of sums from the first row on, so that many parts are compared at once: the part whose bias removes most is
the likeliest. Rows that the bias does not affect add to A and not to b, so that a part that is too long removes less.

A row at an edge of the part is affected in proportion to the time of it that lies within, which gives the edges between
rows. The errors of neighbouring rows are taken as independent: in noise of the poses only a large bias is placed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.samples import ComparisonRows

Float64 = NDArray[np.float64]

_EDGES: Final = 64
"""Number of edges between which all parts are compared; then either edge is moved row by row."""

_ROUNDS: Final = 3
"""Number of times that both edges are moved: each time the other edge is nearer to its place."""

_PARTLY: Final = 2
"""Number of rows at either edge that the bias may affect partly."""

_FEWEST_ROWS: Final = 6
"""Least number of rows within the part: those at its edges, and some that are affected in full."""

_LEAST_OUTSIDE: Final = 0.1
"""Least share of rows outside the part: a bias of nearly all rows is one of the whole sequence."""

_LEAST_EXPLAINED: Final = 0.9
"""Least share of the squares that the bias must explain: of two motions that differ, half a swing is a bias as well, of
which it explains a half or so."""

_SINGULAR: Final = 1e-12
"""Share of the total information that is added to each part's, so that it can be inverted without motion."""


@dataclass(frozen=True, slots=True)
class PartialBias:
    """A bias of the sensor within a part of the sequence.

    Attributes
    ----------
    bias
        (3,) along the axes of the sensor, in its unit.
    start_s, stop_s
        Of the part, s; infinite where it reaches an end of the sequence.
    explained
        Share of the weighted squares beyond noise that it removes, 0 to 1.
    """

    bias: tuple[float, float, float]
    start_s: float
    stop_s: float
    explained: float


@dataclass(frozen=True, slots=True)
class BiasDrift:
    """A bias of the sensor that changes evenly from the first sample to the last.

    Attributes
    ----------
    first, last
        (3,) at either end, along the axes of the sensor, in its unit.
    explained
        Share of the weighted squares beyond noise that it removes, 0 to 1.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    explained: float


def partial_bias(segments: Sequence[ComparisonRows], *, centre: float) -> PartialBias | None:
    """Return the part of the sequence whose bias removes most of the residuals.

    Parameters
    ----------
    segments
        Rows of the samples as declared, in the order of time.
    centre
        Time from that of a row to the middle of what it compares, in spans of the row.

    Returns
    -------
    PartialBias or None
        None where the likeliest part is the whole sequence, has too few rows, or leaves more than little.
    """
    residuals = np.concatenate([rows.residuals / rows.sigmas for rows in segments])
    jacobians = np.concatenate([rows.bias_jacobians / rows.sigmas[..., np.newaxis] for rows in segments])
    spans_s = np.concatenate([rows.spans_s for rows in segments])
    middles_s = np.concatenate([rows.times_s for rows in segments]) + centre * spans_s
    count = len(residuals)
    # Sums over the rows before each edge: (n + 1, 3, 3) and (n + 1, 3).
    information = _sums_before(np.einsum("nij,nik->njk", jacobians, jacobians))
    projection = _sums_before(np.einsum("nij,ni->nj", jacobians, residuals))
    floor = _SINGULAR * float(np.trace(information[-1])) * np.eye(3)

    def biases(first: NDArray[np.intp], last: NDArray[np.intp]) -> Float64:
        sums = projection[last] - projection[first]
        solved = np.linalg.solve(information[last] - information[first] + floor, sums[..., np.newaxis])
        return np.asarray(solved[..., 0], dtype=np.float64)

    def removed(first: NDArray[np.intp], last: NDArray[np.intp]) -> Float64:
        squares: Float64 = np.einsum("ni,ni->n", projection[last] - projection[first], biases(first, last))
        return squares

    if count < _FEWEST_ROWS or not floor.any():
        return None
    edges = np.unique(np.linspace(0, count, min(count, _EDGES) + 1).astype(np.intp))
    firsts, lasts = (edges[numbers] for numbers in np.triu_indices(len(edges), 1))
    best = int(np.argmax(removed(firsts, lasts)))
    first, last, reach = int(firsts[best]), int(lasts[best]), -(-count // _EDGES)
    for _ in range(_ROUNDS):
        near = np.arange(max(first - reach, 0), min(first + reach, last - 1) + 1)
        first = int(near[np.argmax(removed(near, np.full(len(near), last)))])
        near = np.arange(max(last - reach, first + 1), min(last + reach, count) + 1)
        last = int(near[np.argmax(removed(np.full(len(near), first), near))])
    if last - first < _FEWEST_ROWS or count - (last - first) < _LEAST_OUTSIDE * count:
        return None
    squares = float(removed(np.array([first]), np.array([last]))[0])
    bias = biases(np.array([first + _PARTLY]), np.array([last - _PARTLY]))[0]
    # Noise alone has squares of one a residual, or less where errors are bounds: it is measured outside of the part.
    outside = np.concatenate([residuals[:first], residuals[last:]])
    noise = min(float(np.mean(outside**2)), 1.0) * residuals.size
    explained = squares / max(float(np.sum(residuals**2)) - noise, squares)
    if explained < _LEAST_EXPLAINED:
        return None
    # Share of each row that the bias affects.
    predicted = jacobians @ bias
    lengths = np.maximum(np.sum(predicted**2, axis=1), np.finfo(np.float64).tiny)
    shares = np.clip(np.sum(residuals * predicted, axis=1) / lengths, 0.0, 1.0)
    step_s = float(np.median(spans_s))
    start_s, stop_s = -inf, inf
    # From the middle of a row that is affected in full, back by the shares of the two rows on either side of the edge.
    if first >= _PARTLY:
        start_s = float(
            middles_s[first + _PARTLY] - step_s / 2 - step_s * shares[first - _PARTLY : first + _PARTLY].sum()
        )
    if last + _PARTLY <= count:
        stop_s = float(
            middles_s[last - _PARTLY - 1] + step_s / 2 + step_s * shares[last - _PARTLY : last + _PARTLY].sum()
        )
    return PartialBias((float(bias[0]), float(bias[1]), float(bias[2])), start_s, stop_s, explained)


def bias_drift(segments: Sequence[ComparisonRows]) -> BiasDrift | None:
    """Return the bias that changes evenly with time and removes nearly all of the residuals.

    Parameters
    ----------
    segments
        Rows of the samples as declared, in the order of time.

    Returns
    -------
    BiasDrift or None
        None where it leaves more than little, or a bias without a drift removes as much.
    """
    residuals = np.concatenate([rows.residuals / rows.sigmas for rows in segments])
    jacobians = np.concatenate([rows.bias_jacobians / rows.sigmas[..., np.newaxis] for rows in segments])
    times_s = np.concatenate([rows.times_s for rows in segments])
    if len(residuals) < _FEWEST_ROWS or times_s[-1] <= times_s[0]:
        return None
    # b(t) = (1 - s) b_first + s b_last, s from 0 to 1.
    share = ((times_s - times_s[0]) / (times_s[-1] - times_s[0]))[:, np.newaxis, np.newaxis]
    total = float(np.sum(residuals**2))
    targets = residuals.ravel()
    drifting = np.concatenate([(1 - share) * jacobians, share * jacobians], axis=2).reshape(-1, 6)
    solved = np.linalg.lstsq(drifting, targets, rcond=None)[0]
    constant = np.linalg.lstsq(jacobians.reshape(-1, 3), targets, rcond=None)[0]
    left = float(np.sum((targets - drifting @ solved) ** 2))
    left_by_constant = float(np.sum((targets - jacobians.reshape(-1, 3) @ constant) ** 2))
    # Noise alone leaves a square of one a residual, which no bias removes; of less than as much again nothing is said.
    beyond_noise = total - targets.size
    if beyond_noise < targets.size or total - left < _LEAST_EXPLAINED * beyond_noise:
        return None
    if total - left_by_constant >= _LEAST_EXPLAINED * beyond_noise:
        return None
    first, last = (tuple(float(value) for value in part) for part in (solved[:3], solved[3:]))
    return BiasDrift(first, last, min((total - left) / beyond_noise, 1.0))


def _sums_before(values: Float64) -> Float64:
    """Return the sums (n + 1, ...) of the values (n, ...) before each of them, and of all."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
