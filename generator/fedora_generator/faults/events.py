"""Faults of the event stream."""

from collections.abc import Callable
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError, Region
from fedora_generator.faults.metadata import declare_noise, group_in
from fedora_generator.faults.rows import blocks, datasets_in, edit, insert_rows, keep_rows, window_of
from fedora_qa.conventions import US_PER_S
from fedora_qa.layout.canonical import spec_of

Keys = NDArray[np.int64]
KeepPixel = Callable[[Keys, Keys], NDArray[np.bool_]]

X, Y, T, P = (f"path/events/{column}" for column in "xytp")
METADATA: Final = "metadata/events"
CAMERA: Final = "metadata/cameras/events"

HOT_PIXEL_RATE_HZ: Final = 200.0
"""Rate of each planted hot pixel, of random polarity: well above a true pixel's, well below the sensor's limit."""

_NOISES: Final = ("threshold_sigma", "leak_rate_hz", "shot_rate_hz", "hot_pixel_rate_hz")


def polarity_inverted(file: h5py.File, fault: Fault) -> None:
    """Exchange brighter and darker."""
    edit(file[P], window_of(file, "events", fault), lambda polarities: 1 - polarities)


def axes_swapped(file: h5py.File, fault: Fault) -> None:
    """Write rows as columns and columns as rows, also where that leaves the sensor."""
    for block in blocks(file[X], window_of(file, "events", fault)):
        file[X][block], file[Y][block] = file[Y][block], file[X][block]


def mirrored(file: h5py.File, fault: Fault) -> None:
    """Count columns from the right."""
    last = _size(file)[0] - 1
    edit(file[X], window_of(file, "events", fault), lambda columns: last - columns)


def spatial_offset(file: h5py.File, fault: Fault) -> None:
    """Shift events to the right by whole pixels; those that leave the sensor are removed."""
    shift, width = fault.count(), _size(file)[0]
    if abs(shift) >= width:
        raise FaultError(f"Expected a shift of less than {width} px, got {shift}")
    rows = _keep_events(file, fault, lambda x, _: (x + shift >= 0) & (x + shift < width))
    edit(file[X], rows, lambda columns: columns.astype(np.int64) + shift)


def dead_region(file: h5py.File, fault: Fault) -> None:
    """Remove the events of a square of the given side around a pixel, drawn in proportion to its number of events.

    A square anywhere on the sensor might hold next to no events, and the fault would change next to nothing.
    """
    side, (left, top, right, bottom) = fault.positive_count(), _area(file, fault)
    longest = min(right - left, bottom - top)
    if side > longest:
        raise FaultError(f"Expected a side of at most {longest} px, got {side}")
    # Events of each pixel (height, width) in the fault's window; those off the sensor are left out.
    width, height = _size(file)
    counts = np.zeros((height, width), np.int64)
    for block in blocks(file[X], window_of(file, "events", fault)):
        x, y = (file[key][block].astype(np.int64) for key in (X, Y))
        inside = (x < width) & (y < height)
        np.add.at(counts, (y[inside], x[inside]), 1)
    fired = counts[top:bottom, left:right]
    if not fired.any():
        raise FaultError(f"Expected events in columns {left} to {right - 1}, rows {top} to {bottom - 1}, got none")
    row, column = divmod(int(fault.rng().choice(fired.size, p=fired.ravel() / fired.sum())), right - left)
    column = left + min(max(column - side // 2, 0), right - left - side)
    row = top + min(max(row - side // 2, 0), bottom - top - side)
    _keep_events(file, fault, lambda x, y: (x < column) | (x >= column + side) | (y < row) | (y >= row + side))


def hot_pixels(file: h5py.File, fault: Fault) -> None:
    """Add random events at the given number of pixels, without declaring them."""
    rng, count, (left, top, right, bottom) = fault.rng(), fault.positive_count(), _area(file, fault)
    available = (right - left) * (bottom - top)
    if count > available:
        raise FaultError(f"Expected at most the {available} pixels that there are, got {count}")
    window = window_of(file, "events", fault)
    first_us, last_us = int(file[T][window.start]), int(file[T][window.stop - 1])
    pixels = rng.choice(available, size=count, replace=False)
    fired = rng.poisson(HOT_PIXEL_RATE_HZ * (last_us - first_us) / US_PER_S, count)
    t = rng.integers(first_us, last_us, int(fired.sum()), endpoint=True)
    row, column = np.divmod(np.repeat(pixels, fired), right - left)
    x, y = left + column, top + row
    p = rng.integers(0, 1, t.size, endpoint=True)
    order = np.lexsort((p, x, y, t))
    columns = {X: x[order], Y: y[order], T: t[order], P: p[order]}
    before = _rows_before(file, columns, first_us)
    for key, values in columns.items():
        insert_rows(file[key], before, values.astype(spec_of(key).dtype))


def time_jitter(file: h5py.File, fault: Fault) -> None:
    """Add normal noise of the given spread to each timestamp, and sort the events again.

    Times beyond the first or the last timestamp of the fault's interval are reflected there, so that all other rows
    stay as they are.
    """
    sigma_us = fault.magnitude_in("us")
    if sigma_us <= 0:
        raise FaultError(f"Expected a spread above 0, got {fault.magnitude:g} {fault.unit}")
    window = window_of(file, "events", fault)
    columns = {key: file[key][window] for key in (X, Y, T, P)}
    first_us, last_us = int(columns[T].min()), int(columns[T].max())
    span_us = max(last_us - first_us, 1)
    noisy_us = columns[T] - first_us + np.rint(fault.rng().normal(0.0, sigma_us, len(columns[T]))).astype(np.int64)
    # Reflection at 0 and at the span: a triangle wave whose period is twice the span.
    columns[T] = first_us + span_us - np.abs(noisy_us % (2 * span_us) - span_us)
    order = np.lexsort([columns[key] for key in (P, X, Y, T)])
    for key, values in columns.items():
        file[key][window] = values[order]


def threshold_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare thresholds too large by the magnitude; the events stay."""
    attributes = group_in(file, METADATA).attrs
    for name in ("threshold_on", "threshold_off"):
        attributes[name] = attributes[name] * (1 + fault.magnitude_in("percent") / 100)


def event_model_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare the other sensor model, with the thresholds as they are."""
    attributes = group_in(file, METADATA).attrs
    attributes["model"] = "linear" if attributes["model"] == "log" else "log"


def noise_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare every noise of the sensor too large by the magnitude."""
    declare_noise(file, METADATA, _NOISES, fault)


def _size(file: h5py.File) -> tuple[int, int]:
    """Return width and height of the sensor."""
    if CAMERA not in file:
        raise FaultError(f"Expected {CAMERA}, got none: the size of the sensor is needed")
    return int(file[CAMERA].attrs["width"]), int(file[CAMERA].attrs["height"])


def _area(file: h5py.File, fault: Fault) -> Region:
    """Return the fault's region, or the whole sensor."""
    return fault.region or (0, 0, *_size(file))


def _keep_events(file: h5py.File, fault: Fault, keep_pixel: KeepPixel) -> slice:
    """Remove, within the window, the events of pixels that ``keep_pixel`` rejects; return the rows of the others."""
    window = window_of(file, "events", fault)
    keep = np.ones(len(file[X]), bool)
    for block in blocks(file[X], window):
        keep[block] = keep_pixel(file[X][block].astype(np.int64), file[Y][block].astype(np.int64))
    for dataset in datasets_in(file, "events").values():
        keep_rows(dataset, lambda block: keep[block])
    return slice(window.start, window.start + int(np.count_nonzero(keep[window])))


def _rows_before(file: h5py.File, new: dict[str, Keys], first_us: int) -> Keys:
    """Row (m,) before which each new event belongs in the canonical order (t, y, x, p)."""
    width, height = _size(file)

    def order_keys(columns: dict[str, Keys]) -> Keys:
        t, y, x, p = (columns[key].astype(np.int64) for key in (T, Y, X, P))
        return (((t - first_us) * height + y) * width + x) * 2 + p

    new_keys = order_keys(new)
    before = np.zeros(new_keys.size, np.int64)
    for block in blocks(file[T]):
        before += np.searchsorted(order_keys({key: file[key][block] for key in (X, Y, T, P)}), new_keys)
    return before
