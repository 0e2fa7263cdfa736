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

_LEAST_INFORMATION: Final = 1e-12
"""Of a direction, in units of the best known one, after scaling to unit diagonal."""

FEWEST_BLOCKS: Final = 4
"""Fewer blocks say nothing about their spread."""


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


def _inverse(normal: Float64) -> Float64:
    """Invert normal equations. Directions that rounding cannot tell from unknown get the least information it can."""
    scale = np.sqrt(np.diag(normal))
    information, directions = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = np.maximum(information, _LEAST_INFORMATION * information[-1])
    inverse: Float64 = (directions / kept) @ directions.T / np.outer(scale, scale)
    return inverse


def group_of(name: str) -> str:
    """Return the group that a parameter belongs to: ``bias_x`` to ``bias``."""
    return name[:-2] if name.endswith(("_x", "_y", "_z")) else name


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
        (u + 1, n) covariance of the noise over rows, alike on each axis, in the upper form of
        ``scipy.linalg.solveh_banded``.
    """
    count, columns = len(residuals), jacobians.shape[-1]
    stacked = np.concatenate((jacobians, residuals[..., None], model_errors[..., None]), axis=-1)
    whitened = solveh_banded(covariance_bands, stacked.reshape(count, -1)).reshape(stacked.shape)
    gram = np.einsum("nai,naj->ij", stacked, whitened)
    return BlockEquations(
        normal=gram[:columns, :columns],
        right=gram[:columns, columns],
        model_right=gram[:columns, columns + 1],
        squares=float(gram[columns, columns]),
        count=residuals.size,
    )


class GroupedFit:
    """A fit of grouped parameters to many stretches.

    Parameters
    ----------
    blocks
        The stretches.
    linearised_at
        (P,) what has already been taken out of the samples; values count from 0 all the same.
    nuisance_covariance
        (B, B) prior covariance of a nuisance between the B stretches, the Q nuisances alike and independent. Without
        it there are none.
    """

    def __init__(
        self,
        blocks: Sequence[BlockEquations],
        parameters: Parameters,
        linearised_at: Float64,
        nuisance_covariance: Float64 | None = None,
    ) -> None:
        self.parameters = parameters
        count = len(parameters.names)
        self._normals = np.array([block.normal[:count, :count] for block in blocks])
        rights = np.array([block.right[:count] for block in blocks])
        model_rights = np.array([block.model_right[:count] for block in blocks])
        normal, squares = self._normals.sum(axis=0), sum(block.squares for block in blocks)
        if nuisance_covariance is not None:
            lost = _eliminated(blocks, count, nuisance_covariance)
            normal, squares = normal - lost.normal, squares - lost.squares
            rights, model_rights = rights - lost.rights, model_rights - lost.model_rights
        self._rights = rights + self._normals @ linearised_at
        self._model_right = model_rights.sum(axis=0)
        self._normal = normal + np.diag(1.0 / np.square(parameters.largest))
        right = rights.sum(axis=0)
        self._right = right + normal @ linearised_at
        misfit = squares - right @ _inverse(self._normal) @ right
        rows = sum(block.count for block in blocks)
        self.misfit = float(np.sqrt(max(misfit, 0.0) / max(rows - count, 1)))
        """Root mean square of whitened residuals after all parameters are fitted; 1 where the noise model is right."""
        self.free, self._explained = self._select()

    def fitted(self) -> dict[str, Fitted]:
        """Return every parameter by name: freed groups fitted together, every other group alone beside them."""
        found: dict[str, Fitted] = {}
        for group in self.parameters.groups:
            columns = self._columns((*self.free, group) if group not in self.free else self.free)
            inverse = _inverse(self._normal[np.ix_(columns, columns)])
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
            values[columns] = _inverse(self._normal[np.ix_(columns, columns)]) @ self._right[columns]
        return values

    def values_of_all(self) -> Float64:
        """Return (P,) the values of all parameters fitted together."""
        values: Float64 = _inverse(self._normal) @ self._right
        return values

    def _columns(self, groups: Sequence[str]) -> list[int]:
        return [column for group in groups for column in self.parameters.groups[group]]

    def _explains(self, groups: Sequence[str]) -> float:
        """Return by how much the sum of squares falls when the groups are free."""
        columns = self._columns(groups)
        if not columns:
            return 0.0
        right = self._right[columns]
        return float(right @ _inverse(self._normal[np.ix_(columns, columns)]) @ right)

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
        scores = scores - scores.mean(axis=0)
        spread = inverse @ (scores.T @ scores) @ inverse * blocks / (blocks - 1)
        return np.maximum(formal, np.sqrt(np.maximum(np.diag(spread), 0.0)))


@dataclass(frozen=True, slots=True)
class _Eliminated:
    """What the nuisances take from the parameters' equations; rights by stretch."""

    normal: Float64
    rights: Float64
    model_rights: Float64
    squares: float


def _eliminated(blocks: Sequence[BlockEquations], count: int, covariance: Float64) -> _Eliminated:
    """Return the Schur complement's share of the nuisances, which are correlated between stretches."""
    stretches, nuisances = len(blocks), len(blocks[0].right) - count
    own = np.kron(np.linalg.inv(covariance), np.eye(nuisances))
    for place, block in enumerate(blocks):
        here = slice(place * nuisances, (place + 1) * nuisances)
        own[here, here] += block.normal[count:, count:]
    mixed = np.array([block.normal[:count, count:] for block in blocks])
    right = np.concatenate([block.right[count:] for block in blocks])
    model_right = np.concatenate([block.model_right[count:] for block in blocks])
    solved = np.linalg.solve(own, np.stack((right, model_right), axis=-1)).reshape(stretches, nuisances, 2)
    joined = np.concatenate(tuple(mixed), axis=-1)
    return _Eliminated(
        normal=joined @ np.linalg.solve(own, joined.T),
        rights=np.einsum("bpq,bq->bp", mixed, solved[..., 0]),
        model_rights=np.einsum("bpq,bq->bp", mixed, solved[..., 1]),
        squares=float(right @ solved[..., 0].ravel()),
    )
