"""Lengths of the quaternions of orientations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.material_rounding import MATERIAL, UNIFORM
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import StoredStep
from fedora_qa.sequence.window import Window
from fedora_qa.views.motion_samples import location_of, stored_resolution

_LARGEST_ROUNDING: Final = UNIFORM / 2 * MATERIAL["path/pose/orientation"][0]
"""Largest error of a length by a rounding that counts as noise (derivation in ``PoseOrientation``)."""


@dataclass(frozen=True, slots=True)
class RoundedComponents(Feature):
    """The step of the components of quaternions.

    Attributes
    ----------
    length_bound
        Largest error of a length by rounding to it.
    """

    length_bound: float


@dataclass(frozen=True, slots=True)
class QuaternionNorms:
    """Lengths of the quaternions of one window.

    Attributes
    ----------
    count
        Number of quaternions.
    not_finite, first_not_finite
        Number of those that are not finite, and the row of the first one.
    worst, worst_row
        Length less 1 with the largest absolute value, and its row.
    resolution
        Spacing of the stored numbers at the largest value.
    """

    count: int
    not_finite: int
    first_not_finite: int
    worst: float
    worst_row: int
    resolution: float


class PoseOrientation(WindowCheck[QuaternionNorms]):
    """Are all orientations unit quaternions?

    The difference of the length of every quaternion from 1, and the number of quaternions that are not finite.

    Why it matters
    --------------
    The rotation matrix of a quaternion of length 1.01 stretches by 2%: depth, flow and gravity that are rotated by it
    have this error. Lengths other than 1 indicate noise that was added component by component, or interpolation without
    normalisation.

    How
    ---
    Every row is tested, whatever its timestamp. The largest deviation is stated with its row. The sign of a quaternion
    is not tested: q and -q are the same rotation, in any order.

    Noise model
    -----------
    No random error. The bound is four units in the last place of the stored type: four components, each with an error
    of half a unit, change the length by at most one unit; normalisation and the sum add three. The type is float32 if
    all values are float32 numbers. Where components were rounded to steps s_i, for example to six decimals, ``|s| / 2``
    is added: the error of each is at most half its step, and that of the length ``sum |q_i| s_i / (2 |q|)``, which is
    at most ``|s| / 2`` (Cauchy and Schwarz). Rounding is noise only as long as it is no fault by itself
    (``integrity.resolution``): the error of a rotation by it, ``|s| / sqrt(3)``, is at most 1.7e-4 rad. So at most
    ``sqrt(3) / 2`` times this is added, whatever the step.

    Cannot detect
    -------------
    Rounding to a step that is not material: the limit of quaternions that are not rounded does not hold for it. Noise
    that was removed by a later normalisation. A wrong rotation of unit length (``imu.rotation``,
    ``flow_geometry.endpoint``).

    Sources
    -------
    J. Sola, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics (2018), appendix B; IEEE
    754-2019, 3.6; first principles, as above.
    """

    name = "pose.orientation"
    needs = ("pose",)

    def measure(self, window: Window) -> QuaternionNorms | None:
        """Measure the window's own rows, with any timestamps."""
        rows = window.owned("pose")
        if not len(rows):
            return None
        q = window.rows("path/pose/orientation", rows.start, rows.stop).astype(np.float64)
        # In float64: the rounding of float32 squares would be as large as the tolerance.
        excess = np.linalg.norm(q, axis=1) - 1.0
        not_finite = ~np.isfinite(excess)
        # Rows that are not finite are counted separately, and left out of the worst length.
        worst = int(np.argmax(np.where(not_finite, -1.0, np.abs(excess))))
        return QuaternionNorms(
            count=len(rows),
            not_finite=int(np.count_nonzero(not_finite)),
            first_not_finite=rows.start + int(np.argmax(not_finite)),
            worst=0.0 if not_finite.all() else float(excess[worst]),
            worst_row=rows.start + worst,
            resolution=stored_resolution(q[~not_finite]),
        )

    def conclude(self, state: Sequence[QuaternionNorms], facts: Facts) -> Observation:
        """State the worst length, and the number of quaternions that are not finite."""
        coverage = Coverage(sum(norms.count for norms in state), len(facts.clocks["pose"].times_ns), "poses")
        if not state:
            return Observation(coverage, unobservable="the stream is empty")
        worst = max(state, key=lambda norms: abs(norms.worst))
        bound = length_bound(facts, max(norms.resolution for norms in state))
        with_not_finite = [norms for norms in state if norms.not_finite]
        count = sum(norms.not_finite for norms in with_not_finite)
        return Observation(
            coverage,
            (
                Statistic(
                    name="length_error",
                    value=worst.worst,
                    unit="1",
                    standard_error=0.0,
                    model_error_bound=bound.of_noise,
                    statement=f"A quaternion has the length {1 + worst.worst:.9g} (row {worst.worst_row}); expected 1.",
                    code="pose.orientation.length",
                    where=_row(facts, worst.worst_row),
                    features=(RoundedComponents(bound.of_rounding),),
                ),
                count_of_faults(
                    "not_finite",
                    count,
                    "poses",
                    statement=f"{count} orientations are not finite.",
                    code="pose.orientation.finite",
                    where=_row(facts, with_not_finite[0].first_not_finite) if with_not_finite else Where(stream="pose"),
                ),
            ),
        )


@dataclass(frozen=True, slots=True)
class LengthBound:
    """Largest error of the length of a correct quaternion.

    Attributes
    ----------
    of_noise
        By rounding, as far as rounding is noise and no fault by itself.
    of_rounding
        By rounding to any step.
    """

    of_noise: float
    of_rounding: float


def length_bound(facts: Facts, resolution: float) -> LengthBound:
    """Return the largest error of the length of a correct quaternion (derivation in ``PoseOrientation``).

    Parameters
    ----------
    facts
        With the steps of the components.
    resolution
        Spacing of the stored numbers at the largest component.
    """
    step = facts.steps.get("path/pose/orientation", StoredStep())
    by_steps = float(np.linalg.norm([step.component(i).size for i in range(4)])) / 2
    # Four units in the last place.
    by_type = 4.0 * resolution
    return LengthBound(by_type + min(by_steps, _LARGEST_ROUNDING), by_type + by_steps)


def _row(facts: Facts, row: int) -> Where:
    return location_of(facts, "pose", int(facts.clocks["pose"].times_ns[row]))
