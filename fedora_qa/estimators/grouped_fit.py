"""Linear fits of groups of parameters to residuals with banded covariance.

Few parameters are free at a time: a group (a bias, a time offset) is freed only where it explains the residuals far
beyond chance (forward selection). Every other parameter is tested alone beside those. So a clean recording gives the
smallest errors, nothing is diluted by parameters that the motion cannot tell apart, and one fault moves one group.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.stats import chi2

Float64 = NDArray[np.float64]

SELECTION_TAIL: Final = 1e-9
"""Probability that chance alone frees a group: that of six standard errors, below a file's false-alarm rate."""

FEWEST_BLOCKS: Final = 4
"""Fewer blocks say nothing about their spread."""


@dataclass(frozen=True, slots=True)
class BlockEquations:
    """Whitened normal equations of one stretch of time, for all P parameters.

    Attributes
    ----------
    normal, right
        (P, P) and (P,): ``normal @ parameters = right`` is the least-squares solution of the stretch alone.
    model_right
        (P,) what the known error of the model adds to ``right``.
    squares, count
        Sum of whitened squared residuals at parameters 0, and how many there are.
    """

    normal: Float64
    right: Float64
    model_right: Float64
    squares: float
    count: int


@dataclass(frozen=True, slots=True)
class Parameters:
    """Names of the P parameters, their groups, and the largest value that is conceivable.

    The largest value enters as a weak prior: where the data say nothing, the error is as large as it.
    """

    names: tuple[str, ...]
    groups: Mapping[str, tuple[int, ...]]
    largest: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Fitted:
    """One parameter as fitted.

    Attributes
    ----------
    standard_error
        The largest of the formal error, the formal error scaled by the misfit, and the spread over blocks.
    model_error
        What the known error of the model can have added.
    free
        Whether its group was freed: it explains the residuals far beyond chance.
    explained
        For each group, which share (0 to 1) of all that can be explained it explains on its own.
    """

    value: float
    standard_error: float
    model_error: float
    free: bool
    explained: Mapping[str, float]


def block_equations(
    residuals: Float64,
    jacobians: Float64,
    covariance_bands: Float64,
    model_errors: Float64,
    nuisances: Float64 | None = None,
    nuisance_variance: float = 0.0,
) -> BlockEquations:
    """Whiten one stretch of rows and sum its normal equations.

    Parameters
    ----------
    residuals, model_errors
        (n, 3): what is left without parameters, and a bound on the model's own error.
    jacobians
        (n, 3, P): ``residuals = jacobians @ parameters + noise``.
    covariance_bands
        (u + 1, n) covariance of the noise over rows, alike on each axis, in the upper form of
        ``scipy.linalg.solveh_banded``.
    nuisances
        (n, 3, Q) derivatives by parameters of this stretch alone, of prior variance ``nuisance_variance``; they are
        eliminated.
    """
    count, columns = len(residuals), jacobians.shape[-1]
    stacked = np.concatenate((jacobians, residuals[..., None], model_errors[..., None]), axis=-1)
    if nuisances is not None:
        stacked = np.concatenate((stacked, nuisances), axis=-1)
    whitened = solveh_banded(covariance_bands, stacked.reshape(count, -1)).reshape(stacked.shape)
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    if nuisances is not None:
        gram = _eliminate(gram, nuisances.shape[-1], nuisance_variance)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


def _eliminate(gram: Float64, count: int, variance: float) -> Float64:
    """Return the Schur complement of the last ``count`` columns, which have a prior variance."""
    kept, mixed = gram[:-count, :-count], gram[:-count, -count:]
    own = gram[-count:, -count:] + np.eye(count) / variance
    schur: Float64 = kept - mixed @ np.linalg.solve(own, mixed.T)
    return schur


class GroupedFit:
    """A fit of grouped parameters to many stretches."""

    def __init__(
        self, blocks: Sequence[BlockEquations], parameters: Parameters, linearised_at: Float64 | None = None
    ) -> None:
        at = np.zeros(len(parameters.names)) if linearised_at is None else linearised_at
        self.parameters = parameters
        self._normals = np.array([block.normal for block in blocks])
        self._rights = np.array([block.right + block.normal @ at for block in blocks])
        self._normal = self._normals.sum(axis=0) + np.diag(1.0 / np.square(parameters.largest))
        self._right = self._rights.sum(axis=0)
        self._model_right = np.sum([block.model_right for block in blocks], axis=0)
        count = sum(block.count for block in blocks)
        squares = sum(block.squares for block in blocks)
        right_here = self._right - self._normals.sum(axis=0) @ at
        misfit = squares - right_here @ np.linalg.solve(self._normal, right_here)
        self.misfit = float(np.sqrt(max(misfit, 0.0) / max(count - len(at), 1)))
        """Root mean square of whitened residuals after all parameters are fitted; 1 where the noise model is right."""
        self.free, self._explained = self._select()

    def fitted(self) -> dict[str, Fitted]:
        """Return every parameter by name: freed groups fitted together, every other group alone beside them."""
        found: dict[str, Fitted] = {}
        for group in self.parameters.groups:
            columns = self._columns((*self.free, group) if group not in self.free else self.free)
            inverse = np.linalg.inv(self._normal[np.ix_(columns, columns)])
            values = inverse @ self._right[columns]
            model_errors = np.abs(inverse @ self._model_right[columns])
            errors = self._standard_errors(columns, inverse, values)
            for column in self.parameters.groups[group]:
                place = columns.index(column)
                found[self.parameters.names[column]] = Fitted(
                    float(values[place]), float(errors[place]), float(model_errors[place]),
                    group in self.free, self._explained.get(group, {}),
                )  # fmt: skip
        return found

    def values_of_free(self) -> Float64:
        """Return (P,) the values of the freed parameters fitted together, 0 for all others."""
        values = np.zeros(len(self.parameters.names))
        columns = self._columns(self.free)
        if columns:
            values[columns] = np.linalg.solve(self._normal[np.ix_(columns, columns)], self._right[columns])
        return values

    def values_of_all(self) -> Float64:
        """Return (P,) the values of all parameters fitted together."""
        values: Float64 = np.linalg.solve(self._normal, self._right)
        return values

    def _columns(self, groups: Sequence[str]) -> list[int]:
        return [column for group in groups for column in self.parameters.groups[group]]

    def _explains(self, groups: Sequence[str]) -> float:
        """Return by how much the sum of squares falls when the groups are free."""
        columns = self._columns(groups)
        if not columns:
            return 0.0
        right = self._right[columns]
        return float(right @ np.linalg.solve(self._normal[np.ix_(columns, columns)], right))

    def _select(self) -> tuple[tuple[str, ...], dict[str, dict[str, float]]]:
        """Free groups, the one that explains most first, while that is far beyond chance.

        Gains are measured in units of the misfit of the full fit, so that noise above its declaration frees nothing.
        """
        unit = max(1.0, self.misfit**2)
        free: tuple[str, ...] = ()
        explained: dict[str, dict[str, float]] = {}
        everything = self._explains(tuple(self.parameters.groups))
        while len(free) < len(self.parameters.groups):
            base = self._explains(free)
            gains = {g: (self._explains((*free, g)) - base) / unit for g in self.parameters.groups if g not in free}
            excess = {g: gain / chi2.isf(SELECTION_TAIL, len(self.parameters.groups[g])) for g, gain in gains.items()}
            if max(excess.values()) < 1.0:
                break
            best = max(gains, key=lambda g: gains[g] - 2.0 * len(self.parameters.groups[g]))  # Akaike's penalty
            left = max((everything - base) / unit, gains[best])
            explained[best] = {g: float(np.clip(gain / left, 0.0, 1.0)) for g, gain in gains.items()}
            free = (*free, best)
        return free, explained

    def _standard_errors(self, columns: list[int], inverse: Float64, values: Float64) -> Float64:
        formal = np.sqrt(np.diag(inverse)) * max(1.0, self.misfit)
        blocks = len(self._rights)
        if blocks < FEWEST_BLOCKS:
            return formal
        scores = self._rights[:, columns] - self._normals[:, columns][:, :, columns] @ values
        spread = inverse @ (scores.T @ scores) @ inverse * blocks / (blocks - 1)
        return np.maximum(formal, np.sqrt(np.diag(spread)))
