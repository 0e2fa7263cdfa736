"""Which length a depth is: along the optical axis, or along the ray."""

from collections.abc import Sequence
from typing import Final

from fedora_qa.checks.depth.pairs import DepthPair
from fedora_qa.checks.depth.parameters import FittedParameter, PairFit, Pooled
from fedora_qa.checks.depth.suspects import ANY_MISFIT
from fedora_qa.checks.protocol import Measured, Suspect
from fedora_qa.estimators.depth_fit import Family

_MATTERS: Final = 0.5
"""Depths are z or lengths of rays: half of the way tells them apart."""


class Projection(FittedParameter):
    """Is depth measured along the optical axis, or along each pixel's ray?

    With m = (x/z, y/z, 1) the length of the ray is z |m|, which is 15% more at the edge of a 60 degree view. Depths
    ``z |m|^c`` with an exponent c between 0 (z) and 1 (ray) are fitted to each pair of frames: a turning camera carries
    surfaces to other |m|, where a length that should have stayed changes, and bends what passes by. Pairs are pooled.

    Noise model: as for ``depth.scale``. A camera that neither turns nor moves shows nothing.
    """

    name = "depth.projection"

    def family(self, pair: DepthPair) -> Family:
        """Let depths be lengths of rays in part."""
        return pair.as_rays

    def stated(self, pooled: Pooled, fits: Sequence[PairFit]) -> Measured:
        """State the exponent."""
        return Measured(
            name="ray_exponent",
            value=pooled.value,
            unit="1",
            standard_error=pooled.standard_error,
            expected=0.0,
            allowance=pooled.bound,
            matters=_MATTERS,
            statement=f"Depths are z times |m| to the power of {pooled.value:.3g}: 0 is z, 1 the length of the ray.",
            code="depth.projection.ray",
            suspects=(Suspect("depth_ray_not_z", "depth", 0.95 * pooled.explains), *ANY_MISFIT),
        )
