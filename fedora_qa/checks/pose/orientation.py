"""Are the orientations rotations?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.motion_samples import place, stored_resolution


@dataclass(frozen=True, slots=True)
class NormTally:
    """Lengths of the quaternions of one window."""

    count: int
    not_finite: int
    first_not_finite: int
    worst: float
    worst_row: int
    resolution: float


class PoseOrientation(WindowCheck[NormTally]):
    """Are all orientations unit quaternions?

    The length of every quaternion against 1, and how many are no numbers.

    Why it matters
    --------------
    A rotation made of a quaternion of length 1.01 stretches by 2%: depth, flow and gravity turned by it are wrong by as
    much. Lengths off 1 betray noise that was added component by component, and interpolation without normalising.

    How
    ---
    Every row is looked at, whatever its stamp. The worst length is stated with its row. The sign of a quaternion means
    nothing, and is not looked at: q and -q are the same rotation, in any order.

    Noise model
    -----------
    None; an allowance of four units in the last place of the stored type: four components that are each off by half a
    unit move the length by one at most, and normalising and the sum by three more. The type is float32 where all values
    are float32 numbers.

    Cannot see
    ----------
    Noise that was normalised away afterwards; a wrong rotation of unit length (imu.rotation, flow_geometry.endpoint).

    Sources
    -------
    J. Sola, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics (2018), appendix B; IEEE
    754-2019, 3.6; first principles, as above.
    """

    name = "pose.orientation"
    needs = ("pose",)

    def measure(self, window: Window) -> NormTally | None:
        """Tally the window's own rows, whatever their stamps."""
        rows = window.owned("pose")
        if not len(rows):
            return None
        q = window.rows("path/pose/orientation", rows.start, rows.stop).astype(np.float64)
        excess = np.linalg.norm(q, axis=1) - 1.0
        bad = ~np.isfinite(excess)
        worst = int(np.argmax(np.where(bad, -1.0, np.abs(excess))))
        return NormTally(
            count=len(rows),
            not_finite=int(np.count_nonzero(bad)),
            first_not_finite=rows.start + int(np.argmax(bad)),
            worst=0.0 if bad.all() else float(excess[worst]),
            worst_row=rows.start + worst,
            resolution=stored_resolution(q[~bad]),
        )

    def conclude(self, state: Sequence[NormTally], facts: Facts) -> Observation:
        """State the worst length and count what is no number."""
        seen = Coverage(sum(tally.count for tally in state), len(facts.clocks["pose"].times_ns), "poses")
        if not state:
            return Observation(seen, unobservable="the stream is empty")
        worst = max(state, key=lambda tally: abs(tally.worst))
        spoilt = [tally for tally in state if tally.not_finite]
        count = sum(tally.not_finite for tally in spoilt)
        return Observation(
            seen,
            (
                Statistic(
                    name="length_error",
                    value=worst.worst,
                    unit="1",
                    standard_error=0.0,
                    model_error_bound=4.0 * max(tally.resolution for tally in state),
                    statement=f"A quaternion has the length {1 + worst.worst:.9g} (row {worst.worst_row}); normalise.",
                    code="pose.orientation.length",
                    where=_row(facts, worst.worst_row),
                ),
                count_of_faults(
                    "not_finite",
                    count,
                    "poses",
                    statement=f"{count} orientations are not finite.",
                    code="pose.orientation.finite",
                    where=_row(facts, spoilt[0].first_not_finite) if spoilt else Where(stream="pose"),
                ),
            ),
        )


def _row(facts: Facts, row: int) -> Where:
    return place(facts, "pose", int(facts.clocks["pose"].times_ns[row]))
