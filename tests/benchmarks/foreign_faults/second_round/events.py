"""Events that filters, readouts, lenses and lamps add, remove or move."""

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan

TIME = "path/events/t"


def sensor_size(file: h5py.File) -> tuple[int, int]:
    """Return width and height of the event camera, px."""
    attributes = file["metadata/cameras/events"].attrs
    return int(attributes["width"]), int(attributes["height"])


def pixels_of(file: h5py.File) -> NDArray[np.int64]:
    """Return the number of each event's pixel, row by row."""
    pixels: NDArray[np.int64] = (
        file["path/events/y"][...].astype(np.int64) * sensor_size(file)[0] + file["path/events/x"][...]
    )
    return pixels


def keep_events(file: h5py.File, kept: NDArray[np.bool_]) -> None:
    """Keep some events, and make the index maps again."""
    keep_rows(file, "events", np.flatnonzero(kept))
    update_index_maps(file)


def sort_events(file: h5py.File) -> None:
    """Bring events into the canonical order (t, y, x, p), and make the index maps again."""
    keep_rows(file, "events", np.lexsort([file[f"path/events/{name}"][...] for name in "pxyt"]))
    update_index_maps(file)


def add_events(file: h5py.File, pixels: NDArray[np.int64], stamps_us: NDArray[np.int64], p: NDArray[np.int64]) -> None:
    """Merge further events, in the canonical order."""
    width = sensor_size(file)[0]
    for name, more in {"x": pixels % width, "y": pixels // width, "t": stamps_us, "p": p}.items():
        old = file[f"path/events/{name}"][...]
        replace_values(file, f"path/events/{name}", np.concatenate([old, more.astype(old.dtype)]))
    sort_events(file)


def turned_a_quarter(file: h5py.File, plan: Plan) -> None:
    """The sensor is read in portrait: x' = y and y' = W - 1 - x; what lies outside is lost."""
    width, height = sensor_size(file)
    columns, rows = (file[f"path/events/{axis}"][...].astype(np.int64) for axis in "xy")
    inside = (width - 1 - columns < height) & (rows < width)
    for axis, values in (("x", rows), ("y", width - 1 - columns)):
        key = f"path/events/{axis}"
        replace_values(file, key, values.astype(file[key].dtype))
    keep_events(file, inside)


def border_silent(file: h5py.File, plan: Plan) -> None:
    """So many pixels at each side of the sensor give no events."""
    edge = int(plan.size)
    columns, rows = (file[f"path/events/{axis}"][...].astype(np.int64) for axis in "xy")
    width, height = sensor_size(file)
    keep_events(file, (columns >= edge) & (columns < width - edge) & (rows >= edge) & (rows < height - edge))


def corners_silent(file: h5py.File, plan: Plan) -> None:
    """Outside the image circle of a lens there are no events: so many percent of the half diagonal are dark."""
    width, height = sensor_size(file)
    dx = file["path/events/x"][...] - (width - 1) / 2
    dy = file["path/events/y"][...] - (height - 1) / 2
    keep_events(file, np.hypot(dx, dy) <= (1 - plan.size / 100) * np.hypot(width, height) / 2)


def regular_rows_silent(file: h5py.File, plan: Plan) -> None:
    """Every row whose number has a certain remainder by the size gives no events."""
    period = int(plan.size)
    keep_events(file, file["path/events/y"][...] % period != int(plan.random.integers(period)))


def hot_for_a_while(file: h5py.File, plan: Plan) -> None:
    """So many pixels fire by themselves within the plan's time, at 170 to 1100 Hz each, with one polarity."""
    stamps_us = file[TIME][...]
    begin_us, end_us = stamps_us[0] + np.array([plan.begin, plan.end]) * (stamps_us[-1] - stamps_us[0])
    pixels, times, signs = [], [], []
    for pixel in plan.random.choice(int(np.prod(sensor_size(file))), int(plan.size), replace=False):
        rate_hz = np.exp(plan.random.uniform(np.log(170), np.log(1100)))
        count = 1 + plan.random.poisson(rate_hz * (end_us - begin_us) / 1e6)
        pixels.append(np.full(count, pixel))
        times.append(plan.random.uniform(begin_us, end_us, count).astype(np.int64))
        signs.append(np.full(count, plan.random.integers(2)))
    add_events(file, np.concatenate(pixels), np.concatenate(times), np.concatenate(signs))


def busiest_masked(file: h5py.File, plan: Plan) -> None:
    """The so many pixels with the most events of all are taken for hot ones, and their events are removed."""
    pixels = pixels_of(file)
    busiest = np.argsort(np.bincount(pixels), kind="stable")[-int(plan.size) :]
    keep_events(file, ~np.isin(pixels, busiest))


def lost_while_frames_are_read(file: h5py.File, plan: Plan) -> None:
    """For so many ms after the stamp of each colour frame, the sensor sends nothing."""
    stamps_us, frames_us = file[TIME][...], file["path/rgb_ts"][...]
    latest_us = frames_us[np.clip(np.searchsorted(frames_us, stamps_us, "right") - 1, 0, None)]
    since_us = stamps_us - latest_us
    keep_events(file, (since_us < 0) | (since_us >= 1000 * plan.size))


def first_of_each_slice(file: h5py.File, plan: Plan) -> None:
    """Of the events of a pixel within a slice of so many ms, the first alone is kept."""
    slices = file[TIME][...] // round(1000 * plan.size)
    kept = np.unique(slices * int(np.prod(sensor_size(file))) + pixels_of(file), return_index=True)[1]
    keep_rows(file, "events", np.sort(kept))
    update_index_maps(file)


def threshold_doubled_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time a pixel fires when its changes of one threshold, with their signs, sum to two."""
    within = plan.times_us(file[TIME][...])
    signs = np.where(file["path/events/p"][...] == 1, 1, -1)
    pixels = pixels_of(file)
    sums = np.zeros(int(np.prod(sensor_size(file))), dtype=np.int64)
    kept = ~within
    for row in np.flatnonzero(within):
        sums[pixels[row]] += signs[row]
        if abs(sums[pixels[row]]) == 2:
            kept[row] = True
            sums[pixels[row]] = 0
    keep_events(file, kept)


def lamp_flickers(file: h5py.File, plan: Plan) -> None:
    """A disc, with a radius of so many percent of the width, brightens and darkens at twice 50 or 60 Hz."""
    width, height = sensor_size(file)
    stamps_us = file[TIME][...]
    rows, columns = np.indices((height, width)).reshape(2, -1)
    middle = plan.random.integers(width), plan.random.integers(height)
    disc = np.flatnonzero(np.hypot(columns - middle[0], rows - middle[1]) <= max(1.0, plan.size / 100 * width))
    period_us = 1e6 / plan.random.choice([100, 120])
    cycles = int((stamps_us[-1] - stamps_us[0]) / period_us) - 1
    centres_us = (np.arange(cycles)[:, None] + np.array([0.25, 0.75])).ravel() * period_us + stamps_us[0]
    times_us = centres_us[:, None] + plan.random.normal(0.0, 0.06 * period_us, (len(centres_us), len(disc)))
    fires = plan.random.random(times_us.shape) < 0.9
    signs = np.broadcast_to((np.arange(len(centres_us)) % 2 == 0)[:, None], times_us.shape)
    inside = fires & (times_us > stamps_us[0]) & (times_us < stamps_us[-1])
    pixels = np.broadcast_to(disc, times_us.shape)
    add_events(file, pixels[inside], np.ceil(times_us[inside]).astype(np.int64), signs[inside].astype(np.int64))


def moved_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Within the plan's time columns are too large by so many pixels; what leaves the sensor is lost."""
    columns = file["path/events/x"][...]
    within = plan.times_us(file[TIME][...])
    moved = columns.astype(np.int64) + np.where(within, int(plan.size), 0)
    width = sensor_size(file)[0]
    replace_values(file, "path/events/x", np.clip(moved, 0, width - 1).astype(columns.dtype))
    keep_events(file, (moved >= 0) & (moved < width))


def of_another_sequence(file: h5py.File, plan: Plan) -> None:
    """Events of the plan's time are those of another sequence, at the same time since its first event."""
    first_us, last_us = file[TIME][[0, -1]]
    begin_us, end_us = (first_us + share * (last_us - first_us) for share in (plan.begin, plan.end))
    outside = ~plan.times_us(file[TIME][...])
    with h5py.File(plan.donor) as donor:
        times_us = donor[TIME][...] - donor[TIME][0] + first_us
        inside = (times_us >= begin_us) & (times_us <= end_us)
        for name in "xytp":
            key = f"path/events/{name}"
            others = times_us if name == "t" else donor[key][...]
            replace_values(file, key, np.concatenate([file[key][...][outside], others[inside]]))
    sort_events(file)


def lens_bends(file: h5py.File, plan: Plan) -> None:
    """A lens moves events outwards, by so many pixels at a corner and as r^3; what leaves the sensor is lost."""
    width, height = sensor_size(file)
    dx = file["path/events/x"][...] - (width - 1) / 2
    dy = file["path/events/y"][...] - (height - 1) / 2
    half = np.hypot(width, height) / 2
    factor = 1 + plan.size / half * (dx**2 + dy**2) / half**2
    columns = np.rint((width - 1) / 2 + dx * factor).astype(np.int64)
    rows = np.rint((height - 1) / 2 + dy * factor).astype(np.int64)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    for axis, values, extent in (("x", columns, width), ("y", rows, height)):
        key = f"path/events/{axis}"
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)
