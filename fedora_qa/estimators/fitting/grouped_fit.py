"""Linear fits of groups of parameters to residuals with banded covariance.

Few parameters are free at a time. A group of parameters (a bias, a time offset) is freed only where it reduces the
residuals far more than chance does (forward selection). Every other group is fitted alone beside the freed ones. A
correct recording then gives the smallest errors, parameters that the motion cannot separate do not widen each other's
errors, and one fault changes one group.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.normal_equations import BlockEquations, SummedEquations, inverse_of
from fedora_qa.estimators.fitting.robust import DETECTION_SIGMAS
from fedora_qa.estimators.fitting.tails import chi_squared_beyond

Float64 = NDArray[np.float64]

SELECTION_TAIL: Final = 1e-9
"""Probability that chance alone frees a group: about six standard errors, far below the false-alarm rate of a file."""

FEWEST_SEGMENTS: Final = 4
"""Least number of segments whose scatter is used. The scatter of fewer segments is too uncertain."""

SPREAD_TAIL: Final = 0.01
"""Probability that chance alone widens an error. The scatter of few segments is itself uncertain. If every excess over
the formal error were added, correct errors would be a quarter too large with four segments, and a tenth with eight."""

_SCATTER_IN_SCORE: Final = 3.0
"""Variance of a score beyond the information, in units of N, the information that noise in the regressors adds. The
variance of the score is the sum of S from the motion, at most 2 N from the noise (the square of a Gaussian has twice
the variance of the product of two), and at most 2 N from the estimate of the noise that is subtracted. The information
is S + N, so that the excess is at most 3 N."""


@dataclass(frozen=True, slots=True)
class FitParameters:
    """Names, groups and largest values of the P parameters of a fit.

    Attributes
    ----------
    names
        P names, in the order of the columns.
    groups
        Columns of the parameters of each group, by the name of the group.
    largest
        P largest conceivable absolute values, in the units of the parameters. Each is the standard deviation of a weak
        prior about 0: where the data do not determine a parameter, its standard error is that large.
    useful
        P detection limits above which a parameter is of no use, in the units of the parameters: the ``blind_from`` of
        its row in the table of material sizes.
    """

    names: tuple[str, ...]
    groups: Mapping[str, tuple[int, ...]]
    largest: tuple[float, ...]
    useful: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One parameter of a fit.

    Attributes
    ----------
    value
        The fitted value, in the unit of the parameter.
    standard_error
        The formal error, scaled by a misfit above 1, and widened where the scatter of the segments exceeds it by more
        than chance.
    model_error
        Largest part of the value that the error of the model can cause, in the unit of the parameter: its known error,
        or all of the value where ``determined`` is false.
    determined
        Whether the value measures the parameter. It does not where the noise alone would allow a useful detection
        limit and the fit does not: residuals that no parameter explains, spread over nearly collinear parameters, then
        give values of any size.
    free
        Whether the group of the parameter was freed: the group reduces the residuals far more than chance does.
    explained
        Share (0 to 1) of the residual squares that each rival group explains alone, by the name of the group. For
        rivals freed before this group it is the share of all that the parameters can explain. For other rivals, where
        this group is free, it is the share of what the groups freed before leave unexplained.
    instead
        Of a freed group: values of each group that was not freed, fitted in its place beside the other freed ones, by
        the name of the group. Beside this group, a rival that explains the same has any value.
    """

    value: float
    standard_error: float
    model_error: float
    determined: bool
    free: bool
    explained: Mapping[str, float]
    instead: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SegmentDeviations:
    """Deviations of one parameter in each of B segments from the fit of all segments.

    Attributes
    ----------
    deviations
        (B,) value in the segment less the value of the fit, in the unit of the parameter. Only this parameter is fitted
        to the segment.
    standard_errors
        (B,) standard errors of the deviations.
    model_errors
        (B,) largest parts of the deviations that the known error of the model can cause.
    """

    deviations: Float64
    standard_errors: Float64
    model_errors: Float64


def group_of(name: str) -> str:
    """Return the group that a parameter belongs to: ``bias`` for ``bias_x``."""
    return name[:-2] if name.endswith(("_x", "_y", "_z")) else name


class GroupedFit:
    """A fit of grouped parameters to many segments.

    Parameters
    ----------
    blocks
        The normal equations of the B segments.
    parameters
        Names, groups and largest values of the P parameters.
    linearised_at
        (P,) values that were subtracted from the samples before they were linearised. Fitted values count from 0, not
        from these values.
    nuisance_covariance
        Prior covariance of the nuisances, as of ``SegmentNuisances``; None where there are none.
    scatters
        The same segments with the residuals and jacobians that noise alone causes (``sequence_fit.with_scatter``).
        Their scores are subtracted, and their information is not counted. None where the regressors have no noise.
    barred
        Names of groups that are not freed.
    segment_biases
        (B, b) bounds on an error in each segment that acts as the b parameters of the group ``bias`` do, in their unit;
        signs differ between segments. None where there is none.

    Attributes
    ----------
    parameters
        As given.
    misfit
        Root mean square of the whitened residuals after all parameters are fitted; 1 where the noise model holds.
    free
        Names of the freed groups, in the order in which they were freed.
    """

    def __init__(
        self,
        blocks: Sequence[BlockEquations],
        parameters: FitParameters,
        linearised_at: Float64,
        nuisance_covariance: Float64 | None = None,
        scatters: Sequence[BlockEquations] | None = None,
        barred: Sequence[str] = (),
        segment_biases: Float64 | None = None,
    ) -> None:
        self.parameters = parameters
        self._barred = tuple(barred)
        count = len(parameters.names)
        # Weak prior N(0, largest^2): its inverse variance keeps the normal matrix regular and bounds every error.
        self._prior = np.diag(1.0 / np.square(parameters.largest))
        shifted = [block.linearised_at(linearised_at) for block in blocks]
        self._linearised_at = linearised_at
        self._sums = SummedEquations(shifted, count, nuisance_covariance)
        self._scatter_sums = None if scatters is None else SummedEquations(scatters, count, nuisance_covariance)
        self._normal = self._sums.normal + self._prior
        self._right = self._sums.right - (0.0 if self._scatter_sums is None else self._scatter_sums.right)
        # Changes (B, b, P) of the right side by each bias of each segment, J^T C^-1 J times the bias.
        self._segment_biases = segment_biases
        self._bias_rights = np.zeros((len(blocks), 0, count))
        if segment_biases is not None:
            columns, silent = parameters.groups["bias"], [replace(b, model_right=0 * b.model_right) for b in blocks]
            self._bias_rights = np.zeros((len(blocks), len(columns), count))
            for segment, axis in np.argwhere(segment_biases > 0).tolist():
                biased = list(silent)
                right = segment_biases[segment, axis] * blocks[segment].normal[:, columns[axis]]
                biased[segment] = replace(blocks[segment], model_right=right)
                sums = SummedEquations(biased, count, nuisance_covariance)
                self._bias_rights[segment, axis] = sums.model_right
        self._score_covariance = self._normal + _SCATTER_IN_SCORE * self._scatter_normal
        explained = float(self._sums.right @ inverse_of(self._normal) @ self._sums.right)
        rows = sum(block.count for block in shifted)
        # misfit^2 = (r^T C^-1 r - b^T N^-1 b) / (rows - P): the squares that all P parameters leave unexplained.
        self.misfit = float(np.sqrt(max(self._sums.squares - explained, 0.0) / max(rows - count, 1)))
        """Root mean square of the whitened residuals after all parameters are fitted; 1 where the noise model holds."""
        self.free, self._explained = self._select()

    @cached_property
    def estimates(self) -> Mapping[str, ParameterEstimate]:
        """Of every parameter by name: the freed groups fitted together, every other group alone beside the freed ones.

        Several results need them, and they are fitted once.
        """
        estimates: dict[str, ParameterEstimate] = {}
        for group in self.parameters.groups:
            columns = self._columns((*self.free, group) if group not in self.free else self.free)
            inverse = inverse_of(self._normal[np.ix_(columns, columns)])
            values = inverse @ self._right[columns]
            errors = self._standard_errors(columns, inverse, values)
            # Share of the information that comes from noise: diag(N^-1 N_noise N^-1) / diag(N^-1).
            noise = np.diag(inverse @ self._scatter_normal[np.ix_(columns, columns)] @ inverse) / np.diag(inverse)
            attenuation = _attenuation(noise, errors / np.array(self.parameters.largest)[columns])
            # Only the part beyond the linearisation is attenuated: the rest was subtracted exactly.
            values = self._linearised_at[columns] + (values - self._linearised_at[columns]) / attenuation
            # The known error of the model has one sign; biases of segments and axes may have any.
            by_biases = np.abs(self._bias_rights[..., columns] @ inverse).sum(axis=(0, 1))
            model_errors = (np.abs(inverse @ self._sums.model_right[columns]) + by_biases) / attenuation
            errors = errors / attenuation
            own = self.parameters.groups[group]
            instead = self._instead_of(group) if group in self.free else {}
            for column, nominal_error in zip(own, self._nominal_errors(own), strict=True):
                row = columns.index(column)
                # The detection limit is useful under noise alone, and is not in this fit.
                largest_error = self.parameters.useful[column] / DETECTION_SIGMAS
                determined = not nominal_error <= largest_error < errors[row]
                model_error = model_errors[row] if determined else max(model_errors[row], abs(values[row]))
                estimates[self.parameters.names[column]] = ParameterEstimate(
                    float(values[row]), float(errors[row]), float(model_error), bool(determined),
                    group in self.free, self._explained[group], instead,
                )  # fmt: skip
        return estimates

    def _instead_of(self, group: str) -> dict[str, tuple[float, ...]]:
        """Return the values of each group that was not freed, fitted in place of a freed one beside the others."""
        others = self._columns([free for free in self.free if free != group])
        values = {}
        for rival in (each for each in self.parameters.groups if each not in self.free):
            columns = [*others, *self.parameters.groups[rival]]
            fitted = inverse_of(self._normal[np.ix_(columns, columns)]) @ self._right[columns]
            values[rival] = tuple(float(value) for value in fitted[len(others) :])
        return values

    def _nominal_errors(self, columns: Sequence[int]) -> Float64:
        """Return the standard errors of parameters that are fitted alone to residuals of noise as declared."""
        block = np.ix_(columns, columns)
        root = inverse_of(self._normal[block]) @ _root(self._score_covariance[block])
        errors: Float64 = np.linalg.norm(root, axis=1)
        return errors

    def values_of_free(self) -> Float64:
        """Return the values (P,) of the freed parameters fitted together, 0 for all others."""
        values = np.zeros(len(self.parameters.names))
        columns = self._columns(self.free)
        if columns:
            values[columns] = inverse_of(self._normal[np.ix_(columns, columns)]) @ self._right[columns]
        return values

    def values_of_all(self) -> Float64:
        """Return the values (P,) of all parameters fitted together."""
        values: Float64 = inverse_of(self._normal) @ self._right
        return values

    def nuisances(self, values: Float64) -> Float64:
        """Return the nuisances (B, Q) that fit best beside given parameters (P,); (B, 0) where there are none."""
        return self._sums.nuisances(values)

    def local(self, name: str) -> SegmentDeviations:
        """Return the deviations of a parameter in each segment from the fit of the freed parameters.

        Parameters
        ----------
        name
            Name of the parameter.

        Returns
        -------
        SegmentDeviations
            Of the B segments, in the unit of the parameter.
        """
        column, values = self.parameters.names.index(name), self.values_of_free()
        # Each segment is whitened by itself, so that its score J^T C^-1 r has the variance J^T C^-1 J.
        scores = self._scores(values)[:, column]
        information = self._sums.normals[:, column, column] + self._prior[column, column]
        noise = np.zeros(len(scores)) if self._scatter_sums is None else self._scatter_sums.normals[:, column, column]
        # deviation = score / information; standard error = sqrt(information + 3 noise) / information.
        errors = max(1.0, self.misfit) * np.sqrt(information + _SCATTER_IN_SCORE * noise) / information
        attenuation = _attenuation(noise / information, errors / self.parameters.largest[column])
        model_errors = np.abs(self._sums.model_rights[:, column])
        if self._segment_biases is not None:
            # Biases of the segment itself, and of all segments by the fitted values from which it deviates.
            of_bias, of_free = list(self.parameters.groups["bias"]), self._columns(self.free)
            model_errors += np.sum(np.abs(self._sums.normals[:, column, of_bias]) * self._segment_biases, axis=1)
            if of_free:
                inverse = inverse_of(self._normal[np.ix_(of_free, of_free)])
                by_biases = np.abs(self._bias_rights[..., of_free] @ inverse).sum(axis=(0, 1))
                model_errors += np.abs(self._sums.normals[:, column, of_free]) @ by_biases
        return SegmentDeviations(
            deviations=scores / information / attenuation,
            standard_errors=errors / attenuation,
            model_errors=model_errors / information / attenuation,
        )

    @property
    def _scatter_normal(self) -> Float64:
        return np.zeros_like(self._normal) if self._scatter_sums is None else self._scatter_sums.normal

    def _scores(self, values: Float64) -> Float64:
        """Return the scores (B, P) of the segments at ``values`` (P,), less the scores of noise alone."""
        scores = self._sums.scores(values)
        return scores if self._scatter_sums is None else scores - self._scatter_sums.scores(np.zeros_like(values))

    def _columns(self, groups: Sequence[str]) -> list[int]:
        return [column for group in groups for column in self.parameters.groups[group]]

    def _explains(self, groups: Sequence[str]) -> float:
        """Return by how much the sum of squares decreases when the groups are free."""
        columns = self._columns(groups)
        if not columns:
            return 0.0
        right = self._right[columns]
        # Score statistic s^T V^-1 s with V the covariance of the score (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948).
        return float(right @ inverse_of(self._score_covariance[np.ix_(columns, columns)]) @ right)

    def _select(self) -> tuple[tuple[str, ...], dict[str, dict[str, float]]]:
        """Free groups, the one that explains most first, while its gain is far beyond chance.

        Gains are divided by the squared misfit of the full fit, so that noise above its declaration frees no group. The
        result is the freed groups, and the shares ``ParameterEstimate.explained`` by group and rival.
        """
        unit = max(1.0, self.misfit**2)
        free: tuple[str, ...] = ()
        explained: dict[str, dict[str, float]] = {}
        everything = self._explains(tuple(self.parameters.groups))
        # A fault that does not last for the whole recording leaves residuals that its own group, freed before, cannot
        # describe. Other groups explain them, so that the shares of freed groups refer to all that can be explained.
        alone = {
            g: float(np.clip(self._explains((g,)) / (everything or 1.0), 0.0, 1.0)) for g in self.parameters.groups
        }
        while candidates := [g for g in self.parameters.groups if g not in (*free, *self._barred)]:
            base = self._explains(free)
            gains = {g: (self._explains((*free, g)) - base) / unit for g in candidates}
            # By chance alone a gain follows chi squared; its degrees of freedom are the parameters (S. S. Wilks 1938).
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
        """Return the formal errors scaled by the misfit, widened where the segments scatter by more than chance.

        The scatter is that about the fitted nuisances; only the formal error contains their own uncertainty.
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
        # Sandwich estimate of the covariance: B / (B - 1) N^-1 (sum_b s_b s_b^T) N^-1, s_b the score of segment b.
        spread = np.sum((own @ scores.T) ** 2, axis=1) * segments / (segments - 1)
        expected = np.sum((own @ _root(own_normal + noise)) ** 2, axis=1) * max(1.0, self.misfit) ** 2
        # Scatter of B segments / its expectation ~ chi^2 / (B - 1), with B - 1 degrees of freedom.
        by_chance = chi_squared_beyond(SPREAD_TAIL, segments - 1) / (segments - 1)
        errors: Float64 = np.sqrt(formal + np.where(spread > by_chance * expected, spread - expected, 0.0))
        return errors


def _attenuation(noise_shares: Float64, relative_errors: Float64) -> Float64:
    """Return the shares of the information that come from the motion.

    Noise in a regressor multiplies a fitted value and its error by this share (W. Fuller, Measurement Error Models,
    Wiley 1987, section 1.1). The share is bounded from below, so that no error exceeds the largest conceivable value.
    """
    shares: Float64 = np.maximum(1.0 - noise_shares, np.minimum(relative_errors, 1.0))
    return shares


def _root(covariance: Float64) -> Float64:
    """Return R (n, n) with R R^T = covariance (n, n), also where parameters are collinear."""
    scales = np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
    # Eigenvalues instead of Cholesky's factors: rounding may make some eigenvalues slightly negative.
    values, vectors = np.linalg.eigh(covariance / np.outer(scales, scales))
    root: Float64 = scales[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root
