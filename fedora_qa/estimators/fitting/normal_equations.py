"""Whitened normal equations of segments whose noise has a banded covariance, and their sum over all segments."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Float64 = NDArray[np.float64]

_LEAST_INFORMATION: Final = 1e-12
"""Least information of a direction, relative to that of the best determined one, after scaling to a unit diagonal."""


@dataclass(frozen=True, slots=True)
class BlockEquations:
    """Whitened normal equations of one segment of time, for P parameters and the Q nuisances of this segment.

    With residuals r, jacobians J, their noise covariance C and the model's error m:

    Attributes
    ----------
    normal, right
        (P + Q, P + Q) J^T C^-1 J and (P + Q,) J^T C^-1 r. The solution of ``normal @ unknowns = right`` is the
        least-squares estimate of this segment.
    model_right
        (P + Q,) J^T C^-1 m: the change of ``right`` by the known error of the model.
    squares
        r^T C^-1 r: sum of the whitened squared residuals where all unknowns are 0.
    count
        Number of residuals.
    """

    normal: Float64
    right: Float64
    model_right: Float64
    squares: float
    count: int

    def linearised_at(self, parameters: Float64) -> "BlockEquations":
        """Return the equations for unknowns that count from 0.

        With the whitened residuals r' = r - J p: ``J^T r = J^T r' + N p`` and
        ``r^T r = r'^T r' + p^T (2 J^T r' + N p)``.

        Parameters
        ----------
        parameters
            (P,) values p that were subtracted from the residuals.

        Returns
        -------
        BlockEquations
            Of the residuals r from which nothing is subtracted.
        """
        shift = self.normal[:, : len(parameters)] @ parameters
        # p^T (2 J^T r' + N p), docstring above: ``right`` is J^T r', ``shift`` is N p.
        squares = self.squares + parameters @ (2 * self.right + shift)[: len(parameters)]
        return replace(self, right=self.right + shift, squares=float(squares))


def block_equations(
    residuals: Float64, jacobians: Float64, covariance_bands: Float64, model_errors: Float64
) -> BlockEquations:
    """Whiten the rows of one segment and sum their normal equations.

    Parameters
    ----------
    residuals, model_errors
        (n, 3) residuals of n rows on three axes where all unknowns are 0, and bounds of the model's own error, in one
        unit.
    jacobians
        (n, 3, P + Q): ``residuals = jacobians @ unknowns + noise``. The Q nuisances of the segment come last.
    covariance_bands
        (3, u + 1, n) covariance of the noise between rows on each axis, with u bands beside the diagonal, in the upper
        form of ``scipy.linalg.solveh_banded``. Noise of different axes is independent.

    Returns
    -------
    BlockEquations
        Of P + Q unknowns.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is not positive definite.
    """
    columns = jacobians.shape[-1]
    stacked = np.concatenate((jacobians, residuals[..., None], model_errors[..., None]), axis=-1)
    whitened = np.stack([solveh_banded(bands, stacked[:, axis]) for axis, bands in enumerate(covariance_bands)], axis=1)
    # gram = [J r m]^T C^-1 [J r m]: it holds the normal matrix, both right sides and the squares.
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


def inverse_of(normal: Float64) -> Float64:
    """Return the inverse of a matrix of normal equations.

    Directions with less than 1e-12 of the largest information are below the rounding error; they get this information.

    Parameters
    ----------
    normal
        (P, P) symmetric, with a positive diagonal.

    Returns
    -------
    Float64
        (P, P).
    """
    # D^-1 V diag(1 / lambda) V^T D^-1, with D^2 the diagonal and V, lambda the eigenvectors of D^-1 N D^-1.
    scale = np.sqrt(np.diagonal(normal))
    scales = scale[:, None] * scale
    information, directions = np.linalg.eigh(normal / scales)
    bounded = np.maximum(information, _LEAST_INFORMATION * information[-1])
    inverse: Float64 = (directions / bounded) @ directions.T / scales
    return inverse


class SummedEquations:
    """Sums of normal equations over B segments for P parameters, with the nuisances of the segments eliminated.

    Parameters
    ----------
    blocks
        The normal equations of the segments.
    count
        Number P of parameters; the unknowns after them are nuisances of the segment.
    nuisance_covariance
        (B, B) prior covariance of a nuisance between segments; None where there are no nuisances.

    Attributes
    ----------
    normals, model_rights
        (B, P, P) and (B, P) of each segment, with its nuisances at 0.
    normal, right, model_right
        (P, P), (P,) and (P,) of all segments, with the nuisances eliminated.
    squares
        Sum of the whitened squared residuals, less what the nuisances explain.
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
        """Return the right sides of each segment at given parameters, with the nuisances fitted beside them.

        Parameters
        ----------
        values
            (P,) parameters.

        Returns
        -------
        Float64
            (B, P).
        """
        # s_b = b_b - N_b p
        scores: Float64 = self._rights - self.normals @ values
        return scores if self._nuisances is None else scores - self._nuisances.scores(values)


class SegmentNuisances:
    """Nuisances of B segments, correlated between segments by their prior, eliminated from the equations.

    Parameters
    ----------
    blocks
        The normal equations of the segments.
    count
        Number P of parameters; all unknowns after them are nuisances.
    covariance
        (B, B) prior covariance of a nuisance between segments. It holds for each nuisance of a segment; different
        nuisances are independent.

    Attributes
    ----------
    normal, right, model_right, squares
        (P, P), (P,), (P,) and a number: the terms that the elimination subtracts from the parameters' equations (Schur
        complement).
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
        """Return the part of each segment's right sides that the nuisances explain beside given parameters.

        Parameters
        ----------
        parameters
            (P,) values.

        Returns
        -------
        Float64
            (B, P).
        """
        # Back-substitution: q = Q^-1 (c - M^T p); M q is the explained part of the right sides.
        fitted = (self._inverse @ (self._right - self._joined.T @ parameters)).reshape(self._shape)
        explained: Float64 = np.einsum("bpq,bq->bp", self._mixed, fitted)
        return explained
