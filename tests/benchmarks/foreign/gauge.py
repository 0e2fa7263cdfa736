"""Where the world and the clock have their origins."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values, timestamp_keys
from tests.benchmarks.foreign.transformation import Change


def shift_time(shift_us: int) -> Change:
    """Return the change that adds the same time to every timestamp."""

    def change(file: h5py.File) -> None:
        for key in timestamp_keys(file):
            replace_values(file, key, file[key][...] + shift_us)

    return change


def move_world(yaw_deg: float, translation_m: tuple[float, float, float]) -> Change:
    """Return the change that turns the world about the vertical and then moves it: gravity stays (0, 0, -g)."""

    def change(file: h5py.File) -> None:
        turn = Rotation.from_euler("z", yaw_deg, degrees=True)
        positions_m = turn.apply(file["path/pose/position"][...]) + np.array(translation_m)
        quaternions = (turn * Rotation.from_quat(file["path/pose/orientation"][...])).as_quat()
        replace_values(file, "path/pose/position", positions_m)
        replace_values(file, "path/pose/orientation", quaternions)

    return change


def first_pose_as_origin(file: h5py.File) -> None:
    """Put the origin of the world at the first position, with X along the first heading."""
    attitude = Rotation.from_quat(file["path/pose/orientation"][0])
    forward = attitude.apply([1.0, 0.0, 0.0])
    move_world(-float(np.degrees(np.arctan2(forward[1], forward[0]))), (0.0, 0.0, 0.0))(file)
    positions_m = file["path/pose/position"][...]
    replace_values(file, "path/pose/position", positions_m - positions_m[0])
