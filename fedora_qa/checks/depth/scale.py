"""The scale of depth: how far points lie, told by how they move when the camera does."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, TypeVar

from fedora_qa.checks.depth.pairs import DepthPair
from fedora_qa.checks.depth.parameters import FittedParameter, PairFit, Pooled, pool
from fedora_qa.checks.depth.suspects import ANY_MISFIT
from fedora_qa.checks.protocol import Measured, Suspect
from fedora_qa.estimators.depth_fit import Family

Known = TypeVar("Known", PairFit, Pooled)

_MATTERS: Final = 0.5
"""Metres, millimetres, feet, yards: units differ by more, but for the last of them."""


class Scale(FittedParameter):
    """Are depths in the unit that makes them fit the camera's path?

    From one depth frame to the next surfaces come nearer and slide past each other by as much as the camera's path,
    in metres, is long beside them. The factor by which the stored depths are too large is fitted to each pair of
    frames, beginning from infinite depth, so that wrong units need not be guessed; pairs are pooled.

    Noise model: the bounds of ``depth.consistency``, propagated through the fit in the worst direction (allowance), and
    the declared pose noise, which moves the motion of each pair (standard error; the spread over pairs where that is
    larger). Where the camera hovers the factor is known to no better than a half and nothing is said.

    A wrong factor is as well one of the positions: where depths lie far outside the declared range they are at fault,
    otherwise the inertial checks tell. The factor of the positions is then approximate, as the camera's lever arm is
    taken to be scaled with them.
    """

    name = "depth.scale"

    def family(self, pair: DepthPair) -> Family:
        """Let depths be too large by a factor."""
        return pair.scaled

    def pooled(self, fits: Sequence[PairFit]) -> Pooled | None:
        """Pool reciprocals: noise of the positions is normal in the path over the depths, and skew the other way."""
        pooled = pool([_reciprocal(fit) for fit in fits if fit.value != 0])
        return None if pooled is None or pooled.value == 0 else _reciprocal(pooled)

    def stated(self, pooled: Pooled, fits: Sequence[PairFit]) -> Measured:
        """State the factor."""
        plausible = 2 * sum(fit.plausible for fit in fits) > len(fits)
        inverse = 1 / pooled.value if pooled.value else None
        return Measured(
            name="scale",
            value=pooled.value,
            unit="1",
            standard_error=pooled.standard_error,
            expected=1.0,
            allowance=pooled.bound,
            matters=_MATTERS,
            statement=f"Depths are {pooled.value:.4g} times as large as the camera's path in metres makes them.",
            code="depth.scale.factor",
            suspects=(
                Suspect("unit_mm_m", "depth", (0.5 if plausible else 0.95) * pooled.explains, pooled.value, "1",
                        pooled.standard_error),
                Suspect("unit_mm_m", "pose", (0.9 if plausible else 0.3) * pooled.explains, inverse, "1"),
                *ANY_MISFIT,
            ),
        )  # fmt: skip


def _reciprocal(known: Known) -> Known:
    """Return the reciprocal of a value with its errors."""
    slope = known.value**-2
    return replace(
        known,
        value=1 / known.value,
        standard_error=slope * known.standard_error,
        bound=slope * known.bound,
    )
