"""Thresholds and delay of an event sensor from the normal equations of bracketed level samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.event_levels import NormalBlocks

Float64 = NDArray[np.float64]

FEWEST_PAIRS = 100
"""Below, a scale of residuals is not known to 10%."""
FEWEST_BLOCKS = 4
"""Below, the spread between blocks says nothing."""


@dataclass(frozen=True, slots=True)
class ResponseFit:
    """How events answer to the frames.

    Attributes
    ----------
    threshold_on, threshold_off
        Change of the level by one event, in the unit of the levels.
    delay_s
        Time by which events are stamped late (negative: early).
    standard_errors
        (3,) of the above: the larger of the formal ones and the spread between blocks (delete-one jackknife).
    attenuation
        (3,) bound on the bias that errors of the regressors cause.
    sigma
        Standard deviation of a pair's residual, in the unit of the levels.
    pairs
        Number of pairs.
    """

    threshold_on: float
    threshold_off: float
    delay_s: float
    standard_errors: tuple[float, float, float]
    attenuation: tuple[float, float, float]
    sigma: float
    pairs: int

    @property
    def threshold(self) -> float:
        """The mean of both thresholds, without sign."""
        return max(0.5 * (abs(self.threshold_on) + abs(self.threshold_off)), 1e-300)

    @property
    def relative_sigma(self) -> float:
        """Residual over threshold: small where the events follow the levels."""
        return self.sigma / self.threshold

    def block_sigmas(self, blocks: NormalBlocks) -> Float64:
        """Return the residual of each block (b,) under this fit."""
        rates = self.delay_s * np.array([self.threshold_on, self.threshold_off])
        theta = np.concatenate([[self.threshold_on, self.threshold_off], rates])
        squares = blocks.squares - 2 * blocks.vectors @ theta + np.einsum("i,bij,j->b", theta, blocks.matrices, theta)
        sigmas: Float64 = np.sqrt(np.maximum(squares / blocks.weights, 1e-300))
        return sigmas


def fit_response(blocks: NormalBlocks) -> ResponseFit | None:
    """Fit thresholds and delay; None where there are too few pairs or blocks, or one polarity is missing."""
    pairs = int(blocks.counts.sum())
    if pairs < FEWEST_PAIRS or len(blocks) < FEWEST_BLOCKS:
        return None
    matrix, vector = blocks.matrices.sum(axis=0), blocks.vectors.sum(axis=0)
    if np.linalg.cond(_scaled(matrix)) > 1e8:
        return None
    reduction = _reduction(matrix, vector)
    normal, theta = _solve(matrix, vector, reduction)
    weight = float(blocks.weights.sum())
    variance = max(float(blocks.squares.sum() - theta @ (reduction.T @ vector)), 0.0) / weight
    formal = np.sqrt(np.diag(np.linalg.inv(normal)) * variance)
    errors = np.maximum(formal, _jackknife(blocks, matrix, vector, reduction))
    bias = np.abs(np.linalg.solve(normal, weight * variance / np.where(theta == 0, np.inf, theta) * [1, 1, 0]))
    return ResponseFit(
        threshold_on=float(theta[0]),
        threshold_off=float(theta[1]),
        delay_s=float(theta[2]),
        standard_errors=(float(errors[0]), float(errors[1]), float(errors[2])),
        attenuation=(float(bias[0]), float(bias[1]), float(bias[2])),
        sigma=float(np.sqrt(variance)),
        pairs=pairs,
    )


def _reduction(matrix: Float64, vector: Float64) -> Float64:
    """Return (4, 3): the two columns of rates as one, C+ d rate+ - C- d rate-, with the thresholds of a first fit."""
    on, off = np.linalg.solve(matrix, vector)[:2]
    return np.array([[1, 0, 0], [0, 1, 0], [0, 0, on], [0, 0, off]])


def _solve(matrix: Float64, vector: Float64, reduction: Float64) -> tuple[Float64, Float64]:
    normal: Float64 = reduction.T @ matrix @ reduction
    theta = np.asarray(np.linalg.solve(normal, reduction.T @ vector), dtype=np.float64)
    return normal, theta


def _jackknife(blocks: NormalBlocks, matrix: Float64, vector: Float64, reduction: Float64) -> Float64:
    """Return the spread (3,) of the estimate when each block in turn is left out (Efron and Stein 1981)."""
    normals = reduction.T @ (matrix - blocks.matrices) @ reduction
    sides = (vector - blocks.vectors) @ reduction
    left_out = np.linalg.solve(normals, sides[..., np.newaxis])[..., 0]
    n = len(left_out)
    spread: Float64 = np.sqrt((n - 1) / n * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0))
    return spread


def _scaled(matrix: Float64) -> Float64:
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled: Float64 = matrix / np.outer(size, size)
    return scaled
