"""Colour frames that encoders, resizing, lamps, lenses, filter wheels and converters change."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sensor import LUMA

COLOUR: Final = "path/rgb"

READOUT_S: Final = 0.015
"""From the first row of a frame to its last."""

MAINS_HZ: Final = (100, 120)
"""Rates at which lamps on alternating current flicker."""


def on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Round values to bytes."""
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _sample_all(file: h5py.File, columns: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
    """Replace all frames by what they hold at columns and rows (H, W)."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames):
        frames[number] = on_bytes(sampled(frame.astype(np.float64), columns, rows))
    replace_values(file, COLOUR, frames)


def _grid(file: h5py.File) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height, width = file[COLOUR].shape[1:3]
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return columns, rows


def encoded_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows have the curve of sRGB."""
    frames = file[COLOUR][...]
    light = np.arange(256) / 255
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    rows = plan.rows(len(frames))
    frames[rows] = on_bytes(255 * curve)[frames[rows]]
    replace_values(file, COLOUR, frames)


def moved_by_part_of_a_pixel(file: h5py.File, plan: Plan) -> None:
    """Content lies so many px to the right and below."""
    columns, rows = _grid(file)
    _sample_all(file, columns - plan.size, rows - plan.size)


def columns_stretched(file: h5py.File, plan: Plan) -> None:
    """Columns are so many percent farther from the middle, and rows stay."""
    columns, rows = _grid(file)
    middle = columns.mean()
    _sample_all(file, middle + (columns - middle) / (1 + plan.size / 100), rows)


def bands_of_lamps(file: h5py.File, plan: Plan) -> None:
    """Brightness changes by so many percent with the time of each row, at twice 50 or 60 Hz."""
    frames = file[COLOUR][...]
    rate_hz = float(plan.random.choice(MAINS_HZ)) * plan.random.uniform(0.997, 1.003)
    since_s = READOUT_S * np.arange(frames.shape[1]) / frames.shape[1]
    for number, timestamp_us in enumerate(file["path/rgb_ts"][...].tolist()):
        gain = 1 + plan.size / 100 * np.sin(2 * np.pi * rate_hz * (timestamp_us / 1e6 + since_s))
        frames[number] = on_bytes(frames[number] * gain[:, None, None])
    replace_values(file, COLOUR, frames)


def still_at_the_end(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the frames repeat the one before them."""
    frames = file[COLOUR][...]
    last = round((1 - plan.size / 100) * len(frames)) - 1
    frames[last + 1 :] = frames[last]
    replace_values(file, COLOUR, frames)


def without_channels(file: h5py.File, plan: Plan) -> None:
    """Frames are luma, of shape (H, W)."""
    replace_values(file, COLOUR, np.stack([on_bytes(frame @ LUMA) for frame in file[COLOUR][...]]))


def shaded_off_the_middle(file: h5py.File, plan: Plan) -> None:
    """Light falls with the square of the distance from a point off the middle, by so many percent at the far corner."""
    frames = file[COLOUR][...]
    columns, rows = _grid(file)
    direction = plan.random.uniform(0, 2 * np.pi)
    off_px = plan.random.uniform(0.12, 0.27) * frames.shape[2]
    x, y = columns.mean() + off_px * np.cos(direction), rows.mean() + off_px * np.sin(direction)
    squared = (columns - x) ** 2 + (rows - y) ** 2
    gain = (1 - plan.size / 100 * squared / squared.max())[..., None]
    for number, frame in enumerate(frames):
        frames[number] = on_bytes(frame * gain)
    replace_values(file, COLOUR, frames)


def channels_in_sequence(file: h5py.File, plan: Plan) -> None:
    """Red is that of the frame before, and blue that of the frame after."""
    frames = file[COLOUR][...]
    old = frames.copy()
    frames[1:, ..., 0] = old[:-1, ..., 0]
    frames[:-1, ..., 2] = old[1:, ..., 2]
    replace_values(file, COLOUR, frames)


def noisy_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows have white noise of so many DN."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = on_bytes(frames[rows] + plan.random.normal(0.0, plan.size, frames[rows].shape))
    replace_values(file, COLOUR, frames)
