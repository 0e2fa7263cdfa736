"""A jump of the position and the one that takes it back: was it the origin that moved, or another point of the body?"""

from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.imu.local_motion import Steps
from fedora_qa.geometry import so3
from fedora_qa.sequence.window import PoseSamples

_SURE: Final = 5.0
"""Standard errors by which the jumps must differ in the world's axes for those of the body to be told from them."""

_MUCH_BETTER: Final = 0.2
"""Share of that by which they may still differ in the body's: what the motion adds to the jumps of exact poses."""

_WEIGHT: Final = 0.97


def lever_arm_suspects(poses: PoseSamples, steps: Steps, sigma_m: float, row: int) -> tuple[Suspect, ...]:
    """Suspect another point of the body between the jump in ``row`` of the steps and the largest one that undoes it.

    A point l of the body lies ``R_world_body l`` from its origin: poses that tell of it for a while jump there by
    ``R l`` and back by ``-R' l``. In the axes of the body the two undo each other, in those of the world only where the
    body has not turned between; there a shifted origin would have the same effect, and is not told apart.
    """
    there_and_back = _return_of(steps, sigma_m, row)
    if there_and_back is None:
        return ()
    rows = np.array(sorted((row, there_and_back)))
    jumps_m, errors_m = steps.sizes[rows], sigma_m * steps.gains[rows]
    R_world_body = so3.matrices_from_quaternions(so3.normalise(poses.orientations_xyzw[steps.before[rows]]))
    first, second = np.einsum("nji,nj->ni", R_world_body, jumps_m)
    off_body_m, off_world_m = float(np.abs(first + second).max()), float(np.abs(jumps_m.sum(axis=0)).max())
    noise_m = _SURE * float(np.linalg.norm(errors_m))
    if off_world_m <= noise_m or off_body_m > max(noise_m, _MUCH_BETTER * off_world_m):
        return ()
    arm_m = (first - second) / 2
    size_m = float(np.copysign(np.linalg.norm(arm_m), arm_m[np.argmax(np.abs(arm_m))]))
    return (Suspect("lever_arm", "pose", _WEIGHT, size_m, "m", float(np.linalg.norm(errors_m)) / 2),)


def _return_of(steps: Steps, sigma_m: float, row: int) -> int | None:
    """Return the row of the largest jump, of all beyond the filter's reach, that is about as large as the one given."""
    sizes_m, bounds_m = np.linalg.norm(steps.sizes, axis=1), _SURE * sigma_m * steps.gains + steps.motion
    apart = np.abs(steps.before - steps.before[row]) > steps.reach
    rival = np.where(apart & (sizes_m > bounds_m), sizes_m - bounds_m, -np.inf)
    best = int(np.argmax(rival))
    return best if np.isfinite(rival[best]) else None
