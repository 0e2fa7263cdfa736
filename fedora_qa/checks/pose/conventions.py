"""Which exchange of axes, units or quaternions a pose would have to undergo to go on across a jump."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.imu.conventions import signed_permutations
from fedora_qa.features import Feature
from fedora_qa.geometry import so3
from fedora_qa.sequence.window import PoseSamples

Float64 = NDArray[np.float64]

_CAPTURE_RATIO: Final = 0.02
"""Deviation over jump up to which a transform fits: chance brings one of the 48 that are tried so close in one jump of
2000, four times the square of this being the share of the sphere, a twentieth that of lengths."""

_NOISY_CAPTURE_RATIO: Final = 0.1
"""As far as noise may bring a transform off, of the jump: of the few of a quaternion chance brings one so close in one
jump of ten, and of the many of a position in one of three; beyond, a transform shows nothing."""

_NOISE_SIGMAS: Final = 3.0 * 6.0**0.5
"""Three sigma, on each axis, of a pose against the straight line through the two before it: weights 1, -2, 1."""

# Quaternions x, y, z, w: half a turn about (1, 1, 0) / sqrt(2) exchanges east and north and reverses up; half a turn
# about x reverses left and up.
_ROOT_HALF: Final = float(np.sqrt(0.5))
_NED_FROM_ENU: Final = np.array([_ROOT_HALF, _ROOT_HALF, 0.0, 0.0])
_FLU_FROM_FRD: Final = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class PoseTransform(Feature):
    """A transform of the poses behind a jump that makes them go on from those before it.

    Attributes
    ----------
    kind
        ``length_unit`` (metres against millimetres), ``axes`` (exchanged or reversed), ``component_order`` (w first
        against w last), ``inverse`` (of the rotation), ``north_east_down`` (world and body).
    axes
        Rows of the signed permutation, of ``axes`` only.
    """

    kind: Literal["length_unit", "axes", "component_order", "inverse", "north_east_down"]
    axes: tuple[tuple[int, ...], ...] = ()


def position_transforms(poses: PoseSamples, before: int, sigma_m: float) -> tuple[PoseTransform, ...]:
    """Return the transforms by which the position goes on across a jump, within noise.

    Parameters
    ----------
    poses
        Of the whole sequence.
    before
        Index of the last pose before the jump.
    sigma_m
        Noise of the positions on each axis, m.

    Returns
    -------
    Transforms within the capture range; empty where none makes the position go on.
    """
    positions_m = poses.positions_world_m
    # Straight on from the two positions before the jump.
    expected_m = positions_m[before] + (positions_m[before] - positions_m[before - 1] if before else 0.0)
    measured_m = positions_m[before + 1]
    deviations_m = (
        (float(np.linalg.norm(position_m - measured_m)), transform)
        for position_m, transform in _transformed_positions(expected_m)
    )
    return _nearest(deviations_m, jump=float(np.linalg.norm(measured_m - expected_m)), sigma=sigma_m)


def orientation_transforms(poses: PoseSamples, before: int, sigma_rad: float) -> tuple[PoseTransform, ...]:
    """Return the transforms by which the orientation goes on across a jump; parameters as of the positions."""
    q = so3.normalise(poses.orientations_xyzw)
    # On by the rotation between the two orientations before the jump.
    turn = so3.compose(so3.inverse(q[before - 1]), q[before]) if before else np.array([0.0, 0.0, 0.0, 1.0])
    expected, measured = so3.compose(q[before], turn), q[before + 1]
    deviations_rad = (
        (_angle_rad(transformed, measured), transform) for transformed, transform in _transformed_orientations(expected)
    )
    return _nearest(deviations_rad, jump=_angle_rad(expected, measured), sigma=sigma_rad)


def _nearest(
    deviations: Iterable[tuple[float, PoseTransform]], *, jump: float, sigma: float
) -> tuple[PoseTransform, ...]:
    """Return the transforms within the capture range; of several, those within twice the least deviation."""
    # A fixed share of the jump for exact poses; noise widens it, to a tenth of the jump at most.
    capture_range = max(_CAPTURE_RATIO * jump, min(_NOISE_SIGMAS * sigma, _NOISY_CAPTURE_RATIO * jump))
    captured = [(deviation, transform) for deviation, transform in deviations if deviation <= capture_range]
    least = min((deviation for deviation, _ in captured), default=0.0)
    return tuple(transform for deviation, transform in captured if deviation <= 2 * least or len(captured) == 1)


def _transformed_positions(position_m: Float64) -> Iterator[tuple[Float64, PoseTransform]]:
    # Into the part with another unit, and out of it.
    for unit in (MM_PER_M, 1.0 / MM_PER_M):
        yield unit * position_m, PoseTransform("length_unit")
    identity = tuple(tuple(int(value) for value in row) for row in np.eye(3))
    for axes in signed_permutations():
        if axes != identity:
            yield np.array(axes) @ position_m, PoseTransform("axes", axes)


def _transformed_orientations(q: Float64) -> Iterator[tuple[Float64, PoseTransform]]:
    """Yield each transform of a quaternion, and of one that was transformed the other way round."""
    # Components stored with w first in place of last, and the reverse.
    for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
        yield q[order], PoseTransform("component_order")
    yield so3.inverse(q), PoseTransform("inverse")
    # q' = q_ned_enu * q * q_frd_flu: both the world's and the body's axes are exchanged.
    north_east_down = so3.compose(so3.compose(_NED_FROM_ENU, q), _FLU_FROM_FRD)
    yield north_east_down, PoseTransform("north_east_down")


def _angle_rad(first: Float64, second: Float64) -> float:
    return float(np.linalg.norm(so3.log_quaternion(so3.compose(so3.inverse(first), second))))
