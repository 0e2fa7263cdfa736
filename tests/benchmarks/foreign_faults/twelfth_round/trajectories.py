"""Poses that trackers, converters and loggers spoil."""

from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

MILLIMETRES: Final = 1000.0
"""In a metre."""


def two_axes_exchanged(file: h5py.File, plan: Plan) -> None:
    """Two axes of the position, any, are exchanged; attitudes stay."""
    axes = np.arange(3)
    first, second = plan.random.choice(3, 2, replace=False)
    axes[[first, second]] = axes[[second, first]]
    replace_values(file, POSITION, np.ascontiguousarray(file[POSITION][...][:, axes]))


def in_millimetres(file: h5py.File, plan: Plan) -> None:
    """Positions are in millimetres."""
    replace_values(file, POSITION, file[POSITION][...] * MILLIMETRES)


def of_another_point(file: h5py.File, plan: Plan) -> None:
    """Positions are those of a point of the body so many metres from its origin, in any direction."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    replace_values(file, POSITION, file[POSITION][...] + attitude.apply(plan.size * plan.direction()))


def real_part_first(file: h5py.File, plan: Plan) -> None:
    """Quaternions are w, x, y, z."""
    replace_values(file, ORIENTATION, np.ascontiguousarray(file[ORIENTATION][...][:, [3, 0, 1, 2]]))


def from_world_to_body(file: h5py.File, plan: Plan) -> None:
    """Quaternions take vectors of the world to the body; positions stay."""
    replace_values(file, ORIENTATION, Rotation.from_quat(file[ORIENTATION][...]).inv().as_quat())


def longer_with_each_turn(file: h5py.File, plan: Plan) -> None:
    """The norm of quaternions grows with the squared angle of each step, up to so many percent at the end.

    A step of the Euler method multiplies the norm by sqrt(1 + (angle / 2)^2).
    """
    quaternions = file[ORIENTATION][...]
    attitude = Rotation.from_quat(quaternions)
    squared_angles = (attitude[:-1].inv() * attitude[1:]).magnitude() ** 2
    grown = np.concatenate([[0.0], np.cumsum(squared_angles)])
    norms = np.exp(np.log1p(plan.size / 100) * grown / grown[-1])
    replace_values(file, ORIENTATION, quaternions * norms[:, None])


def elsewhere_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Positions of the plan's rows lie so many metres from their place, in the same direction."""
    position_m = file[POSITION][...]
    position_m[plan.rows(len(position_m))] += plan.size * plan.direction()
    replace_values(file, POSITION, position_m)


def interpolated_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows poses of so many Hz are joined by straight lines, and by even turns."""
    position_m, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    times_us = file["path/pose/ts"][...].astype(np.float64)
    rows = plan.rows(len(times_us))
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(times_us)))))
    kept = np.unique(np.r_[rows.start : rows.stop : step, rows.stop - 1])
    between_us = times_us[rows]
    position_m[rows] = np.stack([np.interp(between_us, times_us[kept], along) for along in position_m[kept].T], axis=1)
    quaternions = file[ORIENTATION][...]
    quaternions[rows] = Slerp(times_us[kept], attitude[kept])(between_us).as_quat()
    replace_values(file, POSITION, position_m)
    replace_values(file, ORIENTATION, quaternions)
