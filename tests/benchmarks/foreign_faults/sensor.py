"""Events that a sensor model, a reader or a simulator gets wrong."""

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import DATASETS
from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan, Plant

LUMA = np.array([0.299, 0.587, 0.114])
"""Of R, G, B (ITU-R BT.601)."""


def _size(file: h5py.File) -> tuple[int, int]:
    attributes = file["metadata/cameras/events"].attrs
    return int(attributes["width"]), int(attributes["height"])


def polarity_inverted(file: h5py.File, plan: Plan) -> None:
    """1 stands for darker."""
    replace_values(file, "path/events/p", 1 - file["path/events/p"][...])


def polarity_declared_inverted(file: h5py.File, plan: Plan) -> None:
    """The declaration says that 0 stands for brighter."""
    file["metadata/events"].attrs["polarity"] = "0=brighter"


def axes_exchanged(file: h5py.File, plan: Plan) -> None:
    """Columns are stored as rows."""
    columns, rows = file["path/events/x"][...], file["path/events/y"][...]
    replace_values(file, "path/events/x", rows)
    replace_values(file, "path/events/y", columns)


def mirrored(axis: str) -> Plant:
    """Columns (x) or rows (y) count from the other side."""

    def plant(file: h5py.File, plan: Plan) -> None:
        extent = _size(file)["xy".index(axis)]
        values = file[f"path/events/{axis}"][...]
        replace_values(file, f"path/events/{axis}", (extent - 1 - values).astype(values.dtype))

    return plant


def moved(axis: str) -> Plant:
    """Columns or rows are too large by so many pixels; what leaves the sensor is lost."""

    def plant(file: h5py.File, plan: Plan) -> None:
        key, extent = f"path/events/{axis}", _size(file)["xy".index(axis)]
        values = file[key][...].astype(np.int64) + int(plan.size)
        inside = (values >= 0) & (values < extent)
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(DATASETS[key].dtype))
        keep_rows(file, "events", np.flatnonzero(inside))
        update_index_maps(file)

    return plant


def threshold_declared(*names: str) -> Plant:
    """The declared threshold is too large by so many percent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file["metadata/events"].attrs
        for name in names:
            attributes[name] = attributes[name] * (1 + plan.size / 100)

    return plant


def other_model_declared(file: h5py.File, plan: Plan) -> None:
    """The declaration names the other model, with a threshold that is usual for it (size: in DN)."""
    attributes = file["metadata/events"].attrs
    model, threshold = ("linear", plan.size) if attributes["model"] == "log" else ("log", plan.size / 100)
    attributes["model"] = model
    for name in ("threshold_on", "threshold_off"):
        attributes[name] = np.float64(threshold)


def without_region(extent: str) -> Plant:
    """A square, or whole columns, of so many pixels give no events within the plan's time."""

    def plant(file: h5py.File, plan: Plan) -> None:
        width, height = _size(file)
        side = int(plan.size)
        columns, rows = file["path/events/x"][...].astype(int), file["path/events/y"][...].astype(int)
        # Where there are events to lose: around one of them.
        place = plan.random.integers(len(columns))
        left = int(np.clip(columns[place] - side // 2, 0, width - side))
        top = int(np.clip(rows[place] - side // 2, 0, height - side))
        dead = (columns >= left) & (columns < left + side)
        if extent == "square":
            dead &= (rows >= top) & (rows < top + side)
        dead &= plan.times_us(file["path/events/t"][...])
        keep_rows(file, "events", np.flatnonzero(~dead))
        update_index_maps(file)

    return plant


def _add(file: h5py.File, columns: NDArray[np.int64], rows: NDArray[np.int64], stamps_us: NDArray[np.int64],
         polarities: NDArray[np.int64]) -> None:  # fmt: skip
    """Merge further events, in the canonical order (t, y, x, p)."""
    for name, more in zip("xytp", (columns, rows, stamps_us, polarities), strict=True):
        key = f"path/events/{name}"
        replace_values(file, key, np.concatenate([file[key][...], more.astype(DATASETS[key].dtype)]))
    keep_rows(file, "events", np.lexsort([file[f"path/events/{name}"][...] for name in "pxyt"]))
    update_index_maps(file)


def hot_pixels(file: h5py.File, plan: Plan) -> None:
    """So many pixels fire by themselves, each with a rate of its own between 150 and 900 Hz."""
    width, height = _size(file)
    stamps_us = file["path/events/t"][...]
    span_us = int(stamps_us[-1] - stamps_us[0])
    events: list[NDArray[np.int64]] = []
    for pixel in plan.random.choice(width * height, int(plan.size), replace=False):
        count = plan.random.poisson(np.exp(plan.random.uniform(np.log(150), np.log(900))) * span_us / 1e6)
        times_us = plan.random.choice(np.arange(1, span_us), count, replace=False) + stamps_us[0]
        polarity = plan.random.integers(2)
        events.append(np.stack([np.full(count, v) for v in (pixel % width, pixel // width)]
                               + [times_us, np.full(count, polarity)]))  # fmt: skip
    _add(file, *np.concatenate(events, axis=1))


def background_activity(file: h5py.File, plan: Plan) -> None:
    """Every pixel fires at random, so many times a second, within the plan's time; nothing declares it."""
    width, height = _size(file)
    stamps_us = file["path/events/t"][...]
    span_us = int(stamps_us[-1] - stamps_us[0])
    count = plan.random.poisson(plan.size * width * height * span_us / 1e6)
    times_us = stamps_us[0] + plan.random.integers(1, span_us, count)
    chosen = plan.times_us(np.r_[stamps_us[0], times_us, stamps_us[-1]])[1:-1]
    more = [plan.random.integers(limit, size=count)[chosen] for limit in (width, height)]
    _add(file, *more, times_us[chosen], plan.random.integers(2, size=count)[chosen])


def readout_saturated(file: h5py.File, plan: Plan) -> None:
    """The bus carries a limited number of events in a millisecond; at most so many percent of all find no place."""
    stamps_us = file["path/events/t"][...]
    bins = (stamps_us - stamps_us[0]) // 1000
    position = np.arange(len(bins)) - np.searchsorted(bins, bins)
    limit = np.quantile(position, 1 - plan.size / 100, method="higher")
    keep_rows(file, "events", np.flatnonzero(position <= limit))
    update_index_maps(file)


def from_frames(file: h5py.File, plan: Plan) -> None:
    """Events of straight lines between the file's own frames, as video-to-events tools make them.

    Lines are of log luma, of luma where the sensor is linear.
    """
    attributes = file["metadata/events"].attrs
    camera, colour = (file[f"metadata/cameras/{name}"].attrs for name in ("events", "rgb"))
    width, height = _size(file)
    stamps_us = file["path/rgb_ts"][...]
    # The colour that a pixel sees is the mean of 3 x 3 directions within it.
    thirds = (np.arange(3) - 1) / 3
    columns = (np.arange(width)[:, None] + thirds).ravel()
    rows = (np.arange(height)[:, None] + thirds).ravel()
    scale = colour["K"] @ np.linalg.inv(camera["K"])
    at = np.meshgrid(scale[0, 0] * columns + scale[0, 2], scale[1, 1] * rows + scale[1, 2])
    events: list[NDArray[np.float64]] = []
    reference = level = np.zeros((height, width))
    is_linear = attributes["model"] == "linear"
    pixel_rows, pixel_columns = np.mgrid[:height, :width]
    for number in range(len(stamps_us)):
        luma = sampled(file["path/rgb"][number].astype(np.float64) @ LUMA, *at)
        luma = luma.reshape(height, 3, width, 3).mean(axis=(1, 3))
        # Thresholds of a linear sensor are in DN.
        earlier, level = level, luma if is_linear else np.log(np.maximum(luma, 1.0))
        if number == 0:
            reference = level.copy()
            continue
        rising = level >= earlier
        threshold = np.where(rising, attributes["threshold_on"], attributes["threshold_off"])
        steps = np.floor(np.maximum(np.where(rising, level - reference, reference - level), 0) / threshold)
        count = steps.astype(int).ravel()
        which = np.repeat(np.arange(count.size), count)
        order = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1
        sign = np.where(rising, 1.0, -1.0)
        crossed = reference.ravel()[which] + order * (sign * threshold).ravel()[which]
        share = (crossed - earlier.ravel()[which]) / (level - earlier).ravel()[which]
        times_us = stamps_us[number - 1] + np.ceil(share * (stamps_us[number] - stamps_us[number - 1]))
        events.append(np.stack([pixel_columns.ravel()[which], pixel_rows.ravel()[which], times_us,
                                rising.ravel()[which]]))  # fmt: skip
        reference = reference + sign * steps * threshold
    merged = np.concatenate(events, axis=1)
    merged = merged[:, np.lexsort([merged[3], merged[0], merged[1], merged[2]])]
    for name, values in zip("xytp", merged, strict=True):
        replace_values(file, f"path/events/{name}", values.astype(DATASETS[f"path/events/{name}"].dtype))
    update_index_maps(file)
