"""One parameter of all depth, fitted to pairs of frames: the scale, or the exponent of the ray length."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.depth.pair_fit import DepthFit, Family, fit_depth
from fedora_qa.estimators.depth.warp import DepthLattice, ModelNumber
from fedora_qa.estimators.fitting.robust import robust_sigma
from fedora_qa.features import Feature
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_pairs import DepthPair, owned_pairs, pixels_of_pairs, where_of_frames, why_no_geometry
from fedora_qa.views.flow_intervals import depths_plausible

_FAR: Final = 3.0
"""Distance from the median, in sigmas, at which a pair has half the weight."""

_MOST: Final = 0.75
"""Share of the pixels that agree from which no other fit is tried. The value is not derived: a wrong fit of 1800 pixels
left 300 to 1000 to compare, the correct one 1700; where surfaces hide each other a second fit costs time alone."""

_SIGNIFICANT: Final = 3.0
"""Standard deviations from which chi squared of all corrections exceeds their noise: noise alone does so in 0.1%."""


@dataclass(frozen=True, slots=True)
class ResidualReduction(Feature):
    """Effect of the fitted parameter on the residuals of depth pairs.

    Attributes
    ----------
    share
        Share of the deviation that the parameter removes, 0 to 1: of the typical residual, or of what the corrections
        of the motion exceed their declared noise by, whichever is larger.
    """

    share: float


@dataclass(frozen=True, slots=True)
class PairParameter:
    """A parameter fitted to one pair of frames.

    Attributes
    ----------
    first, second
        Rows of the depth stream.
    pixels_read
        Number of pixels that were fitted.
    value, standard_error, bound
        The parameter, its standard error, and a bound of its error by the model.
    declared_residual, fit_residual
        Typical (median absolute relative) residuals as declared and after the fit; the former is infinite where the
        frames cannot be compared as declared.
    declared_noise_square, fit_noise_square, noise_dof
        Chi squared of the corrections of the motion under its declared noise, as declared (NaN where the frames cannot
        be compared) and after the fit; and the number of directions that the frames constrain as declared.
    plausible
        Whether the depths lie in the declared range.
    path_noise_square
        Chi squared of the camera's path under its declared noise, of three degrees of freedom; infinite without noise.
    path_factor
        Factor by which the camera's path is too long if the depths are correct; NaN where not fitted.
    """

    first: int
    second: int
    pixels_read: int
    value: float
    standard_error: float
    bound: float
    declared_residual: float
    fit_residual: float
    declared_noise_square: float
    fit_noise_square: float
    noise_dof: float
    plausible: bool
    path_noise_square: float
    path_factor: float


@dataclass(frozen=True, slots=True)
class PooledParameter:
    """The parameter of all pairs together.

    Attributes
    ----------
    value, standard_error, bound
        As in ``PairParameter``.
    residual_reduction
        As in ``ResidualReduction``.
    """

    value: float
    standard_error: float
    bound: float
    residual_reduction: float


class FittedParameter(WindowCheck[tuple[PairParameter, ...]]):
    """For which value of a parameter do depth and pose agree?

    Shared by the checks of one parameter: the fit of each pair, and the pooling over pairs.
    """

    needs = ("depth", "pose")
    number: ClassVar[ModelNumber]
    """Which number of the model it is."""
    from_value: ClassVar[float] = 0.0
    """Start of the fit for frames that do not agree as declared."""
    declared_value: ClassVar[float] = 0.0
    """The number as declared: start of the fit for frames that agree."""

    def not_applicable(self, facts: Facts) -> str:
        """Return which assumption of the model does not hold; empty where all hold."""
        return why_no_geometry(facts)

    @abstractmethod
    def family(self, pair: DepthPair) -> Family:
        """Return the models of a pair as a function of the parameter."""

    def path_factor(self, pair: DepthPair, fit: DepthFit) -> float:
        """Return the factor by which the path is too long if the depths are correct; NaN for other parameters.

        Parameters
        ----------
        pair
            The pair of frames.
        fit
            Fit of the parameter to the pair.
        """
        return float("nan")

    def pooled(self, fits: Sequence[PairParameter], *, known_noise: bool) -> PooledParameter | None:
        """Pool the pairs, as ``pool`` does."""
        return pool(fits, known_noise=known_noise)

    @abstractmethod
    def statistic(self, pooled: PooledParameter, fits: Sequence[PairParameter]) -> Statistic:
        """Return the statistic of the parameter.

        Parameters
        ----------
        pooled
            The parameter of all pairs together.
        fits
            The parameter of each pair, in the order of frames.
        """

    def measure(self, window: Window) -> tuple[PairParameter, ...] | None:
        """Fit every pair that the window owns."""
        fits = []
        for pair in owned_pairs(window):
            if pair is None:
                continue
            lattice = pair.lattice_to_fit()
            as_declared = pair.fit_as_declared()
            starts = [self.from_value]
            if as_declared is not None and as_declared.agrees:
                starts = [self.declared_value, self.from_value]
            fit = self._best_fit(pair, lattice, starts)
            # A pair of frames that does not constrain the parameter has no finite standard error.
            if fit is None or not np.isfinite(fit.standard_error):
                continue
            # Rounded poses move the parameter by g e, with g its derivative by the twist: variance g C g^T.
            by_rounding = fit.value_by_twist @ pair.rounding_covariance() @ fit.value_by_twist
            fits.append(
                PairParameter(
                    pair.first,
                    pair.second,
                    lattice.depths_m.size,
                    fit.value,
                    float(np.sqrt(fit.standard_error**2 + by_rounding)),
                    fit.bound,
                    as_declared.typical if as_declared else np.inf,
                    fit.typical,
                    as_declared.noise_square if as_declared else np.nan,
                    fit.noise_square,
                    as_declared.noise_dof if as_declared else 0.0,
                    depths_plausible(pair.window.facts, lattice.depths_m),
                    _path_noise_square(pair),
                    self.path_factor(pair, fit) if window.sampling.features else float("nan"),
                )
            )
        return tuple(fits)

    def _best_fit(self, pair: DepthPair, lattice: DepthLattice, starts: Sequence[float]) -> DepthFit | None:
        """Return the fit from the first start, or of several the one under which most pixels agree.

        Frames agree as declared with a wrong number, too, where corrections of the motion make up for it. Such a fit
        leaves few pixels that can be compared.
        """
        best: DepthFit | None = None
        for start in starts:
            fit = fit_depth(self.family(pair), lattice, pair.image1, pair.noise, start=start, step=self.number)
            if best is None or (fit is not None and fit.agreeing > best.agreeing):
                best = fit
            if best is not None and best.agreeing >= _MOST * lattice.depths_m.size:
                break
        return best

    def conclude(self, state: Sequence[tuple[PairParameter, ...]], facts: Facts) -> Observation:
        """Pool the pairs."""
        # In the order of frames: sums then do not depend on the distribution of windows among workers.
        fits = sorted((fit for fits in state for fit in fits), key=lambda fit: fit.first)
        total = max(int(np.count_nonzero(facts.clocks["depth"].advancing)) - 1, 0)
        coverage = pixels_of_pairs(sum(fit.pixels_read for fit in fits), total, facts)
        pooled = self.pooled(fits, known_noise=facts.declared.pose is not None)
        if pooled is None:
            why = "no two depth frames show the same surfaces from clearly different poses"
            return Observation(coverage, unobservable=why)
        where = where_of_frames(facts, fits[0].first, fits[-1].second)
        return Observation(coverage, (replace(self.statistic(pooled, fits), where=where),))


def _path_noise_square(pair: DepthPair) -> float:
    """Return chi squared of the translation t (3,) of a pair under its noise of covariance D D^T, with D (3, k)."""
    directions_m = pair.noise[3:]
    if pair.window.facts.declared.pose is None or np.linalg.matrix_rank(directions_m) < len(directions_m):
        return np.inf
    whitened = np.linalg.pinv(directions_m) @ pair.motion.t_m
    return float(whitened @ whitened)


def pool(fits: Sequence[PairParameter], *, known_noise: bool) -> PooledParameter | None:
    """Return the weighted mean of the parameters of pairs; None without pairs.

    Pairs that share a pose have errors of opposite sign, so the error of their mean is less than stated. Pairs far from
    the others have less weight (Cauchy's weights), so that single bad frames do not dominate.

    Parameters
    ----------
    fits
        The parameter of each pair.
    known_noise
        Whether the noise of the poses is declared. Then the errors of the pairs are known, and pairs that scatter more
        do not excuse a deviation: a fault that moves each pair by another amount would otherwise raise the limit with
        its own size. Where it is not declared, the scatter of the pairs gives the standard error if it is larger.
    """
    if not fits:
        return None
    values, errors, bounds, declared, fitted = np.array(
        [(fit.value, fit.standard_error, fit.bound, fit.declared_residual, fit.fit_residual) for fit in fits]
    ).T
    sigmas = np.hypot(errors, bounds)
    median = float(np.median(values))
    # Few pairs may agree by chance: the scale is not below a pair's own error.
    scale = np.maximum(sigmas, robust_sigma(values, median))
    # Inverse variances times Cauchy's weights 1 / (1 + u^2).
    weights = 1.0 / (sigmas**2 * (1.0 + ((values - median) / (_FAR * scale)) ** 2))
    weights /= weights.sum()
    value = float(weights @ values)
    variance = weights**2 @ errors**2
    if not known_noise:
        # Variance of a weighted mean from the scatter of its values, with n / (n - 1) for the fitted mean.
        variance = max(variance, weights**2 @ (values - value) ** 2 * len(fits) / max(len(fits) - 1, 1))
    # Frames that agreed exactly as declared leave no residual to remove.
    residual_ratios = np.divide(fitted, declared, out=np.ones_like(fitted), where=declared > 0)
    return PooledParameter(
        value=value,
        standard_error=float(np.sqrt(variance)),
        # Bounds average linearly: an error of the model may have the same sign in all pairs.
        bound=float(weights @ bounds),
        residual_reduction=max(float(np.median(1.0 - residual_ratios)), _removed_corrections(fits), 0.0),
    )


def _removed_corrections(fits: Sequence[PairParameter]) -> float:
    """Return the share of the excess of the corrections over their declared noise that the parameter removes.

    The excess is the root of chi squared less its expected value n. It counts where chi squared exceeds n by three of
    its standard deviations, sqrt(2 n).
    """
    declared, fitted, dof = np.array(
        [(fit.declared_noise_square, fit.fit_noise_square, fit.noise_dof) for fit in fits]
    ).T
    compared = np.isfinite(declared)
    expected = float(dof[compared].sum())
    excess = float(declared[compared].sum()) - expected
    if excess <= _SIGNIFICANT * np.sqrt(2 * expected):
        return 0.0
    return 1.0 - float(np.sqrt(max(fitted[compared].sum() - expected, 0.0) / excess))
