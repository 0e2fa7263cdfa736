"""Colour and depth frames that cameras, codecs, disks, lidars, stereo and converters change."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sensor import LUMA

COLOUR = "path/rgb"
DEPTH = "path/depth"

SECTOR_BYTES = 512

STAGGERED_ROWS = 4
"""Rows of a lidar's image after which the pattern of its lasers repeats."""

DIGITS: Final = ("75557", "26227", "71747", "71717", "55711", "74717", "74757", "71222", "75757", "75717")
"""Of the digits 0 to 9, five rows of three pixels, each row a number of three bits."""


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def histogram_equalised(file: h5py.File, plan: Plan) -> None:
    """A curve for each frame makes all levels of its luma equally frequent."""
    frames = file[COLOUR][...]
    for number, frame in enumerate(frames):
        levels = np.rint(frame @ LUMA).astype(np.int64)
        total = np.cumsum(np.bincount(levels.ravel(), minlength=256))
        darkest = total[levels.min()]
        frames[number] = _on_bytes(255 * (total - darkest) / max(1, total[-1] - darkest))[frame]
    replace_values(file, COLOUR, frames)


def exposures_alternate(file: h5py.File, plan: Plan) -> None:
    """Every other frame has so many times less exposure."""
    frames = file[COLOUR][...]
    first = int(plan.random.integers(2))
    frames[first::2] = _on_bytes(frames[first::2] / plan.size)
    replace_values(file, COLOUR, frames)


def in_floating_point(file: h5py.File, plan: Plan) -> None:
    """Values are float32 from 0 to 1."""
    replace_values(file, COLOUR, (file[COLOUR][...] / 255).astype(np.float32))


def lens_breathes_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the image grows by up to so many percent, and shrinks again."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    grid = np.meshgrid(*(np.arange(extent, dtype=float) for extent in frames.shape[2:0:-1]))
    count = rows.stop - rows.start
    growth = np.sin(np.pi * (np.arange(count) + 0.5) / count)
    for number, share in zip(range(rows.start, rows.stop), growth, strict=True):
        at = [v.mean() + (v - v.mean()) / (1 + plan.size / 100 * share) for v in grid]
        frames[number] = _on_bytes(sampled(frames[number].astype(np.float64), *at))
    replace_values(file, COLOUR, frames)


def slice_concealed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows a band over so many percent of the height shows what it did in the frame before them."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    begin = max(1, rows.start)
    height = frames.shape[1]
    extent = max(1, round(plan.size / 100 * height))
    top = int(plan.random.integers(height // 4, max(height // 4 + 1, height - extent)))
    frames[begin : max(rows.stop, begin + 1), top : top + extent] = frames[begin - 1, top : top + extent]
    replace_values(file, COLOUR, frames)


def sectors_lost(file: h5py.File, plan: Plan) -> None:
    """One sector of the stored bytes of each of the plan's frames holds other bytes."""
    dataset = file[COLOUR].id
    rows = plan.rows(len(file[COLOUR]))
    for number in range(rows.start, rows.stop):
        mask, stored = dataset.read_direct_chunk((number, 0, 0, 0))
        begin = len(stored) // 2 // SECTOR_BYTES * SECTOR_BYTES
        other = plan.random.bytes(min(SECTOR_BYTES, len(stored) - begin))
        damaged = stored[:begin] + other + stored[begin + len(other) :]
        dataset.write_direct_chunk((number, 0, 0, 0), damaged, filter_mask=mask)


def rolls_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows the image lies so many percent of its height lower; what leaves it comes in above."""
    frames = file[COLOUR][...]
    rows = plan.rows(len(frames))
    frames[rows] = np.roll(frames[rows], max(1, round(plan.size / 100 * frames.shape[1])), axis=1)
    replace_values(file, COLOUR, frames)


def as_luma_and_chroma(file: h5py.File, plan: Plan) -> None:
    """Channels are Y, Cr and Cb (ITU-R BT.601, full range)."""
    frames = file[COLOUR][...].astype(np.float64)
    luma = frames @ LUMA
    red, blue = (frames[..., 0] - luma) / 1.402 + 128, (frames[..., 2] - luma) / 1.772 + 128
    replace_values(file, COLOUR, _on_bytes(np.stack([luma, red, blue], axis=-1)))


def _digits(number: int, length: int, side: int) -> NDArray[np.uint8]:
    """Return white digits on black, with pixels of so many px."""
    rows = [[f"{int(DIGITS[int(digit)][row]):03b}0" for digit in f"{number:0{length}d}"] for row in range(5)]
    bits = np.array([[int(bit) for bit in "".join(row)] for row in rows], dtype=np.uint8)
    return np.pad(255 * bits, 1).repeat(side, axis=0).repeat(side, axis=1)


def times_burnt_in(file: h5py.File, plan: Plan) -> None:
    """Each frame shows its time in milliseconds, at the upper left, with digits of so many px a dot."""
    frames = file[COLOUR][...]
    for frame, timestamp_us in zip(frames, file["path/rgb_ts"][...].tolist(), strict=True):
        box = _digits(timestamp_us // 1000, 5, int(plan.size))[: frame.shape[0], : frame.shape[1]]
        frame[: box.shape[0], : box.shape[1]] = box[..., None]
    replace_values(file, COLOUR, frames)


def depth_left_border_invalid(file: h5py.File, plan: Plan) -> None:
    """Columns at the left, so many percent of the width, have no depth."""
    depth = file[DEPTH][...]
    depth[:, :, : max(1, round(plan.size / 100 * depth.shape[2]))] = np.nan
    replace_values(file, DEPTH, depth)


def depth_staggered(file: h5py.File, plan: Plan) -> None:
    """Rows lie 0, 1, 2 and 3 times so many px to the right, and so on; the edge is repeated."""
    depth = file[DEPTH][...]
    height, width = depth.shape[1:]
    moves = int(plan.size) * (np.arange(height) % STAGGERED_ROWS)
    columns = np.clip(np.arange(width) - moves[:, None], 0, width - 1)
    replace_values(file, DEPTH, depth[:, np.arange(height)[:, None], columns])


def depth_shorter_than_its_timestamps(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the frames, at least one, are absent; timestamps and map are whole."""
    depth = file[DEPTH][...]
    replace_values(file, DEPTH, depth[: -max(1, round(plan.size / 100 * len(depth)))])


def depth_of_nearest_in_block(file: h5py.File, plan: Plan) -> None:
    """Each pixel with a depth has the least one of its block of so many px."""
    depth = file[DEPTH][...]
    side = int(plan.size)
    nearest = np.where(np.isnan(depth), np.inf, depth)
    for axis in (1, 2):
        extent = depth.shape[axis]
        nearest = np.minimum.reduceat(nearest, np.arange(0, extent, side), axis=axis)
        nearest = np.take(nearest.repeat(side, axis=axis), np.arange(extent), axis=axis)
    replace_values(file, DEPTH, np.where(np.isnan(depth), np.nan, nearest).astype(depth.dtype))
