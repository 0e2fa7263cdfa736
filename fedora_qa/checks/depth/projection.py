"""Definition of depths: along the optical axis, or along the ray."""

from collections.abc import Sequence

from fedora_qa.checks.depth.parameters import FittedParameter, PairParameter, PooledParameter, ResidualReduction
from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.depth.pair_fit import Family
from fedora_qa.views.depth_pairs import DepthPair


class DepthProjection(FittedParameter):
    """Is depth measured along the optical axis, or along each pixel's ray?

    The exponent c with which stored depths are ``z |m|^c``, m = (x/z, y/z, 1): 0 for z, 1 for the length of the ray.

    Why it matters
    --------------
    Ray lengths that are used as z bend every plane into a bowl: by 15% at the edge of a 60 degree view. Both are called
    depth, and simulators write either.

    How
    ---
    The exponent is fitted to each pair of frames. A rotating camera moves surfaces to another |m|, where the wrong
    exponent changes lengths that should be constant; under translation it bends the surfaces. The motion may have an
    error within its declared noise. Pairs are averaged with weights by their errors.

    Noise model
    -----------
    As in ``depth.scale``: the bounds of ``depth.consistency``, propagated in the worst direction (model error bound),
    and the declared pose noise and the steps of stored poses (standard error). Where no pose noise is declared, the
    spread over pairs is the standard error if it is larger.

    Cannot detect
    -------------
    Any exponent where the camera neither rotates nor moves: the check is not observable where an exponent of 0.5 could
    not be detected. A lens distortion that depth frames still contain appears as an exponent between 0 and 1.

    Sources
    -------
    Y. Chen, G. Medioni, Image and Vision Computing 10 (1992) 145; first principles,
    ``fedora_qa/estimators/depth/pair_fit.py``.
    """

    name = "depth.projection"
    number = "ray"

    def family(self, pair: DepthPair) -> Family:
        """Return models whose depths are z times a power of the ray's length."""
        return pair.as_rays

    def statistic(self, pooled: PooledParameter, fits: Sequence[PairParameter]) -> Statistic:
        """State the exponent of the ray's length: 0 for z-depth, 1 for ray length."""
        return Statistic(
            name="ray_exponent",
            value=pooled.value,
            unit="1",
            standard_error=pooled.standard_error,
            expected=0.0,
            model_error_bound=pooled.bound,
            statement=f"Depths are z times |m| to the power of {pooled.value:.3g}: 0 is z, 1 the length of the ray.",
            code="depth.projection.ray",
            features=(ResidualReduction(pooled.residual_reduction),),
        )
