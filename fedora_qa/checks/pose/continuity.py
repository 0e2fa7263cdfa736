"""The motion of the poses: does it go on as a body moves?"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.pose.returns import lever_arm_suspects
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.imu.local_motion import (
    Curve,
    Orientations,
    Steps,
    Vectors,
    find_steps,
    noise_level,
    sharpest,
)
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
    why_unusable,
)
from fedora_qa.views.pose_conventions import orientation_readings, position_readings
from fedora_qa.views.sample_defects import LEAST_EVENNESS, frozen_poses, interpolation_of, rate_hz, timestamp_defects

_STEP_FILTERS: Final = ((4, 5), (6, 7), (8, 5), (12, 5), (24, 5), (12, 3), (24, 3))
"""Half width and degree of the filters that look for jumps: short ones for exact poses, long ones for noisy."""

_FEWEST_POSES: Final = 24


class PoseContinuity(WindowCheck[PoseSamples]):
    """Does the pose move as a body moves, without jumps, stops or straight lines?

    The largest jump of position (m) and orientation (deg) between two poses, the number of frozen poses, and how evenly
    curvature is spread over them.

    Why it matters
    --------------
    A reset of the simulator or a loop closure moves the body by millimetres within 5 ms: flow and depth warped across
    it are wrong, velocities are absurd. Poses interpolated from a lower rate miss the motion between their knots.

    How
    ---
    *Jumps*: at every place, least squares of a polynomial plus a step over the poses around it, the matched filter of a
    step. Several widths and degrees are at hand; the one with the least error on this file is used. *Stops*: poses
    equal to the one before in every bit while the body moves. *Straight lines*: the median curvature off every n-th
    pose over that at it, n from 2 to 20: 1 for any smooth or noisy motion, near 0 for linear interpolation; out of
    order below 0.2.

    Noise model
    -----------
    White noise of the larger of the declared and the measured sigma (pose.noise), never less than rounded stamps
    (speed times 0.29 us) and stored digits; the filter's gain turns it into the error of a jump. A polynomial of two
    degrees less lets more motion through: where the two differ by more than noise can, that is the allowance, locally.
    Each place and axis is a comparison of its own.

    Cannot see
    ----------
    Jumps below about seven times the filter's share of the noise: some 28 mm in poses with 5 mm of noise, 3 um in exact
    ones. Interpolation by smooth curves, or under noise that hides its kinks (pose.noise sees noise that is then too
    small or too large). A jump that is spread over many poses.

    Sources
    -------
    G. Turin, An introduction to matched filters, IRE Trans. IT-6 (1960) 311; first principles in
    ``fedora_qa/estimators/imu/local_motion.py``.
    """

    name = "pose.continuity"
    needs = ("pose",)

    def measure(self, window: Window) -> PoseSamples | None:
        """Keep the window's own poses."""
        return owned_poses(window)

    def conclude(self, state: Sequence[PoseSamples], facts: Facts) -> Observation:
        """Look for jumps, stops and straight lines in the whole sequence."""
        poses = join_poses(state)
        seen = Coverage(len(poses.times_ns), len(facts.clocks["pose"].times_ns), "poses")
        unusable = why_unusable(facts, "pose")
        if unusable or len(poses.times_ns) < _FEWEST_POSES:
            return Observation(seen, unobservable=unusable or f"fewer than {_FEWEST_POSES} poses")
        still, of_timestamps = frozen_poses(poses), timestamp_defects(facts, "pose")
        model = facts.declared.pose or PoseModel()
        positions, rotations = Vectors(poses.positions_world_m), Orientations(poses.orientations_xyzw)
        position = _steps(poses, positions, max(model.position_sigma_m, position_floor_m(poses)))
        rotation = _steps(poses, rotations, max(model.rotation_sigma_rad, rotation_floor_rad(poses)))
        return Observation(
            seen,
            (
                *_jump(facts, poses, still, of_timestamps, position, "position", "m", 1.0, 0.1),
                *_jump(facts, poses, still, of_timestamps, rotation, "rotation", "deg", float(np.degrees(1)), 2.0),
                _stops(facts, poses, still),
                *_lines(facts, poses, of_timestamps),
            ),
        )


def _steps(poses: PoseSamples, curve: Curve, least_sigma: float) -> tuple[Steps, float]:
    level = noise_level(poses.times_ns, curve, order=NOISE_ORDER)
    sigma = max(least_sigma, 0.0 if level is None else level.sigma)
    found = [
        find_steps(poses.times_ns, curve, half_width=width, degree=degree, sigma=sigma)
        for width, degree in _STEP_FILTERS
        if 4 * width <= len(poses.times_ns)
    ]
    return sharpest(found, sigma), sigma


def _jump(
    facts: Facts,
    poses: PoseSamples,
    still: NDArray[np.intp],
    of_timestamps: tuple[Suspect, ...],
    found: tuple[Steps, float],
    name: str,
    unit: str,
    scale: float,
    material: float,
) -> tuple[Statistic, ...]:
    steps, sigma = found
    if not len(steps.before):
        return ()
    errors = sigma * steps.gains
    excess = (np.abs(steps.sizes) - steps.motion[:, None]) / errors[:, None]
    row, axis = np.unravel_index(np.argmax(excess), excess.shape)
    size, before = scale * float(steps.sizes[row, axis]), int(steps.before[row])
    after_ns = int(poses.times_ns[before + 1])
    if name == "position":
        readings = (*position_readings(poses, before, sigma), *lever_arm_suspects(poses, steps, sigma, int(row)))
    else:
        readings = orientation_readings(poses, before, sigma)
    teleport = 0.3 if len(readings) else 0.9
    frozen = bool(len(still)) and bool(np.min(np.abs(still - before)) <= _STEP_FILTERS[-1][0])
    return (
        Statistic(
            name=f"{name}_jump",
            value=size,
            unit=unit,
            standard_error=scale * float(errors[row]),
            model_error_bound=scale * float(steps.motion[row]),
            material=material,
            tests=steps.sizes.size,
            statement=f"The {name} jumps by {abs(size):.4g} {unit} within one step.",
            code=f"pose.continuity.{name}",
            where=place(facts, "pose", int(poses.times_ns[before]), after_ns),
            suspects=(
                *of_timestamps,
                *readings,
                Suspect("frozen_frames", "pose", 0.9 if frozen else 0.2),
                Suspect("teleport", "pose", 0.3 if frozen else teleport, size if unit == "m" else None, "m",
                        scale * float(errors[row]) if unit == "m" else None),
            ),
        ),
    )  # fmt: skip


def _stops(facts: Facts, poses: PoseSamples, still: NDArray[np.intp]) -> Statistic:
    where = place(facts, "pose", int(poses.times_ns[still[0]])) if len(still) else Where(stream="pose")
    return count_of_faults(
        "frozen",
        len(still),
        "poses",
        statement=f"{len(still)} poses repeat the one before exactly while the body moves.",
        code="pose.continuity.frozen",
        where=where,
        suspects=(Suspect("frozen_frames", "pose", 0.95, float(len(still)), "samples"),),
    )


def _lines(facts: Facts, poses: PoseSamples, of_timestamps: tuple[Suspect, ...]) -> tuple[Statistic, ...]:
    found = interpolation_of(poses)
    if found is None:
        return ()
    own_hz = rate_hz(poses)
    lower_hz = own_hz / found.stride
    return (
        Statistic(
            name="curvature_evenness",
            value=found.evenness,
            unit="1",
            standard_error=0.0,
            expected=1.0,
            model_error_bound=1.0 - LEAST_EVENNESS,
            side="lower",
            statement=f"Positions lie on straight lines between poses {found.stride} apart: they are interpolated "
            f"from {lower_hz:.4g} to {own_hz:.4g} Hz.",
            code="pose.continuity.interpolated",
            where=place(facts, "pose", int(poses.times_ns[0]), int(poses.times_ns[-1])),
            suspects=(
                *of_timestamps,
                Suspect("interpolated_pose", "pose", 0.3 if of_timestamps else 0.95, lower_hz, "Hz"),
            ),
        ),
    )
