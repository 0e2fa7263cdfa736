"""Whitened normal equations of stretches of rows with banded covariance."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Float64 = NDArray[np.float64]

_LEAST_INFORMATION: Final = 1e-12
"""Of a direction, in units of the best known one, after scaling to unit diagonal."""


@dataclass(frozen=True, slots=True)
class BlockEquations:
    """Whitened normal equations of one stretch of time, for all P parameters and Q nuisances of the stretch alone.

    Attributes
    ----------
    normal, right
        (P + Q, P + Q) and (P + Q,): ``normal @ unknowns = right`` is the least-squares solution of the stretch alone.
    model_right
        (P + Q,) what the known error of the model adds to ``right``.
    squares, count
        Sum of whitened squared residuals with all unknowns 0, and how many there are.
    """

    normal: Float64
    right: Float64
    model_right: Float64
    squares: float
    count: int

    def linearised_at(self, parameters: Float64) -> "BlockEquations":
        """Return the equations for unknowns that count from 0, where residuals had ``parameters`` (P,) taken out."""
        taken = self.normal[:, : len(parameters)] @ parameters
        squares = self.squares + parameters @ (2 * self.right + taken)[: len(parameters)]
        return replace(self, right=self.right + taken, squares=float(squares))


def block_equations(
    residuals: Float64, jacobians: Float64, covariance_bands: Float64, model_errors: Float64
) -> BlockEquations:
    """Whiten one stretch of rows and sum its normal equations.

    Parameters
    ----------
    residuals, model_errors
        (n, 3): what is left without parameters, and a bound on the model's own error.
    jacobians
        (n, 3, P + Q): ``residuals = jacobians @ unknowns + noise``; the stretch's own nuisances come last.
    covariance_bands
        (3, u + 1, n) covariance of the noise over rows on each axis, in the upper form of
        ``scipy.linalg.solveh_banded``.
    """
    columns = jacobians.shape[-1]
    stacked = np.concatenate((jacobians, residuals[..., None], model_errors[..., None]), axis=-1)
    whitened = np.stack([solveh_banded(bands, stacked[:, axis]) for axis, bands in enumerate(covariance_bands)], axis=1)
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


def inverse_of(normal: Float64) -> Float64:
    """Invert normal equations. Directions that rounding cannot tell from unknown get the least information it can."""
    scale = np.sqrt(np.diag(normal))
    information, directions = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = np.maximum(information, _LEAST_INFORMATION * information[-1])
    inverse: Float64 = (directions / kept) @ directions.T / np.outer(scale, scale)
    return inverse
