"""How values are stored: steps, types, codecs, places."""

from collections.abc import Iterable
from typing import Any, Final

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import DATASETS
from tests.benchmarks.foreign.rows import FLOW_RATES, present_keys, replace_values
from tests.benchmarks.foreign.transformation import Change

ORIENTATION: Final = "path/pose/orientation"
POSITION: Final = "path/pose/position"
GYRO: Final = "path/imu/angular_velocity"
ACCELEROMETER: Final = "path/imu/linear_acceleration"
FLOW: Final = tuple(f"path/flow/{rate}" for rate in FLOW_RATES)

GYRO_STEP_RAD_S: Final = np.radians(2000.0) / 2**15
"""16 bits over +-2000 deg/s."""

ACCELEROMETER_STEP_M_S2: Final = 16 * 9.80665 / 2**15
"""16 bits over +-16 g."""


def rounded(keys: Iterable[str], steps_per_unit: float) -> Change:
    """Return the change that rounds values to whole steps, in the type that they have."""

    def change(file: h5py.File) -> None:
        for key in keys:
            values = file[key][...]
            steps = np.rint(values.astype(np.float64) * steps_per_unit)
            replace_values(file, key, (steps / steps_per_unit).astype(values.dtype))

    return change


def through_type(keys: Iterable[str], dtype: str) -> Change:
    """Return the change that rounds values to those of another type, in the type that they have."""

    def change(file: h5py.File) -> None:
        for key in keys:
            values = file[key][...]
            replace_values(file, key, values.astype(dtype).astype(values.dtype))

    return change


def stored_as(keys: Iterable[str], dtype: str) -> Change:
    """Return the change that stores values in another type."""

    def change(file: h5py.File) -> None:
        for key in keys:
            replace_values(file, key, file[key][...].astype(dtype))

    return change


def timestamps_as(dtype: str) -> Change:
    """Return the change that stores all timestamps in another type, which holds whole microseconds."""

    def change(file: h5py.File) -> None:
        stored_as([key for key in present_keys(file) if DATASETS[key].is_timestamps], dtype)(file)

    return change


def imu_16_bit(file: h5py.File) -> None:
    """Round IMU samples to whole steps of a converter of 16 bits."""
    rounded([GYRO], 1.0 / GYRO_STEP_RAD_S)(file)
    rounded([ACCELEROMETER], 1.0 / ACCELEROMETER_STEP_M_S2)(file)


def imu_four_decimals(file: h5py.File) -> None:
    """Round IMU samples to four decimals, and store them in single precision."""
    rounded([GYRO, ACCELEROMETER], 1e4)(file)
    stored_as([GYRO, ACCELEROMETER], "f4")(file)


def normalised_float32(file: h5py.File) -> None:
    """Normalise quaternions in single precision, and store them in it."""
    quaternions = file[ORIENTATION][...].astype(np.float32)
    norms = np.sqrt(np.sum(quaternions**2, axis=1, keepdims=True, dtype=np.float32))
    replace_values(file, ORIENTATION, quaternions / norms)


def random_signs(file: h5py.File) -> None:
    """Give every quaternion a sign of its own: q and -q are one rotation."""
    quaternions = file[ORIENTATION][...]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(quaternions), 1))
    replace_values(file, ORIENTATION, signs * quaternions)


def positive_scalar_part(file: h5py.File) -> None:
    """Take of q and -q the one with w >= 0."""
    quaternions = file[ORIENTATION][...]
    replace_values(file, ORIENTATION, np.where(quaternions[:, 3:] < 0, -quaternions, quaternions))


def single_precision(file: h5py.File) -> None:
    """Store all samples in single precision, and compress all by gzip."""
    stored_as([GYRO, ACCELEROMETER, POSITION, ORIENTATION], "f4")(file)
    _store_again(file, chunks=True, compression="gzip", compression_opts=4)


def gzip_shuffle(file: h5py.File) -> None:
    """Compress all by gzip, one frame a chunk."""
    _store_by_frames(file, 1, compression="gzip", compression_opts=4, shuffle=True)


def lzf(file: h5py.File) -> None:
    """Compress all by LZF, in the chunks that h5py guesses."""
    _store_again(file, chunks=True, compression="lzf")


def bitshuffle(file: h5py.File) -> None:
    """Compress all by bit shuffle and LZ4, eight frames a chunk."""
    _store_by_frames(file, 8, **hdf5plugin.Bitshuffle(cname="lz4"))


def contiguous(file: h5py.File) -> None:
    """Store all without chunks and filters."""
    for key in present_keys(file):
        replace_values(file, key, file[key][...], chunks=None)


def big_endian(file: h5py.File) -> None:
    """Store all numbers with the most significant byte first."""
    for key in present_keys(file):
        values = file[key][...]
        replace_values(file, key, values.astype(values.dtype.newbyteorder(">")))


def soft_links(file: h5py.File) -> None:
    """Move images to a group of their own, and link them from where the format has them."""
    for name in ("rgb", "depth"):
        file.require_group("images")
        file.move(f"path/{name}", f"images/{name}")
        file[f"path/{name}"] = h5py.SoftLink(f"/images/{name}")


def _store_again(file: h5py.File, **storage: Any) -> None:
    for key in present_keys(file):
        if DATASETS[key].chunk_rows:
            replace_values(file, key, file[key][...], **storage)


def _store_by_frames(file: h5py.File, frames: int, **storage: Any) -> None:
    for key in present_keys(file):
        values: NDArray[Any] = file[key][...]
        if DATASETS[key].chunk_rows:
            rows = min(frames if DATASETS[key].is_image else DATASETS[key].chunk_rows, len(values))
            replace_values(file, key, values, chunks=(rows, *values.shape[1:]), **storage)
