"""Odd readings of poses: which exchange of axes, units or quaternions would make a jump of what is no jump."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.imu.conventions import signed_permutations
from fedora_qa.geometry import so3
from fedora_qa.sequence.window import PoseSamples

Float64 = NDArray[np.float64]

_SAME: Final = 0.02
"""Share of the jump by which a reading may miss: chance brings one of the 48 that are tried so close in one jump of
2000, four times the square of this being the share of the sphere, a twentieth that of lengths."""

_MOST: Final = 0.1
"""As far as noise may bring a reading off, of the jump: of the few readings of a quaternion chance brings one so close
in one jump of ten, and of the many of a position in one of three; beyond, a reading tells nothing."""

_NOISE: Final = 3.0 * 6.0**0.5
"""Three sigma, on each axis, of a pose against the straight line through the two before it: weights 1, -2, 1."""

_WEIGHT: Final = 0.97
_ROOT_HALF: Final = float(np.sqrt(0.5))
_NED_FROM_ENU: Final = np.array([_ROOT_HALF, _ROOT_HALF, 0.0, 0.0])
_FLU_FROM_FRD: Final = np.array([1.0, 0.0, 0.0, 0.0])


def axes_cause(axes: tuple[tuple[int, ...], ...]) -> str:
    """Name an exchange of axes: that of two, or another convention."""
    matrix = np.array(axes)
    return "axes_swapped" if np.all(matrix >= 0) and int(np.trace(matrix)) == 1 else "frame_convention"


def position_readings(poses: PoseSamples, before: int, sigma_m: float) -> tuple[Suspect, ...]:
    """Return the readings by which the position goes on across the jump behind ``before``, within noise of sigma."""
    positions_m = poses.positions_world_m
    expected_m = positions_m[before] + (positions_m[before] - positions_m[before - 1] if before else 0.0)
    found_m = positions_m[before + 1]
    reach_m = _reach(float(np.linalg.norm(found_m - expected_m)), sigma_m)
    misses_m = ((float(np.linalg.norm(read_m - found_m)), suspect) for read_m, suspect in _as_positions(expected_m))
    return _nearest(misses_m, reach_m)


def orientation_readings(poses: PoseSamples, before: int, sigma_rad: float) -> tuple[Suspect, ...]:
    """Return the readings by which the orientation goes on across the jump behind ``before``, within noise of sigma."""
    q = so3.normalise(poses.orientations_xyzw)
    turned = so3.compose(so3.inverse(q[before - 1]), q[before]) if before else np.array([0.0, 0.0, 0.0, 1.0])
    expected, found = so3.compose(q[before], turned), q[before + 1]
    reach_rad = _reach(_angle_rad(expected, found), sigma_rad)
    return _nearest(((_angle_rad(read, found), suspect) for read, suspect in _as_orientations(expected)), reach_rad)


def _reach(jump: float, sigma: float) -> float:
    return max(_SAME * jump, min(_NOISE * sigma, _MOST * jump))


def _nearest(misses: Iterable[tuple[float, Suspect]], reach: float) -> tuple[Suspect, ...]:
    """Return the readings within reach; of those that noise alone does not tell apart, the nearest."""
    near = [(miss, suspect) for miss, suspect in misses if miss <= reach]
    least = min((miss for miss, _ in near), default=0.0)
    return tuple(suspect for miss, suspect in near if miss <= 2 * least or len(near) == 1)


def _as_positions(position_m: Float64) -> Iterator[tuple[Float64, Suspect]]:
    for unit in (MM_PER_M, 1.0 / MM_PER_M):
        yield unit * position_m, Suspect("unit_mm_m", "pose", _WEIGHT, MM_PER_M, "1")
    identity = tuple(tuple(int(value) for value in row) for row in np.eye(3))
    for axes in signed_permutations():
        if axes != identity:
            yield np.array(axes) @ position_m, Suspect(axes_cause(axes), "pose", _WEIGHT)


def _as_orientations(q: Float64) -> Iterator[tuple[Float64, Suspect]]:
    """Yield each reading of a quaternion, and of one that was read so the other way round."""
    for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
        yield q[order], Suspect("quaternion_order", "pose", _WEIGHT)
    yield so3.inverse(q), Suspect("quaternion_inverted", "pose", _WEIGHT)
    north_east_down = so3.compose(so3.compose(_NED_FROM_ENU, q), _FLU_FROM_FRD)
    yield north_east_down, Suspect("frame_convention", "pose", _WEIGHT)


def _angle_rad(one: Float64, other: Float64) -> float:
    return float(np.linalg.norm(so3.log_quaternion(so3.compose(so3.inverse(one), other))))
