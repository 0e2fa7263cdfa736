"""Colour and depth frames that renderers, filters, codecs and writers change."""

from typing import Final

import cv2
import h5py
import numpy as np
from scipy.ndimage import median_filter

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.fifth_round.frames import on_bytes
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA
from tests.benchmarks.foreign_faults.seventh_round.events import CHOICE, tiles_of
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR, DEPTH

CARLA_FAR_MM: Final = 1e6
"""Depth that all three bytes of CARLA stand for."""


def decoded_though_linear(file: h5py.File, plan: Plan) -> None:
    """The curve of sRGB is taken from frames that do not have it, so that they get darker."""
    values = np.arange(256) / 255
    light = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    replace_values(file, COLOUR, on_bytes(255 * light)[file[COLOUR][...]])


def late_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows are those of so many frames before."""
    frames = file[COLOUR][...]
    numbers = np.arange(len(frames))
    rows = plan.rows(len(frames))
    numbers[rows] = np.maximum(numbers[rows] - int(plan.size), 0)
    replace_values(file, COLOUR, frames[numbers])


def sharpened(file: h5py.File, plan: Plan) -> None:
    """So many times the difference from a blurred frame, of 1 px, is added."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames.astype(np.float64)):
        frames[number] = on_bytes(frame + plan.size * (frame - cv2.GaussianBlur(frame, (0, 0), 1.0)))
    replace_values(file, COLOUR, frames)


def in_565(file: h5py.File, plan: Plan) -> None:
    """Channels have 5, 6 and 5 bits, brought back to 0 to 255."""
    levels = np.array([31, 63, 31])
    frames = file[COLOUR][...].astype(np.float64)
    replace_values(file, COLOUR, on_bytes(np.rint(frames / 255 * levels) / levels * 255))


def compressed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows went through JPEG of that quality."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    for number in range(rows.start, rows.stop):
        # OpenCV takes B, G, R.
        _, stored = cv2.imencode(".jpg", frames[number][..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, int(plan.size)])
        decoded = cv2.imdecode(stored, cv2.IMREAD_COLOR)
        frames[number] = np.asarray(decoded)[..., ::-1]
    replace_values(file, COLOUR, frames)


def along_the_ground(file: h5py.File, plan: Plan) -> None:
    """Depth is the distance in the plane of the optical axis and the rows: z sqrt(1 + x^2)."""
    K = np.asarray(file[CAMERA + "depth"].attrs["K"])
    depth = file[DEPTH][...]
    x = (np.arange(depth.shape[2]) - K[0, 2]) / K[0, 0]
    replace_values(file, DEPTH, (depth * np.hypot(1, x)).astype(depth.dtype))


def of_two_bytes(file: h5py.File, plan: Plan) -> None:
    """Of the three bytes of CARLA's depth the lowest is 0."""
    depth = file[DEPTH][...]
    step_mm = CARLA_FAR_MM * 256 / (256**3 - 1)
    replace_values(file, DEPTH, (np.floor(depth / step_mm) * step_mm).astype(depth.dtype))


def invalid_as_minus_1(file: h5py.File, plan: Plan) -> None:
    """What has no depth is -1."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, np.where(np.isnan(depth), -1, depth).astype(depth.dtype))


def with_one_channel(file: h5py.File, plan: Plan) -> None:
    """Frames have a last axis of length 1."""
    replace_values(file, DEPTH, file[DEPTH][...][..., None])


def depth_upside_down_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Rows of the image are stored from below in the plan's frames."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    depth[rows] = depth[rows][:, ::-1]
    replace_values(file, DEPTH, depth)


def tile_of_depth_stale(file: h5py.File, plan: Plan) -> None:
    """In the plan's frames one of 3 x 3 tiles, one of those that change most, is that of the frame before them."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    begin, stop = max(1, rows.start), max(rows.stop, 2)
    change = np.nan_to_num(np.abs(depth[stop - 1] - depth[begin - 1]), nan=0.0)
    tiles = sorted(tiles_of(*depth.shape[:0:-1]), key=lambda tile: float(change[tile[1], tile[0]].mean()))
    columns, lines = tiles[-1 - int(plan.random.integers(CHOICE))]
    depth[begin:stop, lines, columns] = depth[begin - 1, lines, columns]
    replace_values(file, DEPTH, depth)


def depth_of_the_median_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's frames depth is the median of the pixels within so many px; what had none stays without."""
    depth = file[DEPTH][...]
    rows = plan.rows(len(depth))
    for number in range(rows.start, rows.stop):
        frame = depth[number]
        middle = median_filter(np.where(np.isnan(frame), np.inf, frame), 2 * int(plan.size) + 1, mode="nearest")
        depth[number] = np.where(np.isnan(frame) | np.isinf(middle), np.nan, middle)
    replace_values(file, DEPTH, depth)


def lens_of_depth(file: h5py.File, plan: Plan) -> None:
    """A lens bends depth, r' = r (1 + k r^2), with so many px at a corner; pixels are those nearest."""
    depth = file[DEPTH][...]
    height, width = depth.shape[1:]
    x, y = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
    corner = np.hypot(width - 1, height - 1) / 2
    factor = 1 + plan.size / corner * (x**2 + y**2) / corner**2
    columns = np.clip(np.rint(x * factor + (width - 1) / 2), 0, width - 1).astype(int)
    rows = np.clip(np.rint(y * factor + (height - 1) / 2), 0, height - 1).astype(int)
    replace_values(file, DEPTH, depth[:, rows, columns])
