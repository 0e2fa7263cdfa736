"""The scale of depth, by the parallax of points under the camera's motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Final, TypeVar

import numpy as np

from fedora_qa.checks.depth.parameters import (
    FittedParameter,
    PairParameter,
    PooledParameter,
    ResidualReduction,
    pool,
)
from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.depth.pair_fit import DepthFit, Family, fit_depth
from fedora_qa.features import Feature
from fedora_qa.views.depth_pairs import DepthPair

Parameter = TypeVar("Parameter", PairParameter, PooledParameter)

_SIGNIFICANT: Final = 10.0
"""Standard errors from 1 at which the factor of a pair is wrong at any false-alarm rate of a file."""

_CHANCE: Final = 5.0
"""Standard deviations that chi squared of paths of noise is not away from its expectation: 6e-7 of files, by the normal
law."""

_RELATIVE_STEP: Final = 1e-3
"""Relative step of the numerical derivative by the factor."""


@dataclass(frozen=True, slots=True)
class PathScale(Feature):
    """The scale if it is a fault of the camera's path.

    Attributes
    ----------
    factor
        Factor by which the path is too long if the depths are correct; None where it could not be fitted.
    depths_plausible
        Whether the depths of most pairs lie in the declared range.
    """

    factor: float | None
    depths_plausible: bool


class DepthScale(FittedParameter):
    """Is the unit of depth consistent with the camera's path?

    The factor by which the stored depths are too large relative to the positions.

    Why it matters
    --------------
    With depth in millimetres and translation in metres, the flow computed from them looks like that of a pure rotation,
    and is still plausible as flow.

    How
    ---
    From one depth frame to the next, surfaces come nearer and move against each other in proportion to the length of
    the camera's path, in metres, over their depth. The factor is fitted to each pair of frames by Gauss-Newton. The
    start is 1 where the frames agree as declared, and otherwise infinite depth, so that no list of wrong units is
    needed. The motion may have an error within its declared noise. Pairs are averaged with weights by their errors;
    pairs far from the others have less weight. A wrong factor may also be one of the positions: where depths lie far
    outside the declared range, depth is suspected, otherwise the checks of the IMU decide. Where the factor differs
    significantly from 1, that of the positions is fitted as well, because the lever arm of the camera does not scale
    with them.

    Noise model
    -----------
    The bounds of ``depth.consistency``, propagated through the fit in the worst direction (model error bound); and the
    declared pose noise and the steps of stored poses, which change the motion of each pair (standard error). Where no
    pose noise is declared, the spread over pairs is the standard error if it is larger. A path that is no longer and no
    shorter than its declared noise determines no factor.

    Cannot detect
    -------------
    Depths and positions that are wrong by one factor, which gravity determines (``imu.translation``). Where the camera
    hovers, the error of the factor exceeds a half, and the check is not observable.

    Sources
    -------
    Y. Chen, G. Medioni, Image and Vision Computing 10 (1992) 145; first principles,
    ``fedora_qa/estimators/depth/pair_fit.py``.
    """

    name = "depth.scale"
    number = "scale"
    declared_value = 1.0

    def family(self, pair: DepthPair) -> Family:
        """Return models whose depths are too large by a factor."""
        return pair.scaled

    def path_factor(self, pair: DepthPair, fit: DepthFit) -> float:
        """Return the factor by which the path is too long if the depths are correct; NaN where the scale is about 1.

        The fit starts at the factor of the depths. The lever arm does not scale with the positions.

        Parameters
        ----------
        pair
            The pair of frames.
        fit
            Fit of the factor of the depths.

        Returns
        -------
        float
            NaN also where the factor of the depths is zero.
        """
        # A factor that is 1 within ten errors leaves no scale to assign to the path.
        if not fit.value or abs(fit.value - 1) <= _SIGNIFICANT * (fit.standard_error + fit.bound):
            return float("nan")
        # Depths that are too large by a factor have the effect of positions that are too small by it.
        path_fit = fit_depth(
            pair.models_of_path(), pair.lattice_to_fit(), pair.image1, pair.noise,
            start=fit.value, step=_RELATIVE_STEP * abs(fit.value),
        )  # fmt: skip
        return 1 / path_fit.value if path_fit is not None and path_fit.value else float("nan")

    def pooled(self, fits: Sequence[PairParameter], *, known_noise: bool) -> PooledParameter | None:
        """Pool the reciprocals of the factors.

        With noise of the positions, the ratio of path to depths is normal, and its reciprocal is skewed. Where all of
        the path is noise, it is noise over the parallax: of a camera at rest it has no finite mean, and errors of its
        reciprocal to first order do not hold. Chi squared of n such paths has the mean 3 n. Successive pairs share a
        pose, so that their noise is correlated by -1/2, and chi squared by 1/4: its variance is 6 n (1 + 2/4).
        """
        deviation = sum(fit.path_noise_square - 3 for fit in fits)
        if abs(deviation) <= _CHANCE * sqrt(9 * len(fits)):
            return None
        pooled = pool([_reciprocal(fit) for fit in fits if fit.value != 0], known_noise=known_noise)
        return None if pooled is None or pooled.value == 0 else _reciprocal(pooled)

    def statistic(self, pooled: PooledParameter, fits: Sequence[PairParameter]) -> Statistic:
        """Return the factor by which depths are too large against the positions."""
        path_factors = np.array([fit.path_factor for fit in fits])
        fitted = path_factors[np.isfinite(path_factors)]
        path_scale = PathScale(
            # Single bad frames do not move a median.
            factor=float(np.median(fitted)) if len(fitted) else None,
            depths_plausible=2 * sum(fit.plausible for fit in fits) > len(fits),
        )
        return Statistic(
            name="scale",
            value=pooled.value,
            unit="1",
            standard_error=pooled.standard_error,
            expected=1.0,
            model_error_bound=pooled.bound,
            statement=f"Depths are {pooled.value:.4g} times as large as the camera's path in metres implies.",
            code="depth.scale.factor",
            features=(ResidualReduction(pooled.residual_reduction), path_scale),
        )


def _reciprocal(parameter: Parameter) -> Parameter:
    """Return the reciprocal of a value with its errors, to first order: d(1/x) = dx / x^2."""
    slope = parameter.value**-2
    return replace(
        parameter,
        value=1 / parameter.value,
        standard_error=slope * parameter.standard_error,
        bound=slope * parameter.bound,
    )
