"""Depth that renderers, sensors and decoders give in their own way."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan, Plant

DEPTH = "path/depth"

CARLA_DECADES = 5.70378
"""Natural logarithm of the far plane over the nearest depth in CARLA's conversion to logarithmic depth."""


def _rays(file: h5py.File) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return x/z and y/z of the ray of each pixel."""
    K = np.asarray(file["metadata/cameras/depth"].attrs["K"])
    rows, columns = np.indices(file[DEPTH].shape[1:])
    return (columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1]


def _multiply(file: h5py.File, factor: NDArray[np.float64]) -> None:
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, (depth * factor).astype(depth.dtype))


def logarithmic_in_bytes(file: h5py.File, plan: Plan) -> None:
    """The logarithm of depth over the far plane went through 8 bits."""
    far = 1000 * float(file["metadata/depth_range"][1])
    share = np.clip(1 + np.log(file[DEPTH][...].astype(np.float64) / far) / CARLA_DECADES, 0, 1)
    stored = np.rint(255 * share) / 255
    replace_values(file, DEPTH, (far * np.exp((stored - 1) * CARLA_DECADES)).astype(np.float32))


def invalid_as(value: float) -> Plant:
    """What has no depth has a value, mm, that another convention gives to it."""

    def plant(file: h5py.File, plan: Plan) -> None:
        depth = file[DEPTH][...]
        replace_values(file, DEPTH, np.where(np.isnan(depth), np.float32(value), depth))

    return plant


def over_ground(file: h5py.File, plan: Plan) -> None:
    """Depth is the horizontal distance from the camera: rays go out from the axis of a cylinder."""
    _multiply(file, np.hypot(1.0, _rays(file)[0]))


def corrected_twice(file: h5py.File, plan: Plan) -> None:
    """Depth was z already, and is divided by the length of the ray to z = 1."""
    across, down = _rays(file)
    _multiply(file, 1 / np.sqrt(1 + across**2 + down**2))


def pairs_exchanged(file: h5py.File, plan: Plan) -> None:
    """Frames with an even number and those that follow them are exchanged, in the whole file."""
    depth = file[DEPTH][...]
    order = np.arange(len(depth))
    last = len(order) // 2 * 2
    order[:last] = order[:last].reshape(-1, 2)[:, ::-1].ravel()
    replace_values(file, DEPTH, depth[order])


def frames_overtake(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows, every other frame comes with its stamp before the one that precedes it."""
    order = np.arange(len(file["path/depth_ts"]))
    rows = plan.rows(len(order) - 1)
    for row in range(rows.start, rows.stop, 2):
        order[[row, row + 1]] = order[[row + 1, row]]
    keep_rows(file, "depth", order)
    update_index_maps(file)


def in_metres_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows are in metres."""
    depth = file[DEPTH][...]
    depth[plan.rows(len(depth))] /= np.float32(1000)
    replace_values(file, DEPTH, depth)


def as_whole_millimetres(file: h5py.File, plan: Plan) -> None:
    """Frames are 16-bit whole numbers, and what has no depth is 0."""
    replace_values(file, DEPTH, np.rint(np.nan_to_num(file[DEPTH][...], nan=0.0)).astype(np.uint16))


def bytes_in_other_order(file: h5py.File, plan: Plan) -> None:
    """Depth is 24 bits in three channels, for up to 1000 m, and the first channel is taken for the last."""
    depth = file[DEPTH][...].astype(np.float64)
    whole = np.rint(np.nan_to_num(depth, nan=0.0) / 1e6 * (2**24 - 1)).astype(np.int64)
    low, middle, high = whole & 255, whole >> 8 & 255, whole >> 16
    decoded = (high + (middle << 8) + (low << 16)) / (2**24 - 1) * 1e6
    replace_values(file, DEPTH, np.where(np.isnan(depth), np.nan, decoded).astype(np.float32))


def smoothed_over_time(file: h5py.File, plan: Plan) -> None:
    """A frame keeps so many percent of the one before wherever both have a depth."""
    depth = file[DEPTH][...].astype(np.float64)
    share = plan.size / 100
    for number in range(1, len(depth)):
        mixed = share * depth[number - 1] + (1 - share) * depth[number]
        depth[number] = np.where(np.isnan(mixed), depth[number], mixed)
    replace_values(file, DEPTH, depth.astype(np.float32))
