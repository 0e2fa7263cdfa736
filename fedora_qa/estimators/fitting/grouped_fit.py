"""Linear fits of groups of parameters to residuals with banded covariance.

Few parameters are free at a time: a group (a bias, a time offset) is freed only where it explains the residuals far
beyond chance (forward selection). Every other parameter is tested alone beside those. So a clean recording gives the
smallest errors, parameters that the motion cannot separate dilute nothing, and one fault moves one group.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.normal_equations import BlockEquations, SummedEquations, inverse_of
from fedora_qa.estimators.fitting.tails import chi_squared_beyond

Float64 = NDArray[np.float64]

SELECTION_TAIL: Final = 1e-9
"""Probability that chance alone frees a group: beyond six standard errors, below the false-alarm rate of a file."""

FEWEST_SEGMENTS: Final = 4
"""Fewer segments do not determine their spread."""

SPREAD_TAIL: Final = 0.01
"""Probability that chance alone widens an error. The spread of few segments is itself uncertain: to add all of it that
exceeds the formal error would make correct errors a quarter too large with four segments, a tenth with eight."""

_SCATTER_IN_SCORE: Final = 3.0
"""Variance of a score beyond the information, in units of the information N that noise in the regressors feigns. The
score has S of the motion, at most 2 N of noise (the square of one Gaussian varies twice as the product of two), and at
most 2 N of what was measured to take its mean off; information has S + N."""


@dataclass(frozen=True, slots=True)
class FitParameters:
    """Names of the P parameters, their groups, and the largest value that is conceivable.

    The largest value enters as a weak prior: where the data do not determine a parameter, its error is that large.
    """

    names: tuple[str, ...]
    groups: Mapping[str, tuple[int, ...]]
    largest: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One parameter of a fit.

    Attributes
    ----------
    standard_error
        The formal error, scaled by a misfit above 1, and widened where the spread over segments exceeds it beyond
        chance.
    model_error
        What the known error of the model can have added.
    free
        Whether its group was freed: it explains the residuals far beyond chance.
    explained
        Share (0 to 1) that each rival group explains on its own. For rivals freed before this group it is the share of
        all that can be explained; for the others, where this group is free, the share of what those leave unexplained.
    """

    value: float
    standard_error: float
    model_error: float
    free: bool
    explained: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class SegmentDeviations:
    """Deviations of one parameter in single segments, alone, beside the fit of all.

    Attributes
    ----------
    deviations, standard_errors, model_errors
        (B,) from its fitted value, in each segment.
    """

    deviations: Float64
    standard_errors: Float64
    model_errors: Float64


def group_of(name: str) -> str:
    """Return the group that a parameter belongs to: ``bias_x`` to ``bias``."""
    return name[:-2] if name.endswith(("_x", "_y", "_z")) else name


class GroupedFit:
    """A fit of grouped parameters to many segments.

    Parameters
    ----------
    blocks
        The segments.
    linearised_at
        (P,) values already subtracted from the samples; fitted values count from 0 nevertheless.
    nuisance_covariance
        (B, B) prior covariance of a nuisance between the B segments, the Q nuisances alike and independent. None: no
        nuisances.
    scatters
        The same segments with residuals and jacobians as noise alone makes them (``sequence_fit.with_scatter``). Their
        scores are subtracted, and their information is not counted.
    """

    def __init__(
        self,
        blocks: Sequence[BlockEquations],
        parameters: FitParameters,
        linearised_at: Float64,
        nuisance_covariance: Float64 | None = None,
        scatters: Sequence[BlockEquations] | None = None,
    ) -> None:
        self.parameters = parameters
        count = len(parameters.names)
        # Weak prior N(0, largest^2): its inverse variance keeps the normal matrix regular and bounds every error.
        self._prior = np.diag(1.0 / np.square(parameters.largest))
        shifted = [block.linearised_at(linearised_at) for block in blocks]
        self._linearised_at = linearised_at
        self._sums = SummedEquations(shifted, count, nuisance_covariance)
        self._scatter_sums = None if scatters is None else SummedEquations(scatters, count, nuisance_covariance)
        self._normal = self._sums.normal + self._prior
        self._right = self._sums.right - (0.0 if self._scatter_sums is None else self._scatter_sums.right)
        self._score_covariance = self._normal + _SCATTER_IN_SCORE * self._scatter_normal
        explained = float(self._sums.right @ inverse_of(self._normal) @ self._sums.right)
        rows = sum(block.count for block in shifted)
        # Squares less what all parameters explain, over the degrees of freedom.
        self.misfit = float(np.sqrt(max(self._sums.squares - explained, 0.0) / max(rows - count, 1)))
        """Root mean square of whitened residuals after all parameters are fitted; 1 where the noise model is right."""
        self.free, self._explained = self._select()

    def fitted(self) -> dict[str, ParameterEstimate]:
        """Return every parameter by name: freed groups fitted together, every other group alone beside them."""
        fitted: dict[str, ParameterEstimate] = {}
        for group in self.parameters.groups:
            columns = self._columns((*self.free, group) if group not in self.free else self.free)
            inverse = inverse_of(self._normal[np.ix_(columns, columns)])
            values = inverse @ self._right[columns]
            errors = self._standard_errors(columns, inverse, values)
            # The variance of each by noise in the regressors, over that of all: the share of information of noise.
            noise = np.diag(inverse @ self._scatter_normal[np.ix_(columns, columns)] @ inverse) / np.diag(inverse)
            attenuation = _attenuation(noise, errors / np.array(self.parameters.largest)[columns])
            # Only the part beyond the linearisation is attenuated: the rest was subtracted from the samples exactly.
            values = self._linearised_at[columns] + (values - self._linearised_at[columns]) / attenuation
            model_errors = np.abs(inverse @ self._sums.model_right[columns]) / attenuation
            errors = errors / attenuation
            for column in self.parameters.groups[group]:
                row = columns.index(column)
                fitted[self.parameters.names[column]] = ParameterEstimate(
                    float(values[row]), float(errors[row]), float(model_errors[row]),
                    group in self.free, self._explained[group],
                )  # fmt: skip
        return fitted

    def values_of_free(self) -> Float64:
        """Return (P,) the values of the freed parameters fitted together, 0 for all others."""
        values = np.zeros(len(self.parameters.names))
        columns = self._columns(self.free)
        if columns:
            values[columns] = inverse_of(self._normal[np.ix_(columns, columns)]) @ self._right[columns]
        return values

    def values_of_all(self) -> Float64:
        """Return (P,) the values of all parameters fitted together."""
        values: Float64 = inverse_of(self._normal) @ self._right
        return values

    def local(self, name: str) -> SegmentDeviations:
        """Return by how much a parameter deviates in each segment from the freed parameters' fit."""
        column, values = self.parameters.names.index(name), self.values_of_free()
        # Segments are whitened alone, so that a segment's score J^T C^-1 r has the variance J^T C^-1 J.
        scores = self._scores(values)[:, column]
        information = self._sums.normals[:, column, column] + self._prior[column, column]
        noise = np.zeros(len(scores)) if self._scatter_sums is None else self._scatter_sums.normals[:, column, column]
        # Deviation = score / information; its error follows from the variance of the score, noise included.
        errors = max(1.0, self.misfit) * np.sqrt(information + _SCATTER_IN_SCORE * noise) / information
        attenuation = _attenuation(noise / information, errors / self.parameters.largest[column])
        return SegmentDeviations(
            deviations=scores / information / attenuation,
            standard_errors=errors / attenuation,
            model_errors=np.abs(self._sums.model_rights[:, column]) / information / attenuation,
        )

    @property
    def _scatter_normal(self) -> Float64:
        return np.zeros_like(self._normal) if self._scatter_sums is None else self._scatter_sums.normal

    def _scores(self, values: Float64) -> Float64:
        """Return (B, P) the segments' scores beside ``values``, without those of noise alone."""
        scores = self._sums.scores(values)
        return scores if self._scatter_sums is None else scores - self._scatter_sums.scores(np.zeros_like(values))

    def _columns(self, groups: Sequence[str]) -> list[int]:
        return [column for group in groups for column in self.parameters.groups[group]]

    def _explains(self, groups: Sequence[str]) -> float:
        """Return by how much the sum of squares falls when the groups are free."""
        columns = self._columns(groups)
        if not columns:
            return 0.0
        right = self._right[columns]
        # Score statistic s^T V^-1 s with V the covariance of the score (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948).
        return float(right @ inverse_of(self._score_covariance[np.ix_(columns, columns)]) @ right)

    def _select(self) -> tuple[tuple[str, ...], dict[str, dict[str, float]]]:
        """Free groups, the one that explains most first, while that is far beyond chance.

        Gains are measured in units of the misfit of the full fit, so that noise above its declaration frees nothing.
        """
        unit = max(1.0, self.misfit**2)
        free: tuple[str, ...] = ()
        explained: dict[str, dict[str, float]] = {}
        everything = self._explains(tuple(self.parameters.groups))
        # A fault that does not last throughout leaves to others what its group, freed before, cannot describe.
        alone = {
            g: float(np.clip(self._explains((g,)) / (everything or 1.0), 0.0, 1.0)) for g in self.parameters.groups
        }
        while len(free) < len(self.parameters.groups):
            base = self._explains(free)
            gains = {g: (self._explains((*free, g)) - base) / unit for g in self.parameters.groups if g not in free}
            # Under chance alone a gain follows chi squared with the group's parameter count (S. S. Wilks 1938).
            excess = {
                g: gain / chi_squared_beyond(SELECTION_TAIL, len(self.parameters.groups[g]))
                for g, gain in gains.items()
            }
            if max(excess.values()) < 1.0:
                break
            best = max(gains, key=lambda g: gains[g] - 2.0 * len(self.parameters.groups[g]))  # Akaike's penalty
            unexplained = max((everything - base) / unit, gains[best])
            explained[best] = {g: float(np.clip(gain / unexplained, 0.0, 1.0)) for g, gain in gains.items()}
            explained[best] |= {g: alone[g] for g in free}
            free = (*free, best)
        return free, {g: explained.get(g, {rival: alone[rival] for rival in free}) for g in self.parameters.groups}

    def _standard_errors(self, columns: list[int], inverse: Float64, values: Float64) -> Float64:
        """Return the formal error scaled by the misfit, and the spread over segments where that is beyond chance.

        The spread is that about the nuisances as fitted: their own uncertainty is in the formal error alone.
        """
        root = _root(self._score_covariance[np.ix_(columns, columns)])
        formal = np.sum((inverse @ root) ** 2, axis=1) * max(1.0, self.misfit) ** 2
        segments = len(self._sums.normals)
        if segments < FEWEST_SEGMENTS:
            return np.asarray(np.sqrt(formal))
        all_values = np.zeros(len(self.parameters.names))
        all_values[columns] = values
        scores = self._scores(all_values)
        scores = (scores - scores.mean(axis=0))[:, columns]
        own_normal = (self._sums.normals.sum(axis=0) + self._prior)[np.ix_(columns, columns)]
        own, noise = inverse_of(own_normal), _SCATTER_IN_SCORE * self._scatter_normal[np.ix_(columns, columns)]
        # Sandwich estimate N^-1 (sum_b s_b s_b^T) N^-1 of the covariance, with the correction B / (B - 1).
        spread = np.sum((own @ scores.T) ** 2, axis=1) * segments / (segments - 1)
        expected = np.sum((own @ _root(own_normal + noise)) ** 2, axis=1) * max(1.0, self.misfit) ** 2
        # The scatter of B segments over its expectation is chi squared / (B - 1) with B - 1 degrees of freedom.
        by_chance = chi_squared_beyond(SPREAD_TAIL, segments - 1) / (segments - 1)
        errors: Float64 = np.sqrt(formal + np.where(spread > by_chance * expected, spread - expected, 0.0))
        return errors


def _attenuation(noise_shares: Float64, relative_errors: Float64) -> Float64:
    """Return the share of information due to motion, bounded so that no error exceeds the largest conceivable value.

    Noise in a regressor draws a fitted value towards 0 by that share, and its error with it (W. Fuller, Measurement
    Error Models, Wiley 1987, section 1.1).
    """
    shares: Float64 = np.maximum(1.0 - noise_shares, np.minimum(relative_errors, 1.0))
    return shares


def _root(covariance: Float64) -> Float64:
    """Return R (n, n) with R R^T the covariance (n, n): no sum of squares is negative, even of collinear parameters."""
    scales = np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
    # Eigenvalues, not Cholesky's factors: rounding may leave some slightly below 0.
    values, vectors = np.linalg.eigh(covariance / np.outer(scales, scales))
    root: Float64 = scales[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root
