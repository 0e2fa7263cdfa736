"""Conventions and sensor models of engines, drivers and estimators that an exporter takes over as they are."""

import h5py
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Plan, Plant
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION


def left_handed_imu(file: h5py.File, plan: Plan) -> None:
    """Y points right: specific force is a vector, and angular velocity turns its sign with the hand."""
    replace_values(file, ACCELEROMETER, file[ACCELEROMETER][...] * np.array([1.0, -1.0, 1.0]))
    replace_values(file, GYRO, file[GYRO][...] * np.array([-1.0, 1.0, -1.0]))


def imu_askew(file: h5py.File, plan: Plan) -> None:
    """Both sensors are turned by so many degrees about a random axis."""
    turn = Rotation.from_rotvec(np.deg2rad(plan.size) * plan.direction())
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, turn.apply(file[key][...]))


def imu_smoothed(file: h5py.File, plan: Plan) -> None:
    """Samples are means over neighbours, with a Gaussian weight of so many ms to both sides."""
    sigma = 1000 * plan.size / float(np.median(np.diff(file["path/imu/ts"][...])))
    for key in (GYRO, ACCELEROMETER):
        replace_values(file, key, gaussian_filter1d(file[key][...], sigma, axis=0, mode="nearest"))


def gyro_warms_up(file: h5py.File, plan: Plan) -> None:
    """A bias grows from nothing to so many rad/s at the end, in a random direction."""
    samples = file[GYRO][...]
    replace_values(file, GYRO, samples + np.linspace(0, plan.size, len(samples))[:, None] * plan.direction())


def gyro_behind_accelerometer(file: h5py.File, plan: Plan) -> None:
    """The gyro's samples are those of so many samples before."""
    samples = file[GYRO][...]
    replace_values(file, GYRO, samples[np.clip(np.arange(len(samples)) - int(plan.size), 0, None)])


def accelerometer_saturates(file: h5py.File, plan: Plan) -> None:
    """No axis measures more than so many percent of the largest specific force."""
    samples = file[ACCELEROMETER][...]
    limit = plan.size / 100 * np.abs(samples).max()
    replace_values(file, ACCELEROMETER, np.clip(samples, -limit, limit))


def imu_axis_dead(file: h5py.File, plan: Plan) -> None:
    """An axis of the gyro gives zero within the plan's rows."""
    samples = file[GYRO][...]
    samples[plan.rows(len(samples)), int(plan.random.integers(3))] = 0.0
    replace_values(file, GYRO, samples)


def yaw_drifts(file: h5py.File, plan: Plan) -> None:
    """Attitudes turn about the vertical by a further so many degrees until the end; positions stay."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    angles = np.deg2rad(np.linspace(0, plan.size, len(attitude)))
    replace_values(file, ORIENTATION, (Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]) * attitude).as_quat())


def attitude_jumps(file: h5py.File, plan: Plan) -> None:
    """From an instant on, attitudes are turned by so many degrees about a random axis of the world."""
    attitude = Rotation.from_quat(file[ORIENTATION][...])
    turn = np.zeros((len(attitude), 3))
    turn[plan.rows(len(attitude)).start :] = np.deg2rad(plan.size) * plan.direction()
    replace_values(file, ORIENTATION, (Rotation.from_rotvec(turn) * attitude).as_quat())


def pose_of_the_camera(file: h5py.File, plan: Plan) -> None:
    """Attitudes are those of the depth camera's optical axes."""
    mount = np.asarray(file["metadata/cameras/depth"].attrs["T_body_camera"])
    attitude = Rotation.from_quat(file[ORIENTATION][...]) * Rotation.from_matrix(mount[:3, :3])
    replace_values(file, ORIENTATION, attitude.as_quat())


def world_of_the_first_pose(file: h5py.File, plan: Plan) -> None:
    """The world is the first body frame, which rolls by some more degrees, as visual odometry begins it."""
    attitude, position_m = Rotation.from_quat(file[ORIENTATION][...]), file[POSITION][...]
    roll = Rotation.from_rotvec(np.deg2rad(plan.size) * np.array([1.0, 0.0, 0.0]))
    world = roll * attitude[0].inv()
    replace_values(file, POSITION, world.apply(position_m - position_m[0]))
    replace_values(file, ORIENTATION, (world * attitude).as_quat())


def position_spikes(file: h5py.File, plan: Plan) -> None:
    """Three to nine single positions, anywhere, lie so many metres off, each in a direction of its own."""
    position_m = file[POSITION][...]
    count = int(plan.random.integers(3, 10))
    for row in plan.random.choice(np.arange(5, len(position_m) - 5), count, replace=False):
        position_m[row] += plan.size * plan.direction()
    replace_values(file, POSITION, position_m)


def camera_of(source: str, target: str) -> Plant:
    """K of one camera stands at another of another resolution."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file[f"metadata/cameras/{target}"].attrs
        K = np.array(file[f"metadata/cameras/{source}"].attrs["K"])
        # Where both have one size, K is that of an image of twice the size.
        attributes["K"] = np.diag([2.0, 2.0, 1.0]) @ K if np.allclose(K, attributes["K"]) else K

    return plant


def focal_of_rows(camera: str) -> Plant:
    """The vertical focal length is too large by so many percent, as of pixels that are not square."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file[f"metadata/cameras/{camera}"].attrs
        K = np.array(attributes["K"])
        K[1, 1] *= 1 + plan.size / 100
        attributes["K"] = K

    return plant


def mounted_elsewhere(camera: str) -> Plant:
    """The declared mounting lies so many metres off, in a random direction."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file[f"metadata/cameras/{camera}"].attrs
        mount = np.array(attributes["T_body_camera"])
        mount[:3, 3] += plan.size * plan.direction()
        attributes["T_body_camera"] = mount

    return plant


def optical_axes_forgotten(file: h5py.File, plan: Plan) -> None:
    """Mountings are those of links whose X points forward, not of optical frames whose Z does."""
    link = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    for camera in file["metadata/cameras"].values():
        mount = np.array(camera.attrs["T_body_camera"])
        mount[:3, :3] = mount[:3, :3] @ link
        camera.attrs["T_body_camera"] = mount


def events_turned_by_half(file: h5py.File, plan: Plan) -> None:
    """The sensor is built in upside down, and nothing turns its events."""
    attributes = file["metadata/cameras/events"].attrs
    for axis, extent in (("x", int(attributes["width"])), ("y", int(attributes["height"]))):
        values = file[f"path/events/{axis}"][...]
        replace_values(file, f"path/events/{axis}", (extent - 1 - values).astype(values.dtype))


def events_on_even_pixels(file: h5py.File, plan: Plan) -> None:
    """Coordinates count pairs of pixels, and were doubled."""
    for axis in "xy":
        values = file[f"path/events/{axis}"][...]
        replace_values(file, f"path/events/{axis}", values // 2 * 2)


def brighter_alone(file: h5py.File, plan: Plan) -> None:
    """All events are of brighter pixels, as where a bit is read as truth of presence."""
    replace_values(file, "path/events/p", np.ones_like(file["path/events/p"][...]))


def darker_lost(file: h5py.File, plan: Plan) -> None:
    """Events of darker pixels are absent within the plan's time."""
    kept = (file["path/events/p"][...] == 1) | ~plan.times_us(file["path/events/t"][...])
    keep_rows(file, "events", np.flatnonzero(kept))
    update_index_maps(file)


def part_silent(file: h5py.File, plan: Plan) -> None:
    """So many percent of the columns at one side give no events within the plan's time."""
    width = int(file["metadata/cameras/events"].attrs["width"])
    edge = round(width * plan.size / 100)
    columns = file["path/events/x"][...]
    silent = columns < edge if plan.random.random() < 0.5 else columns >= width - edge
    keep_rows(file, "events", np.flatnonzero(~(silent & plan.times_us(file["path/events/t"][...]))))
    update_index_maps(file)


def refractory(file: h5py.File, plan: Plan) -> None:
    """A pixel is blind for so many ms after each event that it sends."""
    camera = file["metadata/cameras/events"].attrs
    pixels = file["path/events/y"][...].astype(np.int64) * int(camera["width"]) + file["path/events/x"][...]
    ready_us = np.full(int(pixels.max()) + 1, np.iinfo(np.int64).min)
    kept = np.zeros(len(pixels), dtype=bool)
    for row, (pixel, stamp_us) in enumerate(zip(pixels.tolist(), file["path/events/t"][...].tolist(), strict=True)):
        if stamp_us >= ready_us[pixel]:
            kept[row] = True
            ready_us[pixel] = stamp_us + round(1000 * plan.size)
    keep_rows(file, "events", np.flatnonzero(kept))
    update_index_maps(file)


def rows_burst(file: h5py.File, plan: Plan) -> None:
    """So many times in the file, all pixels of a row fire at one instant."""
    attributes = file["metadata/cameras/events"].attrs
    width, height = int(attributes["width"]), int(attributes["height"])
    stamps_us = file["path/events/t"][...]
    bursts = int(plan.size)
    instants_us = plan.random.integers(stamps_us[0] + 1, stamps_us[-1], bursts)
    more = {
        "x": np.tile(np.arange(width), bursts),
        "y": np.repeat(plan.random.integers(height, size=bursts), width),
        "t": np.repeat(instants_us, width),
        "p": np.repeat(plan.random.integers(2, size=bursts), width),
    }
    for name, values in more.items():
        old = file[f"path/events/{name}"][...]
        replace_values(file, f"path/events/{name}", np.concatenate([old, values.astype(old.dtype)]))
    keep_rows(file, "events", np.lexsort([file[f"path/events/{name}"][...] for name in "pxyt"]))
    update_index_maps(file)
