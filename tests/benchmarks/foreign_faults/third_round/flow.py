"""Flow that scripts, codecs and trackers compute or store in another way."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

POSE_TIME = "path/pose/ts"

STEPS_PER_PIXEL = 4
"""Of motion vectors of H.264."""


def axes_exchanged_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows v stands before u."""
    for key in KEYS:
        fields = file[key][...]
        rows = plan.rows(len(fields))
        fields[rows] = fields[rows][..., ::-1].copy()
        replace_values(file, key, fields)


def of_every_other_pair(file: h5py.File, plan: Plan) -> None:
    """A field of 25 Hz is that of 50 Hz which begins with it."""
    starts_us = file["path/flow/25hz_ts"][...][:, 0]
    fine_us = file["path/flow/50hz_ts"][...][:, 0]
    rows = np.minimum(np.searchsorted(fine_us, starts_us), len(fine_us) - 1)
    replace_values(file, "path/flow/25hz", file["path/flow/50hz"][...][rows])


def of_late_poses(file: h5py.File, plan: Plan) -> None:
    """Flow is computed with poses whose timestamps were late by so many ms, and that were corrected afterwards.

    The tracker ran before the cameras: its pose at the first frame follows from the first two with their velocity.
    """
    keys = (POSE_TIME, POSITION, ORIENTATION)
    timestamps_us, position_m, quaternions = (file[key][...] for key in keys)
    attitude = Rotation.from_quat(quaternions)
    late_us = round(1000 * plan.size)
    back = -late_us / float(timestamps_us[1] - timestamps_us[0])
    earlier_m = position_m[0] + back * (position_m[1] - position_m[0])
    earlier = attitude[0] * Rotation.from_rotvec(back * (attitude[0].inv() * attitude[1]).as_rotvec())
    replace_values(file, POSE_TIME, np.r_[timestamps_us[0], timestamps_us + late_us])
    replace_values(file, POSITION, np.vstack([earlier_m, position_m]))
    replace_values(file, ORIENTATION, np.vstack([earlier.as_quat(), quaternions]))
    fields = recomputed(file)
    for key, values in zip(keys, (timestamps_us, position_m, quaternions), strict=True):
        replace_values(file, key, values)
    for key, values in fields.items():
        replace_values(file, key, values)


def as_length_and_angle(file: h5py.File, plan: Plan) -> None:
    """The first channel is the length of a vector, and the second its angle from u to v, 0 to 2 pi."""
    for key in KEYS:
        u, v = np.moveaxis(file[key][...], -1, 0)
        polar = np.stack([np.hypot(u, v), np.arctan2(v, u) % np.float32(2 * np.pi)], axis=-1)
        replace_values(file, key, polar.astype(np.float32))


def _means_of_blocks(field: NDArray[np.float32], side: int) -> NDArray[np.float64]:
    """Return the mean over the valid pixels of each pixel's block; 0 where it has none."""
    lines = [np.arange(0, extent, side) for extent in field.shape[:2]]

    def sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
        total = np.add.reduceat(np.add.reduceat(values, lines[0], axis=0), lines[1], axis=1)
        spread = total.repeat(side, axis=0).repeat(side, axis=1)[: values.shape[0], : values.shape[1]]
        return np.asarray(spread, dtype=np.float64)

    valid = np.isfinite(field)
    return sums(np.where(valid, field, 0.0).astype(np.float64)) / np.maximum(sums(valid.astype(np.float64)), 1)


def by_blocks_of_a_codec(file: h5py.File, plan: Plan) -> None:
    """Blocks of so many pixels have one vector, in quarters of a pixel."""
    for key in KEYS:
        fields = file[key][...]
        for row, field in enumerate(fields):
            means = np.rint(_means_of_blocks(field, int(plan.size)) * STEPS_PER_PIXEL) / STEPS_PER_PIXEL
            fields[row] = np.where(np.isfinite(field), means, np.nan)
        replace_values(file, key, fields)
