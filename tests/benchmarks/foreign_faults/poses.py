"""Poses that are in another convention, of another point, or not what was flown."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan

POSITION: Final = "path/pose/position"
ORIENTATION: Final = "path/pose/orientation"


def scalar_first(file: h5py.File, plan: Plan) -> None:
    """Quaternions are stored as w, x, y, z."""
    replace_values(file, ORIENTATION, np.roll(file[ORIENTATION][...], 1, axis=1))


def conjugated(file: h5py.File, plan: Plan) -> None:
    """Quaternions rotate from the world into the body."""
    replace_values(file, ORIENTATION, file[ORIENTATION][...] * np.array([-1.0, -1.0, -1.0, 1.0]))


def body_from_world(file: h5py.File, plan: Plan) -> None:
    """Both parts are those of the transform from the world into the body, as visual SLAM has it."""
    inverse = Rotation.from_quat(file[ORIENTATION][...]).inv()
    replace_values(file, POSITION, -inverse.apply(file[POSITION][...]))
    replace_values(file, ORIENTATION, inverse.as_quat())


def not_unit(file: h5py.File, plan: Plan) -> None:
    """The norm grows from 1 by so many percent to the end."""
    quaternions = file[ORIENTATION][...]
    norm = 1 + plan.size / 100 * np.linspace(0, 1, len(quaternions))
    replace_values(file, ORIENTATION, quaternions * norm[:, None])


def noise_by_component(file: h5py.File, plan: Plan) -> None:
    """Noise of that standard deviation is added to each component, and nothing normalises."""
    quaternions = file[ORIENTATION][...]
    replace_values(file, ORIENTATION, quaternions + plan.random.normal(0.0, plan.size, quaternions.shape))


def north_east_down(file: h5py.File, plan: Plan) -> None:
    """The world is NED and the body FRD, as autopilots have it."""
    world = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = np.diag([1.0, -1.0, -1.0])
    matrices = world @ Rotation.from_quat(file[ORIENTATION][...]).as_matrix() @ body
    replace_values(file, POSITION, file[POSITION][...] @ world.T)
    replace_values(file, ORIENTATION, Rotation.from_matrix(matrices).as_quat())


def positions_exchanged(file: h5py.File, plan: Plan) -> None:
    """Y and Z of the position are exchanged, as between engines with Y and with Z upwards."""
    replace_values(file, POSITION, file[POSITION][...][:, [0, 2, 1]])


def jumped(file: h5py.File, plan: Plan) -> None:
    """From an instant on, positions lie so many metres off, in a random direction."""
    position_m = file[POSITION][...]
    position_m[plan.rows(len(position_m)).start :] += plan.size * plan.direction()
    replace_values(file, POSITION, position_m)


def elsewhere(file: h5py.File, plan: Plan) -> None:
    """Positions are of a point so many metres from the body's origin, in a random direction."""
    arm = plan.size * plan.direction()
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    replace_values(file, POSITION, file[POSITION][...] + attitude.apply(arm))


def noisy(file: h5py.File, plan: Plan) -> None:
    """Positions have undeclared white noise of so many mm, attitudes of as many tenths of a mrad."""
    position_m = file[POSITION][...]
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    noise = Rotation.from_rotvec(plan.random.normal(0.0, plan.size / 1e4, position_m.shape))
    replace_values(file, POSITION, position_m + plan.random.normal(0.0, plan.size / 1000, position_m.shape))
    replace_values(file, ORIENTATION, (attitude * noise).as_quat())


def of_lower_rate(file: h5py.File, plan: Plan) -> None:
    """Poses are straight lines between those of so many Hz."""
    stamps_us = file["path/pose/ts"][...].astype(np.float64)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(stamps_us)))))
    kept = np.unique(np.r_[0 : len(stamps_us) : step, len(stamps_us) - 1])
    position_m, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    lines = [np.interp(stamps_us, stamps_us[kept], position_m[kept, axis]) for axis in range(3)]
    replace_values(file, POSITION, np.stack(lines, axis=1))
    replace_values(file, ORIENTATION, Slerp(stamps_us[kept], attitude[kept])(stamps_us).as_quat())


def smoothed(file: h5py.File, plan: Plan) -> None:
    """Each pose is the mean of those within so many ms of it."""
    stamps_us = file["path/pose/ts"][...]
    position_m, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    means: list[NDArray[np.float64]] = []
    attitudes: list[NDArray[np.float64]] = []
    for instant_us in stamps_us:
        near = np.abs(stamps_us - instant_us) <= 1000 * plan.size
        means.append(position_m[near].mean(axis=0))
        attitudes.append(attitude[near].mean().as_quat())
    replace_values(file, POSITION, np.array(means))
    replace_values(file, ORIENTATION, np.array(attitudes))


def far_in_single_precision(file: h5py.File, plan: Plan) -> None:
    """Positions were float32 so many km from the origin."""
    origin_m = 1000 * plan.size * np.array([0.8, -0.6, 0.0])
    far = (file[POSITION][...] + origin_m).astype(np.float32)
    replace_values(file, POSITION, far.astype(np.float64))


def of_other_scale(file: h5py.File, plan: Plan) -> None:
    """Ways are too long by so many percent, as from a single camera."""
    position_m = file[POSITION][...]
    replace_values(file, POSITION, position_m[0] + (position_m - position_m[0]) * (1 + plan.size / 100))


def noise_declared(file: h5py.File, plan: Plan) -> None:
    """Noise of so many mm, and as many mrad, is declared beyond what there is."""
    attributes = file["metadata/pose"].attrs
    for name in ("position_sigma", "rotation_sigma"):
        attributes[name] = np.float64(np.hypot(attributes[name], plan.size / 1000))
