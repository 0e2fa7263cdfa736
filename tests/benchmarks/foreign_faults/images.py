"""Colour and depth frames that are stored, cut or rendered wrongly."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant


def sampled(image: NDArray[np.float64], columns: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Read an image (H, W, ...) between its pixels, bilinearly; its edge continues outwards."""
    height, width = image.shape[:2]
    columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    left, top = (np.minimum(v.astype(int), limit - 2) for v, limit in ((columns, width), (rows, height)))
    right, down = columns - left, rows - top
    if image.ndim == 3:
        right, down = right[..., None], down[..., None]
    upper = image[top, left] * (1 - right) + image[top, left + 1] * right
    lower = image[top + 1, left] * (1 - right) + image[top + 1, left + 1] * right
    blended: NDArray[np.float64] = upper * (1 - down) + lower * down
    return blended


def _on_bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def _grid(file: h5py.File) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height, width = file["path/rgb"].shape[1:3]
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return columns, rows


def channels(order: tuple[int, int, int]) -> Plant:
    """Channels are stored in another order."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, "path/rgb", np.ascontiguousarray(file["path/rgb"][...][..., order]))

    return plant


def gamma_applied(file: h5py.File, plan: Plan) -> None:
    """Values are raised to a power that nothing declares."""
    values = 255 * (np.arange(256) / 255) ** plan.size
    replace_values(file, "path/rgb", _on_bytes(values)[file["path/rgb"][...]])


def exposed(file: h5py.File, plan: Plan) -> None:
    """Frames of the plan's rows are brighter by so many percent."""
    frames = file["path/rgb"][...]
    rows = plan.rows(len(frames))
    frames[rows] = _on_bytes(frames[rows] * (1 + plan.size / 100))
    replace_values(file, "path/rgb", frames)


def clipped(file: h5py.File, plan: Plan) -> None:
    """Nothing is brighter than so many DN."""
    replace_values(file, "path/rgb", np.minimum(file["path/rgb"][...], np.uint8(plan.size)))


def black(file: h5py.File, plan: Plan) -> None:
    """So many frames in sequence are zero."""
    frames = file["path/rgb"][...]
    first = 1 + round(plan.begin * (len(frames) - plan.size - 2))
    frames[first : first + int(plan.size)] = 0
    replace_values(file, "path/rgb", frames)


def darker_corners(file: h5py.File, plan: Plan) -> None:
    """Light falls with the fourth power of the cosine, until corners lack so many percent."""
    columns, rows = _grid(file)
    squared = (columns - columns.mean()) ** 2 + (rows - rows.mean()) ** 2
    corner = (1 - plan.size / 100) ** -0.5 - 1
    fall = (1 + corner * squared / squared.max()) ** -2
    replace_values(file, "path/rgb", _on_bytes(file["path/rgb"][...] * fall[None, ..., None]))


def blurred_by_motion(file: h5py.File, plan: Plan) -> None:
    """Each frame mixes with the one before it, by so many percent, as a long exposure or a denoiser does."""
    frames = file["path/rgb"][...].astype(np.float64)
    share = plan.size / 100
    frames[1:] = (1 - share) * frames[1:] + share * frames[:-1]
    replace_values(file, "path/rgb", _on_bytes(frames))


def barrel(file: h5py.File, plan: Plan) -> None:
    """A lens bends the image: r' = r (1 + k r^2), with so many px at a corner."""
    columns, rows = _grid(file)
    dx, dy = columns - columns.mean(), rows - rows.mean()
    squared = (dx**2 + dy**2) / (dx**2 + dy**2).max()
    factor = 1 + plan.size / np.hypot(dx, dy).max() * squared
    frames = file["path/rgb"][...]
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(
            sampled(frame.astype(np.float64), columns.mean() + dx * factor, rows.mean() + dy * factor)
        )
    replace_values(file, "path/rgb", frames)


def zoomed(file: h5py.File, plan: Plan) -> None:
    """The middle is enlarged by so many percent, and K stays."""
    columns, rows = _grid(file)
    factor = 1 + plan.size / 100
    at = [middle + (v - middle) / factor for v, middle in ((columns, columns.mean()), (rows, rows.mean()))]
    frames = file["path/rgb"][...]
    for number, frame in enumerate(frames):
        frames[number] = _on_bytes(sampled(frame.astype(np.float64), *at))
    replace_values(file, "path/rgb", frames)


def shifted(key: str) -> Plant:
    """Content lies so many pixels to the right, or down; the edge is repeated."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        axis = 1 + int(plan.random.integers(2))
        extent = values.shape[axis]
        source = np.clip(np.arange(extent) - int(plan.size), 0, extent - 1)
        replace_values(file, key, np.take(values, source, axis=axis))

    return plant


def flipped(key: str, axis: int) -> Plant:
    """Rows (axis 1) or columns (axis 2) are stored from the other side."""

    def plant(file: h5py.File, plan: Plan) -> None:
        replace_values(file, key, np.ascontiguousarray(np.flip(file[key][...], axis)))

    return plant


def cropped(file: h5py.File, plan: Plan) -> None:
    """The left and upper edge, of so many pixels, are cut off; width and height follow, K stays."""
    edge = int(plan.size)
    frames = file["path/rgb"][...][:, edge:, edge:]
    replace_values(file, "path/rgb", np.ascontiguousarray(frames))
    attributes = file["metadata/cameras/rgb"].attrs
    attributes["height"], attributes["width"] = (np.int64(v) for v in frames.shape[1:3])


def binned(file: h5py.File, plan: Plan) -> None:
    """Means of 2 x 2 pixels; K is halved, but pixel centres are taken for corners."""
    frames = file["path/rgb"][...].astype(np.float64)
    height, width = (v // 2 * 2 for v in frames.shape[1:3])
    frames = frames[:, :height, :width].reshape(-1, height // 2, 2, width // 2, 2, 3).mean(axis=(2, 4))
    replace_values(file, "path/rgb", _on_bytes(frames))
    attributes = file["metadata/cameras/rgb"].attrs
    attributes["height"], attributes["width"] = np.int64(height // 2), np.int64(width // 2)
    attributes["K"] = np.diag([0.5, 0.5, 1.0]) @ attributes["K"]


def scaled(key: str, factor: float) -> Plant:
    """Values are stored in another unit."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        replace_values(file, key, (values * factor).astype(values.dtype))

    return plant


def gained(key: str) -> Plant:
    """Values are too large by so many percent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        replace_values(file, key, (values * (1 + plan.size / 100)).astype(values.dtype))

    return plant


def raised(key: str) -> Plant:
    """Values are too large by a constant."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        replace_values(file, key, (values + plan.size).astype(values.dtype))

    return plant


def noisy_depth(file: h5py.File, plan: Plan) -> None:
    """Depth has white noise of that standard deviation, mm, and stays within the declared range."""
    values = file["path/depth"][...]
    noise = plan.random.normal(0.0, plan.size, values.shape)
    nearest, farthest = 1000 * file["metadata/depth_range"][...]
    replace_values(file, "path/depth", np.clip(values + noise, nearest, farthest).astype(values.dtype))


def coarse(*keys: str) -> Plant:
    """Values are rounded to a step."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for key in keys:
            values = file[key][...]
            replace_values(file, key, (np.rint(values / plan.size) * plan.size).astype(values.dtype))

    return plant


def invalid_as_zero(*keys: str) -> Plant:
    """What has no value is 0."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for key in keys:
            replace_values(file, key, np.nan_to_num(file[key][...], nan=0.0))

    return plant


def along_rays(file: h5py.File, plan: Plan) -> None:
    """Depth is the distance from the centre of the camera."""
    depth = file["path/depth"][...]
    rows, columns = np.indices(depth.shape[1:])
    pixels = np.stack([columns, rows, np.ones(rows.shape)])
    rays = np.tensordot(np.linalg.inv(file["metadata/cameras/depth"].attrs["K"]), pixels, axes=1)
    replace_values(file, "path/depth", (depth * np.sqrt((rays**2).sum(axis=0))).astype(depth.dtype))


def as_disparity(file: h5py.File, plan: Plan) -> None:
    """Values are f b / z in px, for a base line of so many mm."""
    depth = file["path/depth"][...]
    focal = file["metadata/cameras/depth"].attrs["K"][0, 0]
    replace_values(file, "path/depth", (focal * plan.size / depth).astype(depth.dtype))
