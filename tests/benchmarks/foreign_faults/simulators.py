"""Frames, depth and flow that renderers and simulators give in their own way, and an exporter takes over."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.clocks import delayed
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed, turning
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan

DEPTH = "path/depth"
COLOUR = "path/rgb"


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _replace_depth(file: h5py.File, depth_mm: NDArray[np.float64]) -> None:
    replace_values(file, DEPTH, depth_mm.astype(np.float32))


def rendered_behind_physics(file: h5py.File, plan: Plan) -> None:
    """Colour and depth show what was so many ms before their stamps."""
    for stream in ("rgb", "depth"):
        delayed(stream)(file, plan)


def transfer_declared(file: h5py.File, plan: Plan) -> None:
    """The declaration names the curve that the other setting of the engine has."""
    attributes = file[COLOUR].attrs
    attributes["transfer"] = "srgb" if attributes["transfer"] == "linear" else "linear"


def tone_mapped(file: h5py.File, plan: Plan) -> None:
    """Reinhard: L' = L (1 + k) / (1 + k L), L from 0 to 1, with the plan's k."""
    light = np.arange(256) / 255
    replace_values(file, COLOUR, _on_bytes(255 * light * (1 + plan.size) / (1 + plan.size * light))[file[COLOUR][...]])


def contrast_by_frame(file: h5py.File, plan: Plan) -> None:
    """Each frame is stretched to 0 to 255 between the quantiles of so many percent at both ends."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames):
        dark, bright = np.quantile(frame, [plan.size / 100, 1 - plan.size / 100])
        frames[number] = _on_bytes((frame - dark) * (255 / max(1.0, bright - dark)))
    replace_values(file, COLOUR, frames)


def alternate_frames_blended(file: h5py.File, plan: Plan) -> None:
    """Every other frame is the mean of its neighbours."""
    frames = file[COLOUR][...].astype(np.float64)
    frames[1:-1:2] = (frames[:-2:2] + frames[2::2]) / 2
    replace_values(file, COLOUR, _on_bytes(frames))


def letterboxed(file: h5py.File, plan: Plan) -> None:
    """Rows are squeezed towards the middle by so many percent, and black bars fill the rest."""
    frames = file[COLOUR][...]
    height, width = frames.shape[1:3]
    middle = (height - 1) / 2
    at = middle + (np.arange(height) - middle) / (1 - plan.size / 100)
    columns, rows = np.meshgrid(np.arange(width, dtype=float), at)
    bars = (at < 0) | (at > height - 1)
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(frame.astype(np.float64), columns, rows))
    frames[:, bars] = 0
    replace_values(file, COLOUR, frames)


def turned(file: h5py.File, plan: Plan) -> None:
    """Frames are turned about their middle by so many degrees; their edge continues outwards."""
    frames = file[COLOUR][...]
    rows, columns = np.indices(frames.shape[1:3]).astype(np.float64)
    dx, dy = columns - columns.mean(), rows - rows.mean()
    cos, sin = np.cos(np.deg2rad(plan.size)), np.sin(np.deg2rad(plan.size))
    at = columns.mean() + cos * dx + sin * dy, rows.mean() - sin * dx + cos * dy
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(frame.astype(np.float64), *at))
    replace_values(file, COLOUR, frames)


def of_another_near_plane(file: h5py.File, plan: Plan) -> None:
    """The z-buffer is made linear with a near plane that is too far by so many percent.

    The buffer holds b = (1/n - 1/z) / (1/n - 1/f).
    """
    near, far = 1000 * file["metadata/depth_range"][...]
    buffer = (1 / near - 1 / file[DEPTH][...].astype(np.float64)) / (1 / near - 1 / far)
    declared = near * (1 + plan.size / 100)
    _replace_depth(file, 1 / (1 / declared - buffer * (1 / declared - 1 / far)))


def share_of_range(file: h5py.File, plan: Plan) -> None:
    """Values are whole numbers to 65535: shares of the range between the near and the far plane."""
    near, far = 1000 * file["metadata/depth_range"][...]
    _replace_depth(file, np.rint((file[DEPTH][...].astype(np.float64) - near) / (far - near) * 65_535))


def clipped_far(file: h5py.File, plan: Plan) -> None:
    """The far plane lies before so many percent of the pixels, which have its depth."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, np.minimum(depth, np.nanquantile(depth, 1 - plan.size / 100).astype(np.float32)))


def in_half_precision(file: h5py.File, plan: Plan) -> None:
    """Metres were stored in 16 bits, of which 11 are the mantissa."""
    _replace_depth(file, (file[DEPTH][...] / 1000).astype(np.float16).astype(np.float64) * 1000)


def in_steps_of_disparity(file: h5py.File, plan: Plan) -> None:
    """Depth of stereo of a base line of 210 mm, whose disparity has steps of so many px and is never zero."""
    focal_base = file["metadata/cameras/depth"].attrs["K"][0, 0] * 210.0
    steps = np.maximum(np.rint(focal_base / file[DEPTH][...].astype(np.float64) / plan.size), 1.0)
    _replace_depth(file, focal_base / (steps * plan.size))


def holes_filled(file: h5py.File, plan: Plan) -> None:
    """What has no depth has that of the nearest pixel to its left, else to its right, that has."""
    depth = file[DEPTH][...]
    for _ in range(2):
        columns = np.where(np.isfinite(depth), np.arange(depth.shape[2]), 0)
        depth = np.take_along_axis(depth, np.maximum.accumulate(columns, axis=2), axis=2)[..., ::-1]
    replace_values(file, DEPTH, np.ascontiguousarray(depth))


def of_the_other_eye(file: h5py.File, plan: Plan) -> None:
    """Depth of a camera so many metres to the right: near pixels cover far ones, and gaps have no depth."""
    frames = file[DEPTH][...]
    focal = float(file["metadata/cameras/depth"].attrs["K"][0, 0])
    width = frames.shape[2]
    for number, frame in enumerate(frames):
        rows, columns = np.nonzero(np.isfinite(frame))
        depth = frame[rows, columns]
        at = np.rint(columns - focal * 1000 * plan.size / depth).astype(int)
        farthest_first = np.argsort(-depth, kind="stable")
        farthest_first = farthest_first[(at[farthest_first] >= 0) & (at[farthest_first] < width)]
        view = np.full_like(frame, np.nan)
        view[rows[farthest_first], at[farthest_first]] = depth[farthest_first]
        frames[number] = view
    replace_values(file, DEPTH, frames)


def without_turning(file: h5py.File, plan: Plan) -> None:
    """What the turning of the camera moves is subtracted."""
    whole, turned_alone = recomputed(file), turning(file)
    for key in KEYS:
        replace_values(file, key, (whole[key] - turned_alone[key]).astype(np.float32))
