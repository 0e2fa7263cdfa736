"""The poses on their own: are orientations rotations, is the noise as declared?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.motion.defects import pose_defects
from fedora_qa.checks.motion.noise_measured import noise_against_declared
from fedora_qa.checks.motion.samples import (
    NOISE_ORDER,
    join_poses,
    owned_poses,
    place,
    position_floor_m,
    rotation_floor_rad,
    stored_resolution,
    why_unusable,
)
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.local_motion import Orientations, Vectors, noise_level
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import PoseSamples, Window


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

    The length of every quaternion against 1. Rounding moves it by at most four units in the last place of the stored
    type (four components off by half a unit, normalising, and the sum): the allowance, for float32 where all values
    are float32 numbers. The sign of a quaternion means nothing and is not looked at. Noise added component by
    component shows here; noise that was normalised away afterwards does not.
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
                Measured(
                    name="length_error",
                    value=worst.worst,
                    unit="1",
                    standard_error=0.0,
                    allowance=4.0 * max(tally.resolution for tally in state),
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

    Divided differences of order 8, scaled to unit noise gain: the motion vanishes, white noise stays. Its standard
    deviation is compared with the declared sigma, or with 0. The standard error accounts for the correlation of
    neighbouring differences; what the motion may still add is bounded by two orders more. Where no noise is declared,
    rounded stamps (speed times 0.29 us) and stored digits are allowed for. Position noise is pooled over the axes of
    the world, rotation noise over those of the body. Noise that is not white is seen by its fastest part only.
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
        defects = tuple(one for one in pose_defects(poses, model) if one.cause != "noise_misdeclared")
        found = (
            noise_against_declared(
                *kind, check="pose.noise", stream="pose", units={"unit_mm_m": MM_PER_M}, besides=defects
            )
            for kind in kinds
        )
        return Observation(seen, tuple(found))


def _row(facts: Facts, row: int) -> Where:
    return place(facts, "pose", int(facts.clocks["pose"].times_ns[row]))
