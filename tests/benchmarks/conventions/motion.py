"""Conventions of poses and of the IMU."""

from collections.abc import Callable
from itertools import permutations
from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.conventions.convention import (
    ACCELEROMETER,
    GYRO,
    ORIENTATION,
    POSITION,
    Array,
    Change,
    Convention,
    both,
    mapped,
    rewrite,
    times,
)

_OTHER_AXES: Final = ("pose:frame_convention", "pose:axes_swapped")
_OTHER_SIGNS: Final = (*_OTHER_AXES, "pose:quaternion_inverted", "pose:quaternion_order")
_OF_IMU: Final = ("imu:frame_convention", "imu:axes_swapped")
_GRAVITY_M_S2: Final = 9.80665

OPTICAL: Final = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of the body of a camera that looks straight ahead, from its optical ones."""
_FRD: Final = np.diag([1.0, -1.0, -1.0])
_NED: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_Y_UP: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_EXCHANGE: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def _yaw(degrees: float) -> Array:
    return np.asarray(Rotation.from_euler("z", degrees, degrees=True).as_matrix())


def _rotated(by: Callable[[Rotation], Rotation]) -> Change:
    return mapped(ORIENTATION, by=lambda q: np.asarray(by(Rotation.from_quat(q)).as_quat()))


def _body(axes: Array) -> Change:
    return _rotated(lambda attitude: attitude * Rotation.from_matrix(axes))


def _positions(axes: Array) -> Change:
    return mapped(POSITION, by=lambda position: position @ axes.T)


def _world(axes: Array) -> Change:
    return both(_positions(axes), _rotated(lambda attitude: Rotation.from_matrix(axes) * attitude))


def _both_axes(axes: Array) -> Change:
    turn = Rotation.from_matrix(axes)
    return both(_positions(axes), _rotated(lambda attitude: turn * attitude * turn.inv()))


def _sensors(axes: Array, *keys: str) -> Change:
    return mapped(*(keys or (GYRO, ACCELEROMETER)), by=lambda vectors: vectors @ axes.T)


def _attitudes(file: h5py.File) -> Rotation:
    times, at = file["path/pose/ts"][()], file["path/imu/ts"][()]
    return Slerp(times, Rotation.from_quat(file[ORIENTATION][()]))(np.clip(at, times[0], times[-1]))


def _in_world(*keys: str) -> Change:
    def change(file: h5py.File) -> None:
        for key in keys:
            rewrite(file, key, _attitudes(file).apply(file[key][()]))

    return change


def _gravity_removed(times: float) -> Change:
    def change(file: h5py.File) -> None:
        up = _attitudes(file).inv().apply([0.0, 0.0, 1.0])
        rewrite(file, ACCELEROMETER, file[ACCELEROMETER][()] - times * _GRAVITY_M_S2 * up)

    return change


def _inverted(file: h5py.File) -> None:
    attitude = Rotation.from_quat(file[ORIENTATION][()]).inv()
    rewrite(file, POSITION, -attitude.apply(file[POSITION][()]))
    rewrite(file, ORIENTATION, attitude.as_quat())


def _in_order(order: tuple[int, ...]) -> Callable[[Array], Array]:
    return lambda q: q[:, list(order)]


def _with_negated(place: int) -> Callable[[Array], Array]:
    return lambda q: q * np.where(np.arange(4) == place, -1, 1)


POSES: Final = {
    **{
        f"quaternions {''.join('xyzw'[place] for place in order)}": Convention(
            ("pose:quaternion_order",), mapped(ORIENTATION, by=_in_order(order))
        )
        for order in permutations(range(4))
        if order != (0, 1, 2, 3)
    },
    **{
        f"quaternions with {'xyz'[place]} negated": Convention(
            _OTHER_SIGNS, mapped(ORIENTATION, by=_with_negated(place))
        )
        for place in range(3)
    },
    "inverse quaternions wxyz": Convention(
        ("pose:quaternion_order", "pose:quaternion_inverted"),
        mapped(ORIENTATION, by=lambda q: (q * [-1, -1, -1, 1])[:, [3, 0, 1, 2]]),
    ),
    "poses inverted": Convention(("pose:quaternion_inverted",), _inverted),
    "poses of the optical frame": Convention(_OTHER_AXES, _body(OPTICAL)),
    "poses of OpenGL's camera": Convention(_OTHER_AXES, _body(OPTICAL @ _FRD)),
    "poses of a body of X forward, Y right, Z down": Convention(_OTHER_AXES, _body(_FRD)),
    "poses in north, east, down": Convention(_OTHER_AXES, _world(_NED)),
    "poses in north, east, down, of such a body": Convention(_OTHER_AXES, both(_world(_NED), _body(_FRD))),
    "poses in a world of Y up": Convention(_OTHER_AXES, _world(_Y_UP)),
    "poses in optical axes of world and body": Convention(_OTHER_AXES, _both_axes(OPTICAL.T)),
    "poses of Y up in world and body": Convention(_OTHER_AXES, _both_axes(_Y_UP)),
    "poses of a body and a world turned by 90 deg": Convention(_OTHER_AXES, _both_axes(_yaw(90.0))),
    "positions in a world turned by 90 deg": Convention(_OTHER_AXES, _positions(_yaw(90.0))),
    "positions in a world turned by 30 deg": Convention(_OTHER_AXES, _positions(_yaw(30.0))),
    **{
        f"positions with {'xyz'[place]} negated": Convention(
            _OTHER_AXES, _positions(np.diag(np.where(np.arange(3) == place, -1.0, 1.0)))
        )
        for place in range(3)
    },
    "positions yxz": Convention(_OTHER_AXES, _positions(_EXCHANGE)),
    "positions zxy": Convention(_OTHER_AXES, _positions(np.eye(3)[[2, 0, 1]])),
    "poses left-handed by Y": Convention(
        _OTHER_AXES, both(_positions(np.diag([1.0, -1.0, 1.0])), mapped(ORIENTATION, by=lambda q: q * [-1, 1, -1, 1]))
    ),
    "angles combined in reverse order": Convention(
        _OTHER_AXES,
        _rotated(lambda attitude: Rotation.from_euler("xyz", attitude.as_euler("zyx")[:, ::-1])),
    ),
    **{
        f"positions times {factor:g}": Convention(("pose:unit_mm_m",), mapped(POSITION, by=times(factor)))
        for factor in (100.0, 1000.0, 0.01, 0.3048)
    },
}

IMU: Final = {
    "IMU in optical axes": Convention(_OF_IMU, _sensors(OPTICAL.T)),
    "IMU of X forward, Y right, Z down": Convention(_OF_IMU, _sensors(_FRD)),
    "IMU yxz": Convention(_OF_IMU, _sensors(_EXCHANGE)),
    "IMU turned by 45 deg": Convention(_OF_IMU, _sensors(_yaw(45.0))),
    "IMU turned by 180 deg": Convention(_OF_IMU, _sensors(_yaw(180.0))),
    "IMU in the world": Convention(_OF_IMU, _in_world(GYRO, ACCELEROMETER)),
    "gyro in optical axes": Convention(_OF_IMU, _sensors(OPTICAL.T, GYRO)),
    "gyro of X forward, Y right, Z down": Convention(_OF_IMU, _sensors(_FRD, GYRO)),
    "gyro yxz": Convention(_OF_IMU, _sensors(_EXCHANGE, GYRO)),
    "gyro negated": Convention(_OF_IMU, _sensors(-np.eye(3), GYRO)),
    "gyro in the world": Convention(_OF_IMU, _in_world(GYRO)),
    **{
        f"gyro with {'xyz'[place]} negated": Convention(
            _OF_IMU, _sensors(np.diag(np.where(np.arange(3) == place, -1.0, 1.0)), GYRO)
        )
        for place in range(3)
    },
    **{
        f"gyro times {factor:.3g}": Convention(("imu:unit_deg_rad",), mapped(GYRO, by=times(factor)))
        for factor in (180 / np.pi, np.pi / 180, 1000.0)
    },
    "accelerometer in optical axes": Convention(_OF_IMU, _sensors(OPTICAL.T, ACCELEROMETER)),
    "accelerometer of X forward, Y right, Z down": Convention(
        (*_OF_IMU, "imu:gravity_sign"), _sensors(_FRD, ACCELEROMETER)
    ),
    "accelerometer negated": Convention((*_OF_IMU, "imu:gravity_sign"), _sensors(-np.eye(3), ACCELEROMETER)),
    "accelerometer with x negated": Convention(_OF_IMU, _sensors(np.diag([-1.0, 1.0, 1.0]), ACCELEROMETER)),
    "accelerometer with y negated": Convention(_OF_IMU, _sensors(np.diag([1.0, -1.0, 1.0]), ACCELEROMETER)),
    "accelerometer in the world": Convention(_OF_IMU, _in_world(ACCELEROMETER)),
    "gravity removed": Convention(("imu:gravity_missing",), _gravity_removed(1.0)),
    "gravity removed twice": Convention(("imu:gravity_sign",), _gravity_removed(2.0)),
    "gravity added again": Convention(("imu:gravity_magnitude", "imu:gravity_sign"), _gravity_removed(-1.0)),
    "gravity removed along the body": Convention(
        ("imu:gravity_missing",), mapped(ACCELEROMETER, by=lambda forces: forces - [0.0, 0.0, _GRAVITY_M_S2])
    ),
}
