"""The scale of depth: how far points lie, told by how they move when the camera does."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from fedora_qa.checks.depth.parameters import FittedParameter, PairFit, Pooled, pool
from fedora_qa.checks.depth.suspects import ANY_MISFIT
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.depth.pair_fit import DepthFit, Family, fit_depth
from fedora_qa.views.depth_pairs import DepthPair

Known = TypeVar("Known", PairFit, Pooled)

_SURELY: Final = 10.0
"""Errors from 1 at which a pair's factor is wrong, whatever the file's false-alarm rate."""

_STEP: Final = 1e-3
"""Share of the factor by which it is changed to see its effect."""

_MATTERS: Final = 0.5
"""Metres, millimetres, feet, yards: units differ by more, but for the last of them."""


class DepthScale(FittedParameter):
    """Are depths in the unit that makes them fit the camera's path?

    The factor by which the stored depths are too large beside the positions.

    Why it matters
    --------------
    With depth in millimetres and translation in metres the flow made of them looks as if the camera only turned, and
    still looks like flow.

    How
    ---
    From one depth frame to the next surfaces come nearer and slide past each other by as much as the camera's path,
    in metres, is long beside them. The factor is fitted to each pair of frames by Gauss-Newton, beginning from 1 where
    they agree as declared, and else from infinite depth, so that wrong units need not be guessed; the motion may err
    within its declared noise. Pairs are pooled by their errors, pairs far from the others weighing less. A wrong factor
    is as well one of the positions: where depths lie far outside the declared range they are at fault, otherwise the
    inertial checks tell. Where the factor is surely not 1, that of the positions is fitted as well, since the lever arm
    of the camera does not scale with them.

    Noise model
    -----------
    The bounds of ``depth.consistency``, propagated through the fit in the worst direction (allowance), and the
    declared pose noise, which moves the motion of each pair (standard error; the spread over pairs where that is
    larger).

    Cannot see
    ----------
    Depths and positions that are wrong by one factor, which gravity tells (``imu.translation``). Where the camera
    hovers the factor is known to no better than a half, and nothing is said.

    Sources
    -------
    Y. Chen, G. Medioni, Image and Vision Computing 10 (1992) 145; first principles,
    ``fedora_qa/estimators/depth/pair_fit.py``.
    """

    name = "depth.scale"
    number = "scale"
    declared_value = 1.0

    def family(self, pair: DepthPair) -> Family:
        """Let depths be too large by a factor."""
        return pair.scaled

    def of_path(self, pair: DepthPair, fit: DepthFit) -> float:
        """Fit, where the factor is surely not 1, that of the positions instead: the lever arm does not scale with them.

        The fit begins from the path that the factor of the depths asks for; a factor of zero, of positions beyond all
        measure, asks for none.
        """
        if not fit.value or abs(fit.value - 1) <= _SURELY * (fit.standard_error + fit.bound):
            return float("nan")
        lattice, image1 = pair.lattice_to_fit(), pair.image1
        found = fit_depth(pair.with_path, lattice, image1, pair.noise, start=fit.value, step=_STEP * abs(fit.value))
        return 1 / found.value if found is not None and found.value else float("nan")

    def pooled(self, fits: Sequence[PairFit]) -> Pooled | None:
        """Pool reciprocals: noise of the positions is normal in the path over the depths, and skew the other way."""
        pooled = pool([_reciprocal(fit) for fit in fits if fit.value != 0])
        return None if pooled is None or pooled.value == 0 else _reciprocal(pooled)

    def stated(self, pooled: Pooled, fits: Sequence[PairFit]) -> Statistic:
        """State the factor."""
        plausible = 2 * sum(fit.plausible for fit in fits) > len(fits)
        of_positions = np.array([fit.of_path for fit in fits])
        known = of_positions[np.isfinite(of_positions)]
        of_pose = float(np.median(known)) if len(known) else None
        turned_round = of_pose is not None and of_pose <= 0  # no unit does that to lengths
        explains = pooled.explains if pooled.value > 0 else 0.0
        of_depth_share, of_pose_share = (0.5, 0.9) if plausible and not turned_round else (0.95, 0.3)
        return Statistic(
            name="scale",
            value=pooled.value,
            unit="1",
            standard_error=pooled.standard_error,
            expected=1.0,
            model_error_bound=pooled.bound,
            material=_MATTERS,
            statement=f"Depths are {pooled.value:.4g} times as large as the camera's path in metres makes them.",
            code="depth.scale.factor",
            suspects=(
                Suspect("unit_mm_m", "depth", of_depth_share * explains, pooled.value, "1",
                        pooled.standard_error),
                Suspect("unit_mm_m", "pose", of_pose_share * explains, of_pose, "1"),
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
