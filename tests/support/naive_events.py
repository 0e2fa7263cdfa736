"""An event simulator of the simplest kind, with light that is a straight line between renders."""

import math

import numpy as np

from tests.estimators.event_world import Floats, Stream


def naive_events(
    renders_dn: list[Floats], times_us: list[int], threshold: float, threshold_off: float | None = None
) -> Stream:
    """Events as simulators of the simplest kind make them: pixel by pixel, level by level."""
    rows: list[tuple[int, int, int, int]] = []
    height, width = renders_dn[0].shape
    # (H, W, renders): a pixel's lie side by side.
    logs = np.stack([np.log(np.maximum(render, 0.5)) for render in renders_dn], axis=-1)
    for y in range(height):
        for x in range(width):
            levels: list[float] = logs[y, x].tolist()
            reference = levels[0]
            for i in range(1, len(levels)):
                before, after = levels[i - 1], levels[i]
                sign = 1 if after > before else -1
                step = threshold if sign > 0 or threshold_off is None else threshold_off
                while sign * (after - reference) >= step:
                    reference += sign * step
                    share = (reference - before) / (after - before)
                    time_us = times_us[i - 1] + share * (times_us[i] - times_us[i - 1])
                    rows.append((math.ceil(time_us), y, x, int(sign > 0)))
    events = np.array(rows, np.int64).reshape(-1, 4)
    # By time, then row, column and polarity.
    t, y_px, x_px, p = events[np.lexsort(events.T[::-1])].T
    return Stream(x_px.astype(np.uint16), y_px.astype(np.uint16), 1_000 * t, p.astype(np.uint8))
