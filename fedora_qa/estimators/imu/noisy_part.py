"""The part of a noisy sequence in which the sensor has a bias, by the full covariance of the residuals.

Noise of a pose is in all residuals that are computed from it, with opposite signs, so that it cancels in sums over many
rows, while a bias adds up: one that no single row shows may be certain in a part. Rows are summed in blocks. With the
jacobian ``J_e`` of a block by the bias, zero elsewhere, and the covariance C of all residuals r, the blocks have the
information ``G_ef = J_e^T C^-1 J_f`` and the projections ``b_e = J_e^T C^-1 r``. A part is the sum of its blocks: its
bias is ``A^-1 b`` and removes ``b^T A^-1 b`` of the whitened squares, where A and b are the sums over the part.

What a part removes of noise alone has a chi-square distribution; the best of n parts removes up to about 2 ln n more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from fedora_qa.estimators.imu.samples import ComparisonRows

Float64 = NDArray[np.float64]

_BLOCKS: Final = 40
"""Most blocks of rows, between which the edges of parts lie: 820 parts."""

_FEWEST_ROWS: Final = 4
"""Least rows of a block. Neighbouring residuals are correlated, so that an edge is not known to a single row."""

_LEAST_ELSEWHERE: Final = 0.1
"""Least share of the rows outside of the part: a bias of nearly all rows is one of the whole sequence."""

_SINGULAR: Final = 1e-12
"""Share of the total information that is added to each part's, so that it can be inverted without motion."""

_SIGMAS: Final = 3.0
"""Standard deviations of the squares of noise by which what a part leaves may exceed their mean."""


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
    left_within
        Share of the weighted squares of rows wholly within the part that it leaves, 0 to 1.
    """

    bias: tuple[float, float, float]
    start_s: float
    stop_s: float
    explained: float
    left_within: float


def noisy_part(
    segments: Sequence[ComparisonRows], whole: Sequence[Float64], *, centre: float, parameters: int
) -> PartialBias | None:
    """Return the part of the sequence whose bias leaves residuals that noise explains, and parameters of the whole not.

    Parameters
    ----------
    segments
        Rows of the samples as declared, in the order of time.
    whole
        Residuals (n, 3) of each segment that all parameters of the whole sequence leave.
    centre
        Time from that of a row to the middle of what it compares, in spans of the row.
    parameters
        Number of the parameters of the whole.

    Returns
    -------
    PartialBias or None
        None where the whole explains as much, or where the part leaves more than noise.
    """
    count = sum(map(len, segments))
    # Squares of noise have the mean 1 and the variance 2.
    residuals = 3.0 * count
    most_of_noise = residuals + _SIGMAS * sqrt(2.0 * residuals)
    if whitened_squares(segments, [rows.residuals for rows in segments]) <= most_of_noise:
        return None
    blocks = min(_BLOCKS, count // _FEWEST_ROWS)
    if blocks < 2:
        return None
    edges = np.linspace(0, count, blocks + 1).astype(np.intp)
    information, projection, squares = _sums(segments, edges)
    firsts, lasts = np.triu_indices(blocks, 1)
    # Parts between edges: the last edge may be that of the end.
    firsts, lasts = np.r_[firsts, np.arange(blocks)], np.r_[lasts, np.full(blocks, blocks)]
    rows = edges[lasts] - edges[firsts]
    is_part = count - rows >= max(_LEAST_ELSEWHERE * count, 1)
    firsts, lasts = firsts[is_part], lasts[is_part]
    right = projection[lasts] - projection[firsts]
    normal = information[lasts, lasts] + information[firsts, firsts]
    normal -= information[firsts, lasts] + information[lasts, firsts]
    floor = _SINGULAR * float(np.trace(information[-1, -1])) * np.eye(3)
    if not floor.any():
        return None
    biases = np.linalg.solve(normal + floor, right[..., np.newaxis])[..., 0]
    removed = np.einsum("ni,ni->n", biases, right)
    best = int(np.argmax(removed))
    left = squares - float(removed[best])
    # Each parameter removes a square of noise, and the choice among parts some more.
    cost = 2.0 * log(len(removed)) + 3.0
    if left > most_of_noise or left + cost >= whitened_squares(segments, whole) + parameters:
        return None
    first, last = int(edges[firsts[best]]), int(edges[lasts[best]])
    middles_s = np.concatenate([part.times_s + centre * part.spans_s for part in segments])
    half_s = float(np.median(np.concatenate([part.spans_s for part in segments]))) / 2
    x, y, z = (float(value) for value in biases[best])
    return PartialBias(
        (x, y, z),
        -inf if first == 0 else float(middles_s[first]) - half_s,
        inf if last == count else float(middles_s[last - 1]) + half_s,
        float(removed[best]) / max(squares - residuals, float(removed[best])),
        min(left / squares, 1.0),
    )


def whitened_squares(segments: Sequence[ComparisonRows], residuals: Sequence[Float64]) -> float:
    """Return ``r^T C^-1 r`` of residuals (n, 3) of each segment, with the covariance C of its rows."""
    return sum(
        squares_of(of_segment, rows.covariance_bands) for rows, of_segment in zip(segments, residuals, strict=True)
    )


def squares_of(residuals: Float64, covariance_bands: Float64) -> float:
    """Return ``r^T C^-1 r`` of residuals (n, 3) with the bands (3, u + 1, n) of their covariance C on each axis."""
    return sum(
        float(residuals[:, axis] @ solveh_banded(bands, residuals[:, axis]))
        for axis, bands in enumerate(covariance_bands)
    )


def _sums(segments: Sequence[ComparisonRows], edges: NDArray[np.intp]) -> tuple[Float64, Float64, float]:
    """Return sums of information (E, E, 3, 3) and projections (E, 3) before each of E edges, and the squares."""
    blocks = len(edges) - 1
    information, projection = np.zeros((blocks, blocks, 3, 3)), np.zeros((blocks, 3))
    squares, first = 0.0, 0
    for rows in segments:
        numbers = np.searchsorted(edges, np.arange(first, first + len(rows)), side="right") - 1
        own = np.unique(numbers)
        for axis, bands in enumerate(rows.covariance_bands):
            jacobians = rows.bias_jacobians[:, axis]
            # (n, blocks of the segment, 3): the jacobian of each block, zero in the others.
            by_block = (numbers[:, None] == own)[..., np.newaxis] * jacobians[:, np.newaxis]
            stacked = np.c_[by_block.reshape(len(rows), -1), rows.residuals[:, axis]]
            gram = stacked.T @ solveh_banded(bands, stacked)
            of_blocks = gram[:-1, :-1].reshape(len(own), 3, len(own), 3).swapaxes(1, 2)
            information[np.ix_(own, own)] += of_blocks
            projection[own] += gram[:-1, -1].reshape(len(own), 3)
            squares += float(gram[-1, -1])
        first += len(rows)
    summed = np.zeros((blocks + 1, blocks + 1, 3, 3))
    summed[1:, 1:] = np.cumsum(np.cumsum(information, axis=0), axis=1)
    return summed, np.concatenate([np.zeros((1, 3)), np.cumsum(projection, axis=0)]), squares
