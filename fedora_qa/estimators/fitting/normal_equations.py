"""Whitened normal equations of segments whose noise has a banded covariance, and their sum over all segments."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded, solveh_banded

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


@dataclass(frozen=True, slots=True)
class MarkovNoise:
    """Noise of n rows by a disturbance of k components whose value at a row depends on those at its neighbours alone.

    Attributes
    ----------
    jacobians
        (n, 3, k) derivatives of the residuals of each row by its disturbance.
    information
        (2, n) inverse of the covariance of each component between rows, as bands in the upper form of
        ``scipy.linalg.solveh_banded``. Components are independent and alike.
    deficits
        (n, 3) by which the noise of a residual varies less than so, in its unit squared, independently of other rows.
    """

    jacobians: Float64
    information: Float64
    deficits: Float64


def block_equations(
    residuals: Float64,
    jacobians: Float64,
    covariance_bands: Float64,
    model_errors: Float64,
    markov: MarkovNoise | None = None,
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
    markov
        Further noise, which mixes the axes.

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
    if markov is None:
        of_axes = [solveh_banded(bands, stacked[:, axis]) for axis, bands in enumerate(covariance_bands)]
        whitened = np.stack(of_axes, axis=1)
    else:
        whitened = _whitened(stacked, covariance_bands, markov)
    # gram = [J r m]^T C^-1 [J r m]: it holds the normal matrix, both right sides and the squares.
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


def markov_squares(covariance_bands: Float64, markov: MarkovNoise) -> float:
    """Return the expected whitened squares of the disturbance alone, ``tr (C + N)^-1 N`` with ``N = A M A^T - D``.

    That is how many of the 3 n residuals are noise of the disturbance rather than of the rows.

    Parameters
    ----------
    covariance_bands, markov
        As of ``block_equations``.

    Returns
    -------
    float
        0 to 3 n.

    Sources
    -------
    M. Hutchinson, Comm. Statistics Simulation 19 (1990) 433: the trace of B is the mean of v^T B v over random signs v.
    """
    rows = covariance_bands.shape[2]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(rows, 3))
    whitened = _whitened(signs[..., None], covariance_bands, markov)[..., 0]
    # tr (C + N)^-1 N = 3 n - tr (C + N)^-1 C.
    squares = float(signs.size)
    upper = covariance_bands.shape[1] - 1
    for lag in range(upper + 1):
        products = signs[lag:] * whitened[: rows - lag]
        if lag > 0:
            products = products + signs[: rows - lag] * whitened[lag:]
        squares -= float(np.sum(covariance_bands[:, upper - lag, lag:].T * products))
    return max(squares, 0.0)


def _whitened(values: Float64, covariance_bands: Float64, markov: MarkovNoise) -> Float64:
    """Return ``(C + A M A^T - D)^-1 y`` of values y (n, 3, c).

    A are the jacobians of the disturbance, M is its covariance, D the diagonal of the deficits. With ``z = M A^T x``
    the solution x of ``(C + A M A^T - D) x = y`` is that of the banded system

        [ C - D  A     ] [x]   [y]
        [ A^T    -M^-1 ] [z] = [0],

    whose unknowns are taken row by row: three of x, then k of z.
    """
    rows, components = len(values), markov.jacobians.shape[-1]
    size, upper = 3 + components, covariance_bands.shape[1] - 1
    reach = size * max(upper, 1)
    # Residuals in units of their sigma, so that all pivots are of similar size.
    sigmas = np.sqrt(covariance_bands[:, -1].T)
    # Element (i, j) of the matrix is bands[reach + i - j, j].
    bands = np.zeros((2 * reach + 1, rows * size))
    for axis, of_axis in enumerate(covariance_bands):
        for lag in range(upper + 1):
            scaled = of_axis[upper - lag, lag:] / (sigmas[lag:, axis] * sigmas[: rows - lag, axis])
            bands[reach - size * lag, axis + size * lag :: size] = scaled
            bands[reach + size * lag, axis : size * (rows - lag) : size] = scaled
        bands[reach, axis::size] -= markov.deficits[:, axis] / np.square(sigmas[:, axis])
        for component in range(components):
            scaled, apart = markov.jacobians[:, axis, component] / sigmas[:, axis], 3 + component - axis
            bands[reach - apart, 3 + component :: size] = scaled
            bands[reach + apart, axis::size] = scaled
    for component in range(3, size):
        bands[reach, component::size] = -markov.information[1]
        bands[reach - size, component + size :: size] = -markov.information[0, 1:]
        bands[reach + size, component : size * (rows - 1) : size] = -markov.information[0, 1:]
    right = np.zeros((rows, size, values.shape[-1]))
    right[:, :3] = values / sigmas[..., None]
    solved = solve_banded((reach, reach), bands, right.reshape(rows * size, -1), overwrite_ab=True, overwrite_b=True)
    whitened: Float64 = solved.reshape(right.shape)[:, :3] / sigmas[..., None]
    return whitened


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
        Prior covariance of the nuisances, as of ``SegmentNuisances``; None where there are none.

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

    def nuisances(self, values: Float64) -> Float64:
        """Return the nuisances (B, Q) that fit best beside given parameters (P,); (B, 0) where there are none."""
        return np.empty((len(self.normals), 0)) if self._nuisances is None else self._nuisances.values(values)


class SegmentNuisances:
    """Nuisances of B segments, correlated between segments by their prior, eliminated from the equations.

    Parameters
    ----------
    blocks
        The normal equations of the segments.
    count
        Number P of parameters; all unknowns after them are nuisances.
    covariance
        (B m, B m) prior covariance of m nuisances of each segment, segment by segment. It holds for each component of
        them: the Q nuisances of a segment are m vectors of Q / m components, and different components are independent.

    Attributes
    ----------
    normal, right, model_right, squares
        (P, P), (P,), (P,) and a number: the terms that the elimination subtracts from the parameters' equations (Schur
        complement).
    """

    def __init__(self, blocks: Sequence[BlockEquations], count: int, covariance: Float64) -> None:
        segments, nuisances = len(blocks), len(blocks[0].right) - count
        # Prior information of the nuisances: C^-1 between them, their components independent.
        own = np.kron(np.linalg.inv(covariance), np.eye(segments * nuisances // len(covariance)))
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
        # M q is the explained part of the right sides.
        explained: Float64 = np.einsum("bpq,bq->bp", self._mixed, self.values(parameters))
        return explained

    def values(self, parameters: Float64) -> Float64:
        """Return the nuisances (B, Q) that fit best beside given parameters.

        Parameters
        ----------
        parameters
            (P,) values.
        """
        # Back-substitution: q = Q^-1 (c - M^T p).
        values: Float64 = (self._inverse @ (self._right - self._joined.T @ parameters)).reshape(self._shape)
        return values
