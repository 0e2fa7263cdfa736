"""Whitened normal equations of segments of rows with banded covariance, and of all segments together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Float64 = NDArray[np.float64]

_LEAST_INFORMATION: Final = 1e-12
"""Least information of a direction over that of the best determined one, after scaling to unit diagonal."""


@dataclass(frozen=True, slots=True)
class BlockEquations:
    """Whitened normal equations of one segment of time, for all P parameters and Q nuisances of the segment alone.

    Attributes
    ----------
    normal, right
        (P + Q, P + Q) and (P + Q,): ``normal @ unknowns = right`` is the least-squares solution of the segment alone.
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
        """Return the equations for unknowns that count from 0; ``parameters`` (P,) were subtracted from the residuals.

        With r' = r - J p: ``J^T r = J^T r' + N p`` and ``r^T r = r'^T r' + p^T (2 J^T r' + N p)``.
        """
        shift = self.normal[:, : len(parameters)] @ parameters
        # p^T (2 J^T r' + N p), docstring above: ``right`` is J^T r', ``shift`` is N p.
        squares = self.squares + parameters @ (2 * self.right + shift)[: len(parameters)]
        return replace(self, right=self.right + shift, squares=float(squares))


def block_equations(
    residuals: Float64, jacobians: Float64, covariance_bands: Float64, model_errors: Float64
) -> BlockEquations:
    """Whiten one segment of rows and sum its normal equations.

    Parameters
    ----------
    residuals, model_errors
        (n, 3): residuals without parameters, and a bound on the model's own error.
    jacobians
        (n, 3, P + Q): ``residuals = jacobians @ unknowns + noise``; the segment's own nuisances come last.
    covariance_bands
        (3, u + 1, n) covariance of the noise over rows on each axis, in the upper form of
        ``scipy.linalg.solveh_banded``.

    Returns
    -------
    BlockEquations
        Of P + Q unknowns.

    Raises
    ------
    numpy.linalg.LinAlgError
        A covariance is not positive definite.
    """
    columns = jacobians.shape[-1]
    stacked = np.concatenate((jacobians, residuals[..., None], model_errors[..., None]), axis=-1)
    whitened = np.stack([solveh_banded(bands, stacked[:, axis]) for axis, bands in enumerate(covariance_bands)], axis=1)
    # One product [J r m]^T C^-1 [J r m] holds the normal matrix, both right sides and the squares.
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


def inverse_of(normal: Float64) -> Float64:
    """Invert normal equations (P, P), whose diagonal is positive.

    Directions whose information is below the rounding error get the least information that exceeds it.
    """
    scale = np.sqrt(np.diag(normal))
    information, directions = np.linalg.eigh(normal / np.outer(scale, scale))
    bounded = np.maximum(information, _LEAST_INFORMATION * information[-1])
    inverse: Float64 = (directions / bounded) @ directions.T / np.outer(scale, scale)
    return inverse


class SummedEquations:
    """Sums over B segments for P parameters, with the nuisances of single segments eliminated.

    Parameters
    ----------
    blocks
        The segments.
    count
        P; the unknowns that follow in each segment are its nuisances.
    nuisance_covariance
        (B, B) prior covariance of a nuisance between segments; None where there are none.

    Attributes
    ----------
    normals, normal
        (B, P, P) of single segments, nuisances at 0; (P, P) of all, nuisances eliminated.
    right, model_right, squares
        Of all, nuisances eliminated: (P,), (P,), a number.
    model_rights
        (B, P) of single segments, nuisances at 0.
    """

    def __init__(self, blocks: Sequence[BlockEquations], count: int, nuisance_covariance: Float64 | None) -> None:
        self.normals = np.array([block.normal[:count, :count] for block in blocks])
        self.model_rights = np.array([block.model_right[:count] for block in blocks])
        self.normal: Float64 = self.normals.sum(axis=0)
        self.model_right: Float64 = self.model_rights.sum(axis=0)
        self._rights = np.array([block.right[:count] for block in blocks])
        self.right: Float64 = self._rights.sum(axis=0)
        self.squares = float(sum(block.squares for block in blocks))
        self._nuisances = None
        if nuisance_covariance is not None:
            self._nuisances = SegmentNuisances(blocks, count, nuisance_covariance)
            self.normal = self.normal - self._nuisances.normal
            self.right = self.right - self._nuisances.right
            self.model_right = self.model_right - self._nuisances.model_right
            self.squares -= self._nuisances.squares

    def scores(self, values: Float64) -> Float64:
        """Return (B, P) the right sides of single segments less the part that ``values`` (P,) explain."""
        scores: Float64 = self._rights - self.normals @ values
        return scores if self._nuisances is None else scores - self._nuisances.scores(values)


class SegmentNuisances:
    """Unknowns of single segments, correlated between segments by their prior, eliminated from the equations.

    Parameters
    ----------
    blocks, count
        The B segments, and P; all unknowns that follow are nuisances.
    covariance
        (B, B) prior covariance of a nuisance between segments; nuisances are alike and independent.

    Attributes
    ----------
    normal, right, model_right, squares
        Terms that their elimination subtracts from the parameters' equations (Schur complement).
    """

    def __init__(self, blocks: Sequence[BlockEquations], count: int, covariance: Float64) -> None:
        segments, nuisances = len(blocks), len(blocks[0].right) - count
        # Prior information of the nuisances: C^-1 between segments, the Q nuisances of a segment independent.
        own = np.kron(np.linalg.inv(covariance), np.eye(nuisances))
        for segment, block in enumerate(blocks):
            columns = slice(segment * nuisances, (segment + 1) * nuisances)
            own[columns, columns] += block.normal[count:, count:]
        self._inverse = inverse_of(own)
        self._mixed = np.array([block.normal[:count, count:] for block in blocks])
        self._joined = np.concatenate(tuple(self._mixed), axis=-1)
        self._right = np.concatenate([block.right[count:] for block in blocks])
        self._shape = (segments, nuisances)
        model_right = np.concatenate([block.model_right[count:] for block in blocks])
        # With N = [[A, M], [M^T, Q]] the Schur complement of Q is A - M Q^-1 M^T, and the right side b - M Q^-1 c.
        self.normal = self._joined @ self._inverse @ self._joined.T
        self.right = self._joined @ self._inverse @ self._right
        self.model_right = self._joined @ self._inverse @ model_right
        self.squares = float(self._right @ self._inverse @ self._right)

    def scores(self, parameters: Float64) -> Float64:
        """Return (B, P) the part of each segment's right sides that the nuisances explain beside ``parameters``."""
        # Back-substitution: q = Q^-1 (c - M^T p), which takes M q from the right sides.
        fitted = (self._inverse @ (self._right - self._joined.T @ parameters)).reshape(self._shape)
        explained: Float64 = np.einsum("bpq,bq->bp", self._mixed, fitted)
        return explained
