"""Samples of the IMU, and poses, that registers, queues, barometers and trackers change."""

from typing import Final

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round.samples import POSE_TIME
from tests.benchmarks.foreign_faults.sixth_round.timestamps import COLOUR_TIME

SETTLING: Final = 0.4
"""Of the length of a file, the time after which 63% of the warming are over."""


def accelerometer_warms_up(file: h5py.File, plan: Plan) -> None:
    """A vector of that length, in a random direction, comes in as exponentials do."""
    samples = file[ACCELEROMETER][...]
    share = 1 - np.exp(-np.linspace(0, 1, len(samples)) / SETTLING)
    replace_values(file, ACCELEROMETER, samples + plan.size * share[:, None] * plan.direction())


def axis_of_the_accelerometer_reversed(file: h5py.File, plan: Plan) -> None:
    """X or Y of the accelerometer has the other sign."""
    samples = file[ACCELEROMETER][...]
    samples[:, plan.random.integers(2)] *= -1
    replace_values(file, ACCELEROMETER, samples)


def words_slip_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows each of the six words of a sample is the one before it: x is in the place of y.

    Words are counts: the sensor's ranges are 16 g and 2000 deg/s.
    """
    rates, forces = file[GYRO][...], file[ACCELEROMETER][...]
    rows = plan.rows(len(rates))
    words = np.hstack([forces[rows] / (16 * 9.80665), rates[rows] / np.radians(2000)])
    words = np.roll(words, 1, axis=1)
    forces[rows], rates[rows] = words[:, :3] * 16 * 9.80665, words[:, 3:] * np.radians(2000)
    replace_values(file, GYRO, rates)
    replace_values(file, ACCELEROMETER, forces)


def sign_of_counts_lost(file: h5py.File, plan: Plan) -> None:
    """Negative rates are read without their sign: a range of twice so many deg/s is added."""
    rates = file[GYRO][...]
    replace_values(file, GYRO, np.where(rates < 0, rates + 2 * np.radians(plan.size), rates))


def stamped_by_the_frame_before(file: h5py.File, plan: Plan) -> None:
    """The time of a pose is that of the latest colour frame."""
    timestamps_us, frames_us = file[POSE_TIME][...], file[COLOUR_TIME][...]
    latest = np.clip(np.searchsorted(frames_us, timestamps_us, "right") - 1, 0, None)
    replace_values(file, POSE_TIME, np.minimum(timestamps_us, frames_us[latest]).astype(timestamps_us.dtype))


def dead_reckoning_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the position drifts as the square of time, by so many metres, and is then found again."""
    position = file[POSITION][...]
    rows = plan.rows(len(position))
    share = np.linspace(0, 1, rows.stop - rows.start)
    position[rows] += plan.size * share[:, None] ** 2 * plan.direction()
    replace_values(file, POSITION, position)


def height_of_a_barometer(file: h5py.File, plan: Plan) -> None:
    """Heights are in steps of so many metres; the other coordinates are as they were."""
    position = file[POSITION][...]
    position[:, 2] = np.rint(position[:, 2] / plan.size) * plan.size
    replace_values(file, POSITION, position)


def of_another_map_from_there_on(file: h5py.File, plan: Plan) -> None:
    """From the plan's first row on the world is turned by so many degrees about the vertical there."""
    position, attitude = file[POSITION][...], Rotation.from_quat(file[ORIENTATION][...])
    first = plan.rows(len(position)).start
    turn = Rotation.from_rotvec([0.0, 0.0, np.radians(plan.size)])
    quaternions = attitude.as_quat()
    position[first:] = position[first] + turn.apply(position[first:] - position[first])
    quaternions[first:] = (turn * attitude[first:]).as_quat()
    replace_values(file, POSITION, position)
    # Quaternions before that row are those of the file, to the bit.
    quaternions[:first] = file[ORIENTATION][...][:first]
    replace_values(file, ORIENTATION, quaternions)


def markers_wobble_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the position swings by so many mm, at 19 to 43 Hz, along a random direction."""
    position, timestamps_us = file[POSITION][...], file[POSE_TIME][...]
    rows = plan.rows(len(position))
    phase = 2 * np.pi * plan.random.uniform(19, 43) * (timestamps_us[rows] - timestamps_us[rows.start]) / 1e6
    position[rows] += plan.size / 1000 * np.sin(phase)[:, None] * plan.direction()
    replace_values(file, POSITION, position)
