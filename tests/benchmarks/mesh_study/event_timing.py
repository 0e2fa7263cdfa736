"""Events of one world against those of another, pixel by pixel."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.keys import EventBatch
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.events.sensor import EventSensor
from fedora_qa.conventions import NS_PER_US

Floats = NDArray[np.float64]
Luma = Callable[[int], Floats]
"""Luminance (height, width), DN, at a time in microseconds."""

SENSOR: Final = EventSensorOptions(model="log", threshold_on=0.2, threshold_off=0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingError:
    """Errors of event times.

    ``wrong_share`` of the pixels with any event have another sequence of polarities; the errors are of all others.
    """

    wrong_share: float
    median_us: float
    rms_us: float
    p99_us: float
    events: int


def record(luma: Luma, times_us: NDArray[np.int64]) -> EventBatch:
    """Simulate the events of a sensor from images.

    Parameters
    ----------
    luma
        Renders the luminance at a time.
    times_us
        (n,) ascending times of the images.
    """
    first_dn = luma(int(times_us[0]))
    height, width = first_dn.shape
    sensor = EventSensor(SENSOR, height, width, np.random.SeedSequence(0))
    sensor.start(int(times_us[0]) * NS_PER_US, first_dn)
    batches = [sensor.advance(time_us * NS_PER_US, luma(time_us)) for time_us in times_us[1:].tolist()]
    return EventBatch(
        *(np.concatenate([getattr(batch, name) for batch in batches]) for name in ("x", "y", "t_us", "p"))
    )


def compare(truth: EventBatch, other: EventBatch) -> TimingError:
    """Match the k-th event of a pixel with the k-th of the same pixel, where all their polarities agree.

    Parameters
    ----------
    truth, other
        Events of the same pixels and times.
    """
    width = int(max(truth.x.max(), other.x.max())) + 1
    pixels_a, times_a, polarities_a = _by_pixel(truth, width)
    pixels_b, times_b, polarities_b = _by_pixel(other, width)
    size = int(max(pixels_a.max(), pixels_b.max())) + 1
    counts_a, counts_b = np.bincount(pixels_a, minlength=size), np.bincount(pixels_b, minlength=size)
    wrong = counts_a != counts_b
    a, b = ~wrong[pixels_a], ~wrong[pixels_b]  # row by row the same event
    wrong[pixels_a[a][polarities_a[a] != polarities_b[b]]] = True
    late_us = np.abs(times_b[b] - times_a[a])[~wrong[pixels_a[a]]]
    return TimingError(
        wrong_share=float(wrong.sum() / ((counts_a + counts_b) > 0).sum()),
        median_us=float(np.median(late_us)),
        rms_us=float(np.sqrt((late_us.astype(np.float64) ** 2).mean())),
        p99_us=float(np.quantile(late_us, 0.99)),
        events=len(truth),
    )


def _by_pixel(batch: EventBatch, width: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint8]]:
    """Pixel number, time and polarity (n,), pixel after pixel, in the order of time."""
    pixels = batch.y.astype(np.int64) * width + batch.x
    order = np.argsort(pixels, kind="stable")
    return pixels[order], batch.t_us[order], batch.p[order]
