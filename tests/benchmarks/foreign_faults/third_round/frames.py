"""Colour and depth frames that drivers, lenses, rectification, filters and uploads change."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan

COLOUR = "path/rgb"
DEPTH = "path/depth"


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def mirrored_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows are mirrored left to right."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = frames[rows][:, :, ::-1].copy()
    replace_values(file, COLOUR, frames)


def channels_reversed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Channels of the plan's rows are B, G, R."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = frames[rows][..., ::-1].copy()
    replace_values(file, COLOUR, frames)


def iris_opens_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In frames of the plan's rows light falls with the square of the radius, by so many percent to a corner."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    dy, dx = (np.arange(extent) - (extent - 1) / 2 for extent in frames.shape[1:3])
    squared = dy[:, None] ** 2 + dx**2
    frames[rows] = _on_bytes(frames[rows] * (1 - plan.size / 100 * squared / squared.max())[..., None])
    replace_values(file, COLOUR, frames)


def rectified(file: h5py.File, plan: Plan) -> None:
    """Frames are those of a camera that looks elsewhere: turned by so many degrees about an axis of its image."""
    frames = file[COLOUR][...]
    K = np.array(file["metadata/cameras/rgb"].attrs["K"])
    direction = plan.random.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(direction), np.sin(direction), 0.0])
    turn = Rotation.from_rotvec(np.deg2rad(plan.size) * axis).as_matrix()
    rows, columns = np.indices(frames.shape[1:3])
    at = np.tensordot(K @ turn @ np.linalg.inv(K), np.stack([columns, rows, np.ones_like(rows)]), axes=1)
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(frame.astype(np.float64), at[0] / at[2], at[1] / at[2]))
    replace_values(file, COLOUR, frames)


def of_the_right_eye(file: h5py.File, plan: Plan) -> None:
    """Frames are those of a camera so many metres to the right: a point moves to the left by f b / z."""
    frames = file[COLOUR][...]
    focal = float(file["metadata/cameras/rgb"].attrs["K"][0, 0])
    depth_us = file["path/depth_ts"][...]
    columns, rows = np.meshgrid(*(np.arange(extent, dtype=float) for extent in frames.shape[2:0:-1]))
    for number, instant_us in enumerate(file["path/rgb_ts"][...]):
        depth_m = file[DEPTH][int(np.argmin(np.abs(depth_us - instant_us)))].astype(np.float64) / 1000
        disparity = np.nan_to_num(focal * plan.size / depth_m, nan=0.0)
        at = columns
        for _ in range(4):
            at = columns + sampled(disparity, at, rows)
        frames[number] = _on_bytes(sampled(frames[number].astype(np.float64), at, rows))
    replace_values(file, COLOUR, frames)


def with_alpha(file: h5py.File, plan: Plan) -> None:
    """A fourth channel is 255 everywhere."""
    frames = file[COLOUR][...]
    replace_values(file, COLOUR, np.concatenate([frames, np.full_like(frames[..., :1], 255)], axis=-1))


def out_of_focus(file: h5py.File, plan: Plan) -> None:
    """Frames are blurred with a standard deviation of so many px."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(gaussian_filter(frame.astype(np.float64), (plan.size, plan.size, 0)))
    replace_values(file, COLOUR, frames)


def depth_a_frame_late_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Each of the plan's rows holds the frame before its own; the last of theirs is lost."""
    depth = file[DEPTH][...]
    source = np.arange(len(depth))
    source[plan.rows(len(depth))] -= 1
    replace_values(file, DEPTH, depth[np.maximum(source, 0)])


def depth_along_rays_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Depth of the plan's rows is the distance from the centre of the camera."""
    depth = file[DEPTH][...]
    K = np.asarray(file["metadata/cameras/depth"].attrs["K"])
    rows, columns = np.indices(depth.shape[1:])
    length = np.sqrt(1 + ((columns - K[0, 2]) / K[0, 0]) ** 2 + ((rows - K[1, 2]) / K[1, 1]) ** 2)
    depth[plan.rows(len(depth))] *= length.astype(depth.dtype)
    replace_values(file, DEPTH, depth)


def zero_blended_into_depth(file: h5py.File, plan: Plan) -> None:
    """What has no depth is 0, and a mean over 3 x 3 pixels is taken wherever one of these has none."""
    depth = file[DEPTH][...]
    for number, frame in enumerate(depth):
        invalid = np.isnan(frame)
        means = uniform_filter(np.nan_to_num(frame, nan=0.0), 3, mode="nearest")
        beside_invalid = uniform_filter(invalid.astype(np.float64), 3, mode="nearest") > 0.05
        depth[number] = np.where(beside_invalid, means, frame)
    replace_values(file, DEPTH, depth)


def depth_left_out(file: h5py.File, plan: Plan) -> None:
    """Frames are absent; their timestamps, map and camera are there."""
    del file[DEPTH]


def depth_part_never_sent(file: h5py.File, plan: Plan) -> None:
    """Stored bytes of the plan's frames are zero."""
    dataset = file[DEPTH].id
    rows = plan.rows(len(file[DEPTH]))
    for number in range(rows.start, rows.stop):
        _, stored = dataset.read_direct_chunk((number, 0, 0))
        dataset.write_direct_chunk((number, 0, 0), bytes(len(stored)))
