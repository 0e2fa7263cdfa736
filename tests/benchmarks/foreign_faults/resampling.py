"""Images that were resized, compressed or brought into another range of values on their way into a file."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan, Plant

Grid = tuple[NDArray[np.float64], NDArray[np.float64]]


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _pixels_of_sizes(width: int, height: int, factor: float) -> tuple[Grid, Grid]:
    """Return where the pixels of a smaller image lie in the large one, and those of the large one in the smaller.

    Columns and rows, px, with centres at whole numbers.
    """
    small = (np.arange(max(2, round(extent / factor))) for extent in (width, height))
    coarse = np.meshgrid(*((v + 0.5) * extent / len(v) - 0.5 for v, extent in zip(small, (width, height), strict=True)))
    ratio = coarse[0].shape[1] / width, coarse[0].shape[0] / height
    fine = np.meshgrid(*((np.arange(e) + 0.5) * r - 0.5 for e, r in zip((width, height), ratio, strict=True)))
    return (coarse[0], coarse[1]), (fine[0], fine[1])


def enlarged_from_fewer_pixels(file: h5py.File, plan: Plan) -> None:
    """Frames were rendered at a size smaller by a factor, and enlarged bilinearly, with centres in their places."""
    frames = file["path/rgb"][...]
    height, width = frames.shape[1:3]
    coarse, fine = _pixels_of_sizes(width, height, plan.size)
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(sampled(frame.astype(np.float64), *coarse), *fine))
    replace_values(file, "path/rgb", frames)


def compressed(file: h5py.File, plan: Plan) -> None:
    """Cosine coefficients of 8 x 8 blocks are rounded to a step that grows with frequency: size at the mean."""
    frames = file["path/rgb"][...]
    height, width = (v // 8 * 8 for v in frames.shape[1:3])
    step = plan.size * (1 + np.add.outer(np.arange(8), np.arange(8)) / 2)
    for number, frame in enumerate(frames):
        blocks = frame[:height, :width].astype(np.float64).reshape(height // 8, 8, width // 8, 8, 3)
        coefficients = dctn(blocks, axes=(1, 3), norm="ortho")
        steps = step[None, :, None, :, None]
        blocks = idctn(np.rint(coefficients / steps) * steps, axes=(1, 3), norm="ortho")
        frames[number, :height, :width] = _on_bytes(blocks.reshape(height, width, 3))
    replace_values(file, "path/rgb", frames)


def limited_range(file: h5py.File, plan: Plan) -> None:
    """0 to 255 became 16 to 235, as video has it, and nobody undid it."""
    values = 16 + np.arange(256) * (219 / 255)
    replace_values(file, "path/rgb", _on_bytes(values)[file["path/rgb"][...]])


def white_balance(file: h5py.File, plan: Plan) -> None:
    """Red is brighter and blue darker by so many percent."""
    gains = np.array([1 + plan.size / 100, 1.0, 1 / (1 + plan.size / 100)])
    replace_values(file, "path/rgb", _on_bytes(file["path/rgb"][...] * gains))


def flicker(file: h5py.File, plan: Plan) -> None:
    """Brightness of frames swings by so many percent of its mean, 3 to 11 times a second."""
    seconds = file["path/rgb_ts"][...] / 1e6
    phase, rate_hz = plan.random.uniform(0, 2 * np.pi), plan.random.uniform(3, 11)
    gains = 1 + plan.size / 100 * np.sin(2 * np.pi * rate_hz * seconds + phase)
    replace_values(file, "path/rgb", _on_bytes(file["path/rgb"][...] * gains[:, None, None, None]))


def depth_blended(file: h5py.File, plan: Plan) -> None:
    """Depth comes from a map smaller by a factor, interpolated bilinearly, so that edges get depths in between."""
    frames = file["path/depth"][...]
    height, width = frames.shape[1:3]
    coarse, fine = _pixels_of_sizes(width, height, plan.size)
    nearest = (
        np.rint(np.clip(coarse[1], 0, height - 1)).astype(int),
        np.rint(np.clip(coarse[0], 0, width - 1)).astype(int),
    )
    for number, frame in enumerate(frames):
        frames[number] = sampled(frame[nearest].astype(np.float64), *fine)
    replace_values(file, "path/depth", frames)


def depth_wraps(file: h5py.File, plan: Plan) -> None:
    """Depth beyond so many metres starts again at zero, as in integers of too few bits."""
    frames = file["path/depth"][...]
    replace_values(file, "path/depth", np.fmod(frames, np.float32(1000 * plan.size)))


def depth_invalid_as_far(file: h5py.File, plan: Plan) -> None:
    """What has no depth has that of the far plane."""
    far_mm = np.float32(1000 * file["metadata/depth_range"][1])
    replace_values(file, "path/depth", np.nan_to_num(file["path/depth"][...], nan=far_mm))


def depth_zoomed(file: h5py.File, plan: Plan) -> None:
    """The middle of depth is enlarged by so many percent by its nearest pixels, and K stays."""
    frames = file["path/depth"][...]
    at = []
    for extent in frames.shape[1:3]:
        middle = (extent - 1) / 2
        at.append(np.rint(middle + (np.arange(extent) - middle) / (1 + plan.size / 100)).astype(int))
    replace_values(file, "path/depth", frames[:, at[0][:, None], at[1]])


def turned_by_half(key: str) -> Plant:
    """Frames are turned by 180 degrees."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, np.ascontiguousarray(file[key][...][:, ::-1, ::-1]))

    return plant


def shifted_for_a_while(key: str) -> Plant:
    """Content of the plan's rows lies so many pixels to the right and down; the edge is repeated."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        rows = plan.rows(len(values))
        for axis in (1, 2):
            extent = values.shape[axis]
            source = np.clip(np.arange(extent) - int(plan.size), 0, extent - 1)
            values[rows] = np.take(values[rows], source, axis=axis)
        replace_values(file, key, values)

    return plant
