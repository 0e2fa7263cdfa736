"""The streams that follow from the flight alone, IMU and pose, written piece by piece; nothing is rendered."""

from collections.abc import Iterator

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.imu import Imu
from fedora_generator.instants import pieces, timestamps_us
from fedora_generator.metadata import write_imu, write_pose
from fedora_generator.pose import PoseSensor
from fedora_generator.scene import Scene
from fedora_qa.layout.create import create_dataset


def write_imu_stream(file: h5py.File, scene: Scene, duration_us: int, seed: np.random.SeedSequence) -> None:
    """Write all inertial samples and their metadata.

    Parameters
    ----------
    file
        An open file without the stream.
    scene
        Its flight and inertial unit.
    duration_us
        Length of the sequence, us.
    seed
        Of the noise.
    """
    imu, flight, timestamps = (
        Imu(scene.imu, np.random.default_rng(seed)),
        scene.fly(),
        timestamps_us(duration_us, scene.imu.rate_hz),
    )
    names = ("angular_velocity", "linear_acceleration", "ts")
    rates, forces, times = (create_dataset(file, f"path/imu/{name}", {"M": len(timestamps)}) for name in names)
    for rows, times_us in _rows(timestamps):
        samples = imu.sample(flight, times_us)
        rates[rows], forces[rows] = samples.angular_velocities_body_rad_s, samples.specific_forces_body_m_s2
        times[rows] = times_us
    write_imu(file, scene)


def write_pose_stream(file: h5py.File, scene: Scene, duration_us: int, seed: np.random.SeedSequence) -> None:
    """Write all poses and their metadata.

    Parameters
    ----------
    file
        An open file without the stream.
    scene
        Its flight and the noise of its poses.
    duration_us
        Length of the sequence, us.
    seed
        Of the noise.
    """
    sensor = PoseSensor(scene.pose, np.random.default_rng(seed))
    timestamps = timestamps_us(duration_us, scene.rates.pose_hz)
    flight, names = scene.fly(), ("position", "orientation", "ts")
    positions, orientations, times = (
        create_dataset(file, f"path/pose/{name}", {"P": len(timestamps)}) for name in names
    )
    for rows, times_us in _rows(timestamps):
        samples = sensor.sample(flight, times_us)
        positions[rows], orientations[rows] = samples.positions_world_m, samples.orientations_xyzw
        times[rows] = times_us
    write_pose(file, scene)


def _rows(timestamps: NDArray[np.int64]) -> Iterator[tuple[slice, NDArray[np.int64]]]:
    start = 0
    for piece in pieces(timestamps):
        yield slice(start, start + len(piece)), piece
        start += len(piece)
