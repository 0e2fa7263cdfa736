"""Clocks, sensors, drivers and trackers of real hardware, which fail in ways that simulators do not have."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.layout.canonical import TIMESTAMPS_OF
from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

EVENT_TIME = "path/events/t"
COLOUR = "path/rgb"


def imu_clock_slewed(file: h5py.File, plan: Plan) -> None:
    """Within a while the clock gains so many ppm; afterwards it runs right again, and stays ahead."""
    stamps_us = file[TIMESTAMPS_OF["imu"]][...]
    span_us = float(stamps_us[-1] - stamps_us[0])
    inside_us = np.clip(stamps_us - stamps_us[0] - plan.begin * span_us, 0, (plan.end - plan.begin) * span_us)
    replace_values(file, TIMESTAMPS_OF["imu"], stamps_us + np.rint(inside_us * plan.size / 1e6).astype(np.int64))


def colour_stamps_jitter(file: h5py.File, plan: Plan) -> None:
    """Stamps of frames scatter with a standard deviation, ms, and stay in order."""
    stamps_us = file[TIMESTAMPS_OF["rgb"]][...]
    moved_us = stamps_us + np.rint(plan.random.normal(0.0, 1000 * plan.size, len(stamps_us))).astype(np.int64)
    replace_values(file, TIMESTAMPS_OF["rgb"], np.maximum.accumulate(moved_us))
    update_index_maps(file)


def _restamp_events(file: h5py.File, stamps_us: NDArray[np.int64]) -> None:
    """Store other times of events, in their order."""
    replace_values(file, EVENT_TIME, stamps_us)
    keep_rows(file, "events", np.argsort(stamps_us, kind="stable"))
    update_index_maps(file)


def stamped_by_row(file: h5py.File, plan: Plan) -> None:
    """The sensor is read row by row: events of the last row are late by so many ms, those of the first are not."""
    height = int(file["metadata/cameras/events"].attrs["height"])
    late_us = np.rint(1000 * plan.size * file["path/events/y"][...] / (height - 1)).astype(np.int64)
    _restamp_events(file, file[EVENT_TIME][...] + late_us)


def time_bits_flip(file: h5py.File, plan: Plan) -> None:
    """In so many percent of the events one bit of the time, of 1 to 16 ms, is wrong; a merge sorts afterwards."""
    stamps_us = file[EVENT_TIME][...]
    wrong = plan.random.random(len(stamps_us)) < plan.size / 100
    bits = np.int64(1) << plan.random.integers(10, 15, len(stamps_us))
    _restamp_events(file, np.where(wrong, stamps_us ^ bits, stamps_us))


def polarity_inverted_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time, 1 stands for darker."""
    polarity = file["path/events/p"][...]
    within = plan.times_us(file[EVENT_TIME][...])
    replace_values(file, "path/events/p", np.where(within, 1 - polarity, polarity).astype(polarity.dtype))


def pixels_leak(file: h5py.File, plan: Plan) -> None:
    """Each pixel sends events of brighter light by itself, regularly, so many times a second, from a random phase."""
    camera = file["metadata/cameras/events"].attrs
    width, height = int(camera["width"]), int(camera["height"])
    stamps_us = file[EVENT_TIME][...]
    period_us = 1e6 / (plan.size * np.exp(plan.random.normal(0.0, 0.2, width * height)))
    first_us = stamps_us[0] + plan.random.random(width * height) * period_us
    times = [
        first_us + number * period_us for number in range(int((stamps_us[-1] - stamps_us[0]) / period_us.min()) + 1)
    ]
    inside = np.array(times) < stamps_us[-1]
    pixels = np.nonzero(inside)[1]
    more = {"x": pixels % width, "y": pixels // width, "t": np.array(times)[inside], "p": np.ones(len(pixels))}
    for name, values in more.items():
        old = file[f"path/events/{name}"][...]
        replace_values(file, f"path/events/{name}", np.concatenate([old, values.astype(old.dtype)]))
    keep_rows(file, "events", np.lexsort([file[f"path/events/{name}"][...] for name in "pxyt"]))
    update_index_maps(file)


def isolated_removed(file: h5py.File, plan: Plan) -> None:
    """A filter of background activity keeps an event where one of the 8 neighbours fired within so many ms before."""
    camera = file["metadata/cameras/events"].attrs
    columns, rows = (file[f"path/events/{axis}"][...].astype(np.int64) + 1 for axis in "xy")
    stride = int(camera["width"]) + 2
    latest_us = [-(10**15)] * (stride * (int(camera["height"]) + 2))
    around = [dy * stride + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dx, dy) != (0, 0)]
    within_us = round(1000 * plan.size)
    kept = []
    pixels, stamps_us = (rows * stride + columns).tolist(), file[EVENT_TIME][...].tolist()
    for row, (pixel, stamp_us) in enumerate(zip(pixels, stamps_us, strict=True)):
        if any(stamp_us - latest_us[pixel + step] <= within_us for step in around):
            kept.append(row)
        latest_us[pixel] = stamp_us
    keep_rows(file, "events", np.array(kept))
    update_index_maps(file)


def black_level(file: h5py.File, plan: Plan) -> None:
    """The sensor's pedestal of so many DN is not subtracted."""
    frames = file[COLOUR][...].astype(np.int64)
    replace_values(file, COLOUR, np.minimum(frames + int(plan.size), 255).astype(np.uint8))


def exposure_settles(file: h5py.File, plan: Plan) -> None:
    """The first frame is darker by so many percent; what is lacking falls by e in a sixth of the file."""
    frames = file[COLOUR][...]
    seconds = np.linspace(0, 6, len(frames))
    gains = 1 - plan.size / 100 * np.exp(-seconds)
    replace_values(file, COLOUR, np.rint(frames * gains[:, None, None, None]).astype(np.uint8))


def lines_out_of_step(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, lines begin so many pixels late, and what leaves at the right comes in at the left."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = np.roll(frames[rows], int(plan.size), axis=2)
    replace_values(file, COLOUR, frames)


def gyro_spikes(file: h5py.File, plan: Plan) -> None:
    """Four to nineteen single samples, anywhere, of one axis are off by so many rad/s."""
    samples = file[GYRO][...]
    count = int(plan.random.integers(4, 20))
    rows = plan.random.choice(np.arange(3, len(samples) - 3), count, replace=False)
    samples[rows, plan.random.integers(3, size=count)] += plan.size * plan.random.choice([-1.0, 1.0], count)
    replace_values(file, GYRO, samples)


def gyro_feels_acceleration(file: h5py.File, plan: Plan) -> None:
    """Specific force adds so many rad/s for each m/s^2 to the gyro's own axis."""
    replace_values(file, GYRO, file[GYRO][...] + plan.size * file[ACCELEROMETER][...])


def not_a_number_at_start(file: h5py.File, plan: Plan) -> None:
    """The first samples of the accelerometer have no value."""
    samples = file[ACCELEROMETER][...]
    samples[: int(plan.size)] = np.nan
    replace_values(file, ACCELEROMETER, samples)


def propellers_hum(file: h5py.File, plan: Plan) -> None:
    """A tone of so many m/s^2, between 47 and 190 Hz, in a random direction."""
    seconds = file[TIMESTAMPS_OF["imu"]][...] / 1e6
    rate_hz, phase = np.exp(plan.random.uniform(np.log(47), np.log(190))), plan.random.uniform(0, 2 * np.pi)
    tone = plan.size * np.sin(2 * np.pi * rate_hz * seconds + phase)
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] + tone[:, None] * plan.direction())


def yaw_from_the_course(file: h5py.File, plan: Plan) -> None:
    """Yaw is the direction of the way over ground; pitch and roll stay."""
    position_m = file[POSITION][...]
    east, north = np.gradient(position_m[:, :2], axis=0).T
    angles = Rotation.from_quat(file[ORIENTATION][...]).as_euler("ZYX")
    angles[:, 0] = np.arctan2(north, east)
    replace_values(file, ORIENTATION, Rotation.from_euler("ZYX", angles).as_quat())


def attitude_behind_position(file: h5py.File, plan: Plan) -> None:
    """Attitudes are those of so many samples before; positions are right."""
    attitude = file[ORIENTATION][...]
    replace_values(file, ORIENTATION, attitude[np.clip(np.arange(len(attitude)) - int(plan.size), 0, None)])
