"""Events that are computed from the frames of the file, with straight lines between them."""

from typing import Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA
from tests.benchmarks.foreign_faults.twelfth_round.events import FIELDS, Events, sensor_shape, write_events

LUMA: Final = (0.299, 0.587, 0.114)
"""Shares of R, G, B."""

DARKEST_DN: Final = 1.0
"""Nothing darker has a logarithm."""


def _frame_of_events(file: h5py.File, number: int) -> NDArray[np.float64]:
    """Return the luma (H, W) of a colour frame as pixels of the event camera see it: the mean over each pixel."""
    frame = file["path/rgb"][number].astype(np.float32) @ np.array(LUMA, dtype=np.float32)
    to_colour = np.array(file[CAMERA + "rgb"].attrs["K"]) @ np.linalg.inv(np.array(file[CAMERA + "events"].attrs["K"]))
    rows, columns = sensor_shape(file)
    # A pixel is divided into so many parts along each side that a part is no wider than a pixel of colour.
    parts = max(1, int(np.ceil(to_colour[0, 0])))
    x, y = ((np.arange(extent * parts) + 0.5) / parts - 0.5 for extent in (columns, rows))
    at_x, at_y = np.meshgrid(to_colour[0, 0] * x + to_colour[0, 2], to_colour[1, 1] * y + to_colour[1, 2])
    fine = cv2.remap(
        frame, at_x.astype(np.float32), at_y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(fine.reshape(rows, parts, columns, parts).mean(axis=(1, 3)), dtype=np.float64)


def _level(file: h5py.File, number: int) -> NDArray[np.float64]:
    """Return what the declared sensor compares: luma, or its logarithm."""
    attributes = file["metadata/events"].attrs
    luma = _frame_of_events(file, number)
    if attributes["model"] == "linear":
        return luma
    return np.asarray(np.log(np.maximum(luma + float(attributes.get("log_eps_dn", 0.0)), DARKEST_DN)))


def between_frames(file: h5py.File, plan: Plan) -> None:
    """Events are those of levels that change evenly from one colour frame to the next."""
    attributes = file["metadata/events"].attrs
    thresholds = {1: float(attributes["threshold_on"]), 0: float(attributes["threshold_off"])}
    times_us = file["path/rgb_ts"][...].astype(np.float64)
    parts: list[Events] = []
    level = _level(file, 0)
    reference = level.copy()
    for number in range(1, len(times_us)):
        before, level = level, _level(file, number)
        for polarity, threshold in thresholds.items():
            sign = 1 if polarity else -1
            counts = np.floor(np.maximum(0.0, sign * (level - reference)) / threshold).astype(np.int64)
            y, x = np.nonzero(counts)
            repeats = counts[y, x]
            y, x = np.repeat(y, repeats), np.repeat(x, repeats)
            # Counts the events of a pixel in this interval: 1, 2, ...
            order = 1 + np.arange(len(y)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
            crossed = reference[y, x] + sign * threshold * order
            change = (level - before)[y, x]
            share = np.divide(crossed - before[y, x], change, out=np.ones_like(change), where=change != 0)
            fired_us = np.ceil(times_us[number - 1] + np.clip(share, 0, 1) * (times_us[number] - times_us[number - 1]))
            values = (fired_us.astype(np.int64), y, x, np.full(len(y), polarity))
            parts.append(dict(zip(FIELDS, values, strict=True)))
            reference += sign * threshold * counts
    write_events(file, *parts)
