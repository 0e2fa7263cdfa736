"""The poses on their own: are orientations rotations, is the noise as declared?"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.imu.local_motion import Orientations, Vectors, noise_level
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import PoseSamples, Window
from fedora_qa.views.motion_samples import (
    NOISE_ORDER,
    join_poses,
    owned_poses,
    place,
    position_floor_m,
    rotation_floor_rad,
    stored_resolution,
    why_unusable,
)
from fedora_qa.views.noise_level import noise_against_declared
from fedora_qa.views.sample_defects import pose_defects

_RARER: Final = 0.6
"""Weight of a point far from the body's origin, beside that of a wrong declaration."""


@dataclass(frozen=True, slots=True)
class NormTally:
    """Lengths of the quaternions of one window."""

    count: int
    not_finite: int
    first_not_finite: int
    worst: float
    worst_row: int
    resolution: float


class Orientation(WindowCheck[NormTally]):
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
                    suspects=(Suspect("quaternion_not_unit", "pose", 0.95, worst.worst, "1"),),
                ),
                count_of_faults(
                    "not_finite",
                    count,
                    "poses",
                    statement=f"{count} orientations are not finite.",
                    code="pose.orientation.finite",
                    where=_row(facts, spoilt[0].first_not_finite) if spoilt else Where(stream="pose"),
                    suspects=(Suspect("nan_in_stream", "pose", 0.9, float(count), "samples"),),
                ),
            ),
        )


class Noise(WindowCheck[PoseSamples]):
    """Is the noise of the poses what is declared?

    The standard deviation of white noise of positions (m, axes of the world) and of orientations (rad, axes of the
    body), as a ratio to the declared sigma, or itself where none is declared.

    Why it matters
    --------------
    Whoever fuses or evaluates with these poses weighs them by the declared sigma, and flow that was made of noisy poses
    is wrong by pixels: 0.2 deg at 1247 px are 4.4 px.

    How
    ---
    Divided differences of order 8 over nine neighbouring poses, scaled to unit noise gain: what a polynomial of degree
    7 describes vanishes for even and uneven stamps, and white noise stays. Rotations are differences of the vectors
    Log(q_k^-1 q_j). Sigma follows from the size that nine in ten differences stay below, so that a few jumps do not
    raise it. Straight lines, frozen poses and stamps on a coarse grid look like noise; where they are found they are
    named first.

    Noise model
    -----------
    Gaussian and white. Neighbouring differences correlate: the variance of their mean square is C(4d, 2d) / C(2d, d)^2
    times that of independent ones, and the quantile costs another factor of 1.25. Allowed for are what the motion may
    still add (what differences of two orders more take away), rounded stamps (speed times 0.29 us) and stored digits.

    Cannot see
    ----------
    Noise that is not white, but for its fastest part; a drift. Noise under a motion of some 20 Hz.

    Sources
    -------
    J. von Neumann et al., Ann. Math. Statist. 12 (1941) 153 (successive differences); first principles in
    ``fedora_qa/estimators/imu/local_motion.py``; format: position in the world, orientation q * Exp(n).
    """

    name = "pose.noise"
    needs = ("pose",)

    def measure(self, window: Window) -> PoseSamples | None:
        """Keep the window's own poses."""
        return owned_poses(window)

    def conclude(self, state: Sequence[PoseSamples], facts: Facts) -> Observation:
        """Compare both kinds of noise with their declarations."""
        poses = join_poses(state)
        seen = Coverage(len(poses.times_ns), len(facts.clocks["pose"].times_ns), "poses")
        unusable = why_unusable(facts, "pose")
        position = noise_level(poses.times_ns, Vectors(poses.positions_world_m), order=NOISE_ORDER)
        rotation = noise_level(poses.times_ns, Orientations(poses.orientations_xyzw), order=NOISE_ORDER)
        if unusable or position is None or rotation is None:
            return Observation(seen, unobservable=unusable or "too few poses in a row to tell noise from motion")
        model = facts.declared.pose or PoseModel()
        kinds = (
            ("position", "m", position, model.position_sigma_m, position_floor_m(poses)),
            ("rotation", "rad", rotation, model.rotation_sigma_rad, rotation_floor_rad(poses)),
        )
        defects = tuple(one for one in pose_defects(facts, poses, model) if one.cause != "noise_misdeclared")
        of_position, of_rotation = (
            noise_against_declared(
                *kind, check="pose.noise", stream="pose", units={"unit_mm_m": MM_PER_M}, besides=defects
            )
            for kind in kinds
        )
        swung = _swung(position.sigma, model)
        return Observation(seen, (replace(of_position, suspects=(*of_position.suspects, *swung)), of_rotation))


def _swung(position_m: float, model: PoseModel) -> tuple[Suspect, ...]:
    """Suspect that positions are those of another point of the body, which noise of the orientation swings about."""
    excess_m2 = position_m**2 - model.position_sigma_m**2
    if excess_m2 <= 0 or model.rotation_sigma_rad <= 0:
        return ()
    arm_m = float(np.sqrt(1.5 * excess_m2)) / model.rotation_sigma_rad  # swings about two axes, seen along three
    return (Suspect("lever_arm", "pose", _RARER, arm_m, "m"),)


def _row(facts: Facts, row: int) -> Where:
    return place(facts, "pose", int(facts.clocks["pose"].times_ns[row]))
