"""Events made of the file's own colour frames, with light that is a straight line between them."""

from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import group_in
from fedora_generator.faults.rows import timestamps_in, window_of
from fedora_qa.layout.canonical import spec_of

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
