"""Direction of depths: along the optical axis, or along the ray."""

from collections.abc import Sequence

from fedora_qa.checks.depth.parameters import FittedParameter, PairParameter, PooledParameter, ResidualReduction
from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.depth.pair_fit import Family
from fedora_qa.views.depth_pairs import DepthPair


class DepthProjection(FittedParameter):
    """Is depth measured along the optical axis, or along each pixel's ray?

    The exponent c with which depths are ``z |m|^c``, m = (x/z, y/z, 1): 0 for z, 1 for the length of the ray.

    Why it matters
    --------------
    Ray lengths taken for z bend every plane into a bowl: 15% at the edge of a 60 degree view. Both are called depth,
    and simulators deliver either.

    How
    ---
    The exponent is fitted to each pair of frames: a turning camera carries surfaces to other |m|, where a length that
    should have stayed changes; what passes by is bent. The motion may err within its declared noise. Pairs are pooled
    by their errors.

    Noise model
    -----------
    As for ``depth.scale``: the bounds of ``depth.consistency`` propagated in the worst direction (allowance), the
    declared pose noise (standard error; the spread over pairs where that is larger).

    Cannot see
    ----------
    Anything where the camera neither turns nor moves; where half of the way from 0 to 1 would not be seen, it says
    so. A distortion of the lens that depth frames still have looks like a part of the way.

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
