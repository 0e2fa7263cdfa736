"""What is learned from a file: a voxel grid of events for each interval, and the flow, disparity and motion over it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  (reading needs its filters)
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.geometry import so3
from tests.benchmarks.learning.budget import BINS, COLOUR_SIZE, EVENT_SIZE
from tests.benchmarks.learning.voxels import voxel_grid

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

MOTION_COLUMNS: Final = 6
"""Translation in m and rotation vector in rad, from the body at the start of an interval to the body at its end."""


@dataclass(frozen=True, slots=True)
class Targets:
    """What a network predicts of n intervals, on the pixels of the event camera.

    Attributes
    ----------
    flow_px
        (n, 2, H, W), in px of the colour camera over the interval, u right, v down; NaN is invalid.
    disparity_per_m
        (n, H, W) at the start of the interval; NaN is invalid.
    motion
        (n, 6) as ``MOTION_COLUMNS``.
    """

    flow_px: Float32
    disparity_per_m: Float32
    motion: Float32


@dataclass(frozen=True, slots=True)
class Samples:
    """Inputs (n, bins, H, W) and targets of n intervals."""

    voxels: Float32
    targets: Targets

    def __len__(self) -> int:
        return len(self.voxels)


EventsEdit = Callable[[Int64], Int64]
PosesEdit = Callable[[Float64, Float64], tuple[Float64, Float64]]
"""Takes and returns positions (n, 3), m, and orientations (n, 4) x, y, z, w."""


def read_samples(
    path: Path,
    rate_hz: int,
    most: int | None = None,
    *,
    by_index_map: bool = False,
    edit_events: EventsEdit | None = None,
    edit_poses: PosesEdit | None = None,
) -> Samples:
    """Read the samples of one file.

    Parameters
    ----------
    path
        A file of the canonical layout.
    rate_hz
        The rate of the flow.
    most
        Only the first intervals, so many; None: all.
    by_index_map
        Take the events of an interval from the map of the depth frames at its ends, and not by their timestamps. In a
        correct file both are the same.
    edit_events, edit_poses
        Change what was read before it is used.
    """
    with h5py.File(path) as file:
        intervals_us = file[f"path/flow/{rate_hz}hz_ts"][:most]
        flow_px = np.stack([_at_events(field) for field in file[f"path/flow/{rate_hz}hz"][:most]])
        depth_us, depth_map = file["path/depth_ts"][:], file["metadata/depth_to_event"][:]
        depth_rows = _rows_at(depth_us, intervals_us[:, 0])
        depth_mm = np.stack([_at_events(file["path/depth"][row]) for row in depth_rows])
        events = np.stack([file[f"path/events/{name}"][:].astype(np.int64) for name in "xytp"], axis=1)
        pose_us = file["path/pose/ts"][:]
        poses = file["path/pose/position"][:], file["path/pose/orientation"][:]
    if edit_events is not None:
        events = edit_events(events)
    if edit_poses is not None:
        poses = edit_poses(*poses)
    if by_index_map:
        bounds = np.clip(depth_map[_rows_at(depth_us, intervals_us)], 0, len(events))
    else:
        bounds = np.searchsorted(events[:, 2], intervals_us)
    voxels = np.stack(
        [
            voxel_grid(events[first:stop], start_us, stop_us, BINS, EVENT_SIZE)
            for (first, stop), (start_us, stop_us) in zip(bounds, intervals_us, strict=True)
        ]
    )
    pose_rows = _rows_at(pose_us, intervals_us)
    with np.errstate(divide="ignore"):
        disparity_per_m = np.where(depth_mm > 0, MM_PER_M / depth_mm, np.nan).astype(np.float32)
    return Samples(
        voxels,
        Targets(
            np.moveaxis(flow_px, -1, 1).astype(np.float32),
            disparity_per_m,
            motions(*poses, pose_rows[:, 0], pose_rows[:, 1]).astype(np.float32),
        ),
    )


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of several files as those of one."""
    return Samples(
        np.concatenate([part.voxels for part in parts]),
        Targets(
            *(
                np.concatenate([getattr(part.targets, name) for part in parts])
                for name in ("flow_px", "disparity_per_m", "motion")
            )
        ),
    )


def motions(positions_world_m: Float64, orientations_xyzw: Float64, starts: Int64, stops: Int64) -> Float64:
    """Return T_start^-1 T_stop (n, 6) between poses of some rows, as ``MOTION_COLUMNS``."""
    backwards = so3.inverse(orientations_xyzw[starts])
    steps_world_m = positions_world_m[stops] - positions_world_m[starts]
    steps_body_m = np.einsum("nij,nj->ni", so3.matrices_from_quaternions(backwards), steps_world_m)
    rotations_rad = so3.log_quaternion(so3.compose(backwards, orientations_xyzw[stops]))
    return np.concatenate([steps_body_m, rotations_rad], axis=1)


def chained(first_position_m: Float64, first_xyzw: Float64, motion: Float64) -> tuple[Float64, Float64]:
    """Return the poses (n + 1) that n motions lead to from a first pose: the inverse of ``motions``."""
    positions, orientations = [first_position_m], [first_xyzw]
    for step in motion:
        positions.append(positions[-1] + so3.matrices_from_quaternions(orientations[-1]) @ step[:3])
        orientations.append(so3.normalise(so3.compose(orientations[-1], so3.exp_quaternion(step[3:]))))
    return np.array(positions), np.array(orientations)


def _at_events(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the colour pixels (H, W, ...) at the centres of the event camera's pixels; both have one view."""
    (width, height), (colour_width, colour_height) = EVENT_SIZE, COLOUR_SIZE
    rows = ((np.arange(height) + 0.5) * colour_height / height).astype(np.int64)
    columns = ((np.arange(width) + 0.5) * colour_width / width).astype(np.int64)
    return image[rows[:, None], columns]


def _rows_at(timestamps_us: Int64, wanted_us: Int64) -> Int64:
    rows = np.searchsorted(timestamps_us, wanted_us)
    if not np.array_equal(timestamps_us[np.minimum(rows, len(timestamps_us) - 1)], wanted_us):
        raise ValueError("Expected a sample at each end of each interval, got none at some")
    return rows
