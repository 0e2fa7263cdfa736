"""Faults of the event stream, and events made of colour frames."""

from collections.abc import Callable
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError, Region
from fedora_generator.faults.metadata import declare_noise, group_in
from fedora_generator.faults.rows import blocks, datasets_in, edit, insert_rows, keep_rows, timestamps_in, window_of
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


Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Columns = dict[str, Integers]

_EVENTS: Final = "metadata/events"
_LUMA: Final = np.array([0.299, 0.587, 0.114])
_WHITE: Final = 255.0

_DARKEST_DN: Final = 0.5
"""Light of a pixel whose code is 0: codes are rounded."""

_SHORTEST_STEP_US: Final = 100
"""Shortest step of a linear sensor, which compares images one by one."""


def interpolated_frames(file: h5py.File, fault: Fault) -> None:
    """Replace all events from the first to the last frame of the fault's interval by those of interpolated frames.

    Frames are averaged over the pixels of the event camera. The declared signal of a pixel (logarithm, or light) is a
    straight line from frame to frame, and the declared thresholds give its events, without noise. Events outside of
    these frames stay. Timestamps are the first whole microsecond, or packet, not before the crossing.
    """
    frames, frames_us = file["path/rgb"], timestamps_in(file, "rgb")[...].astype(np.int64)
    rows = window_of(file, "rgb", fault)
    numbers = range(rows.start, rows.stop)
    if len(numbers) < 2:
        raise FaultError("Expected two frames or more in the interval, got fewer; widen it")
    declared = group_in(file, _EVENTS).attrs
    is_linear = declared["model"] == "linear"
    thresholds = float(declared["threshold_on"]), float(declared["threshold_off"])
    stored = {name: file[f"path/events/{name}"][...].astype(np.int64) for name in "xytp"}
    tick_us = max(int(declared.get("packet_interval_us", 0)), 1)
    step_us = int(np.gcd.reduce(np.diff(stored["t"]))) if is_linear else 0
    if is_linear and step_us < _SHORTEST_STEP_US:
        raise FaultError(
            f"Expected events of a linear sensor in steps of {_SHORTEST_STEP_US} us or more, got {step_us}"
        )

    weights = _weights(file, "height"), _weights(file, "width")

    def signal(number: int) -> Floats:
        codes = frames[number] / _WHITE
        light = _WHITE * _linear(codes, str(frames.attrs.get("transfer", "linear"))) @ _LUMA
        on_sensor: Floats = weights[0] @ light @ weights[1].T
        if is_linear:
            return on_sensor
        return np.log(np.maximum(on_sensor, _DARKEST_DN) + float(declared.get("log_eps_dn", 0.0)))

    before = signal(numbers[0])
    reference = np.rint(before) if is_linear else before.copy()
    if str(declared.get("initial_phase", "zero")) == "uniform":
        # The signal lies anywhere between the two thresholds of a pixel that has been running.
        reference += fault.rng().uniform(-thresholds[0], thresholds[1], before.shape)
    planted: list[Columns] = []
    for number in numbers[1:]:
        after, ends_us = signal(number), (int(frames_us[number - 1]), int(frames_us[number]))
        if is_linear:
            planted += _steps(before, after, ends_us, step_us, reference, thresholds)
        else:
            planted.append(_crossings(before, after, ends_us, tick_us, reference, thresholds))
        before = after
    first_us, last_us = int(frames_us[numbers[0]]), int(frames_us[numbers[-1]])
    outside = (stored["t"] <= first_us) | (stored["t"] > last_us)
    events = {name: np.concatenate([stored[name][outside], *(columns[name] for columns in planted)]) for name in "xytp"}
    order = np.lexsort((events["p"], events["x"], events["y"], events["t"]))
    for name, values in events.items():
        key = f"path/events/{name}"
        file[key].resize(len(values), axis=0)
        file[key][...] = values[order].astype(spec_of(key).dtype)


def _linear(codes: Floats, transfer: str) -> Floats:
    """Return linear values, 0 to 1, of codes of a transfer curve."""
    if transfer == "srgb":
        return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    return codes**2.2 if transfer == "gamma2.2" else codes


def _weights(file: h5py.File, size: str) -> Floats:
    """Return the shares of the frame's rows or columns in those of the event camera.

    Parameters
    ----------
    file
        With both cameras, which look the same way from one place.
    size
        ``height`` for rows, ``width`` for columns.

    Returns
    -------
    Floats
        (pixels of the event camera, pixels of the frame), of sum 1 along the frame.
    """
    event, colour = (group_in(file, f"metadata/cameras/{name}").attrs for name in ("events", "rgb"))
    axis = ("width", "height").index(size)
    focal, centre = (axis, axis), (axis, 2)
    # Borders of the pixels of the event camera, in pixels of the frame, whose pixel j reaches from j - 1/2 to j + 1/2.
    borders = np.arange(int(event[size]) + 1) - 0.5
    borders = (borders - event["K"][centre]) * (colour["K"][focal] / event["K"][focal]) + colour["K"][centre]
    lower = np.arange(int(colour[size])) - 0.5
    overlap: Any = np.minimum(borders[1:, None], lower + 1) - np.maximum(borders[:-1, None], lower)
    overlap = np.clip(overlap, 0, None)
    # Beyond the frame's border its last pixel goes on.
    empty = overlap.sum(axis=1) == 0
    nearest = np.clip(np.rint((borders[1:] + borders[:-1]) / 2), 0, len(lower) - 1).astype(int)
    overlap[empty, nearest[empty]] = 1
    shares: Floats = overlap / overlap.sum(axis=1, keepdims=True)
    return shares


def _crossings(
    before: Floats,
    after: Floats,
    ends_us: tuple[int, int],
    tick_us: int,
    reference: Floats,
    thresholds: tuple[float, float],
) -> Columns:
    """Return the events of straight lines between two signals (H, W); moves the references (H, W)."""
    columns = []
    for polarity, threshold, sign in ((1, thresholds[0], 1.0), (0, thresholds[1], -1.0)):
        counts = np.maximum(np.floor(sign * (after - reference) / threshold), 0).astype(np.int64)
        # A line that rises crosses no level downwards; rounding could give a count.
        counts[sign * (after - before) <= 0] = 0
        y, x = np.nonzero(counts)
        count = counts[y, x]
        y, x = np.repeat(y, count), np.repeat(x, count)
        # 1, 2, ... within each pixel.
        number = np.arange(len(x)) - np.repeat(np.cumsum(count) - count, count) + 1
        levels = reference[y, x] + sign * threshold * number
        share = np.clip((levels - before[y, x]) / (after[y, x] - before[y, x]), 0, 1)
        ticks = np.ceil((ends_us[0] + share * (ends_us[1] - ends_us[0])) / tick_us)
        t = np.clip(ticks.astype(np.int64) * tick_us, ends_us[0] + 1, None)
        columns.append({"x": x, "y": y, "t": t, "p": np.full(len(x), polarity)})
        reference += sign * threshold * counts
    return {name: np.concatenate([each[name] for each in columns]) for name in "xytp"}


def _steps(
    before: Floats,
    after: Floats,
    ends_us: tuple[int, int],
    step_us: int,
    reference: Floats,
    thresholds: tuple[float, float],
) -> list[Columns]:
    """Return the events of a sensor that compares whole values step by step; moves the references (H, W)."""
    steps = []
    for t in range((ends_us[0] // step_us + 1) * step_us, ends_us[1] + 1, step_us):
        value = np.rint(before + (after - before) * ((t - ends_us[0]) / (ends_us[1] - ends_us[0])))
        brighter, darker = value - reference > thresholds[0], reference - value > thresholds[1]
        y, x = np.nonzero(brighter | darker)
        steps.append({"x": x, "y": y, "t": np.full(len(x), t), "p": brighter[y, x].astype(np.int64)})
        reference[y, x] = value[y, x]
    return steps
