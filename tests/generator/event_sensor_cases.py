"""Shared by the tests of the event sensor: play a movie, collect everything it gives."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.keys import EventBatch
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.events.sensor import EventSensor

Floats = NDArray[np.float64]
MS = 1_000_000  # ns


def options(**changes: Any) -> EventSensorOptions:
    """A log sensor with thresholds of 0.2 nat, with changes."""
    return EventSensorOptions(**{"model": "log", "threshold_on": 0.2, "threshold_off": 0.2, **changes})


def sensor_for(luma_dn: Floats, seed: int = 0, **changes: Any) -> EventSensor:
    """A sensor as large as the image."""
    return EventSensor(options(**changes), *luma_dn.shape, np.random.SeedSequence(seed))


def join(batches: Iterable[EventBatch]) -> EventBatch:
    """All events in the order in which they came."""
    batches = list(batches)
    return EventBatch(*(np.concatenate([getattr(b, name) for b in batches]) for name in ("x", "y", "t_us", "p")))


def play(sensor: EventSensor, times_ns: Iterable[int], movie_dn: Iterable[Floats]) -> EventBatch:
    """Start with the first image, advance through the rest, finish."""
    frames = zip(times_ns, movie_dn, strict=True)
    sensor.start(*next(frames))
    batches = [sensor.advance(time_ns, luma_dn) for time_ns, luma_dn in frames]
    return join([*batches, sensor.finish()])


def pixel(*log_levels: float) -> list[Floats]:
    """A movie of one pixel with the given log intensities."""
    return [np.full((1, 1), np.exp(level)) for level in log_levels]


def as_rows(events: EventBatch) -> list[tuple[int, int, int, int]]:
    """Events as (t, y, x, p)."""
    return list(zip(events.t_us.tolist(), events.y.tolist(), events.x.tolist(), events.p.tolist(), strict=True))
