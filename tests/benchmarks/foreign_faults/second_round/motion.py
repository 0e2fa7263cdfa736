"""Poses of engines, networks, autopilots and trackers."""

import h5py
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from tests.benchmarks.foreign.rows import keep_rows, replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

STAMPS = "path/pose/ts"
METRES_PER_DEGREE = 111_320.0
"""Of latitude, on the mean."""


def _attitude(file: h5py.File) -> Rotation:
    return Rotation.from_quat(file[ORIENTATION][...])


def in_axes_of_unity(file: h5py.File, plan: Plan) -> None:
    """World: X east, Y up, Z north. Body: X right, Y up, Z forward."""
    world = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    body = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    matrices = world @ _attitude(file).as_matrix() @ body.T
    replace_values(file, POSITION, file[POSITION][...] @ world.T)
    replace_values(file, ORIENTATION, Rotation.from_matrix(matrices).as_quat())


def left_handed_in_centimetres(file: h5py.File, plan: Plan) -> None:
    """Y of world and body points to the other side, and lengths are in centimetres."""
    replace_values(file, POSITION, file[POSITION][...] * np.array([100.0, -100.0, 100.0]))
    replace_values(file, ORIENTATION, file[ORIENTATION][...] * np.array([-1.0, 1.0, -1.0, 1.0]))


def body_downwards(file: h5py.File, plan: Plan) -> None:
    """The body is FRD, and the world stays ENU."""
    replace_values(file, ORIENTATION, (_attitude(file) * Rotation.from_quat([1.0, 0.0, 0.0, 0.0])).as_quat())


def heading_from_north(file: h5py.File, plan: Plan) -> None:
    """Yaw counts clockwise from north, and is taken for one that counts from east to the left."""
    angles = _attitude(file).as_euler("ZYX")
    angles[:, 0] = np.pi / 2 - angles[:, 0]
    replace_values(file, ORIENTATION, Rotation.from_euler("ZYX", angles).as_quat())


def height_downwards(file: h5py.File, plan: Plan) -> None:
    """The third component of the position counts downwards."""
    replace_values(file, POSITION, file[POSITION][...] * np.array([1.0, 1.0, -1.0]))


def north_before_east(file: h5py.File, plan: Plan) -> None:
    """The first two components of the position are exchanged."""
    replace_values(file, POSITION, file[POSITION][...][:, [1, 0, 2]])


def over_a_network(file: h5py.File, plan: Plan) -> None:
    """Components of quaternions have so many bits, and positions whole centimetres."""
    steps = 2.0 ** (int(plan.size) - 1)
    quaternions = np.rint(file[ORIENTATION][...] * steps) / steps
    replace_values(file, ORIENTATION, quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
    replace_values(file, POSITION, np.rint(100 * file[POSITION][...]) / 100)


def in_half_precision(file: h5py.File, plan: Plan) -> None:
    """Components of quaternions went through 16-bit floating point, and nothing normalises them."""
    replace_values(file, ORIENTATION, file[ORIENTATION][...].astype(np.float16).astype(np.float64))


def extrapolated(file: h5py.File, plan: Plan) -> None:
    """Between poses of so many Hz, the last one moves on with the velocity between the last two."""
    stamps_us = file[STAMPS][...].astype(np.float64)
    position_m, attitude = file[POSITION][...], _attitude(file)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(stamps_us)))))
    latest = np.arange(len(stamps_us)) // step * step
    before = np.maximum(latest - step, 0)
    between_us = stamps_us[latest] - stamps_us[before]
    share = (stamps_us - stamps_us[latest]) / np.where(between_us > 0, between_us, 1.0)
    turn = (attitude[before].inv() * attitude[latest]).as_rotvec()
    moved = position_m[latest] + share[:, None] * (position_m[latest] - position_m[before])
    replace_values(file, POSITION, moved)
    replace_values(file, ORIENTATION, (attitude[latest] * Rotation.from_rotvec(share[:, None] * turn)).as_quat())


def through_keyframes(file: h5py.File, plan: Plan) -> None:
    """Poses are smooth curves, cubic splines, through those of so many Hz."""
    stamps_us = file[STAMPS][...].astype(np.float64)
    step = max(2, round(1e6 / plan.size / float(np.median(np.diff(stamps_us)))))
    kept = np.unique(np.r_[0 : len(stamps_us) : step, len(stamps_us) - 1])
    seconds = stamps_us / 1e6
    replace_values(file, POSITION, CubicSpline(seconds[kept], file[POSITION][...][kept])(seconds))
    replace_values(file, ORIENTATION, RotationSpline(seconds[kept], _attitude(file)[kept])(seconds).as_quat())


def overtake_each_other(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, a third of the messages come with their stamps before the one that precedes them."""
    order = np.arange(len(file[STAMPS]))
    rows = plan.rows(len(order) - 1)
    for row in range(rows.start, rows.stop, 3):
        order[[row, row + 1]] = order[[row + 1, row]]
    keep_rows(file, "pose", order)


def markers_hidden(file: h5py.File, plan: Plan) -> None:
    """Poses of the plan's rows are not a number."""
    for key in (POSITION, ORIENTATION):
        values = file[key][...]
        values[plan.rows(len(values))] = np.nan
        replace_values(file, key, values)


def noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Positions of the plan's rows have white noise of so many mm."""
    position_m = file[POSITION][...]
    rows = plan.rows(len(position_m))
    position_m[rows] += plan.random.normal(0.0, plan.size / 1000, position_m[rows].shape)
    replace_values(file, POSITION, position_m)


def by_columns(file: h5py.File, plan: Plan) -> None:
    """Samples are columns: shapes are (3, P) and (4, P)."""
    for key in (POSITION, ORIENTATION):
        replace_values(file, key, np.ascontiguousarray(file[key][...].T))


def in_degrees_of_latitude(file: h5py.File, plan: Plan) -> None:
    """East and north are longitude and latitude in degrees, at 40 degrees north; height stays in metres."""
    east = METRES_PER_DEGREE * np.cos(np.deg2rad(40.0))
    replace_values(file, POSITION, file[POSITION][...] / np.array([east, METRES_PER_DEGREE, 1.0]))


def odometry_accumulates(file: h5py.File, plan: Plan) -> None:
    """Positions have the error of a random walk, with a standard deviation of so many metres after a second."""
    seconds = np.diff(file[STAMPS][...], prepend=file[STAMPS][0]) / 1e6
    position_m = file[POSITION][...]
    steps = plan.random.normal(0.0, plan.size, position_m.shape) * np.sqrt(seconds)[:, None]
    replace_values(file, POSITION, position_m + np.cumsum(steps, axis=0))


def way_of_grid_north(file: h5py.File, plan: Plan) -> None:
    """Positions are turned by so many degrees about the vertical of the first one; attitudes are not."""
    position_m = file[POSITION][...]
    turn = Rotation.from_euler("z", plan.size, degrees=True)
    replace_values(file, POSITION, position_m[0] + turn.apply(position_m - position_m[0]))
