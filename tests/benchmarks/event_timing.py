"""Stamps on the sensor's internal clock against the closed form: light followed, and images at a fixed rate."""

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_generator.adaptive.follower import Follower
from fedora_generator.events.keys import EventBatch, KeyLayout, decode
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.events.sensor import EventSensor, Pixels
from fedora_generator.sampling import Fidelity
from fedora_qa.conventions import NS_PER_S, NS_PER_US, US_PER_S
from tests.benchmarks.closed_form_events import true_events
from tests.benchmarks.timing_scenes import TimingScene

Truth = dict[tuple[int, int], list[tuple[float, int]]]

THRESHOLD: Final = 0.2
FRAME_US: Final = 20_000
DENSE_STEP_US: Final = 50
PIXEL_STRIDE: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Events whose stamps (``t_us``) are nanoseconds, and what they cost."""

    events: EventBatch
    rendered: float
    """Renders of the whole image, or as many pixels"""
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingError:
    """Of the events of the pixels that were compared; times of those whose sequence of polarities is right."""

    events: int
    pixels: int
    wrong_pixels: int
    rms_us: float
    largest_us: float


def truth_of(scene: TimingScene, duration_us: int) -> Truth:
    """Events by pixel (column, row), of every fifth pixel each way; those that tie with a threshold are left out."""
    times_s = np.arange(0, duration_us + 1, DENSE_STEP_US) / US_PER_S
    rows, columns = (range(PIXEL_STRIDE // 2, size, PIXEL_STRIDE) for size in (scene.camera.height, scene.camera.width))
    samples = np.array([np.log(scene.luma_dn(time_s)[np.ix_(rows, columns)]) for time_s in times_s.tolist()])
    truth = {}
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            signal = lambda time_s, place=(column, row): scene.log_luma(*place, time_s)  # noqa: E731
            events = true_events(signal, times_s, samples[:, i, j], THRESHOLD)
            if events is not None:
                truth[column, row] = events
    return truth


def followed(scene: TimingScene, fidelity: Fidelity, duration_us: int) -> Recording:
    """Record the scene as a sequence of the exact world is."""
    follower = Follower(scene.world, scene.camera, scene.flight, fidelity, tick_ns=1)
    started = time.perf_counter()
    signal = np.log(scene.luma_dn(0.0))
    threshold = np.full((1, scene.camera.width), THRESHOLD)
    pixels = Pixels(reference=signal.copy(), signal=signal, threshold_on=threshold, threshold_off=threshold)
    intervals = range(0, duration_us * NS_PER_US, FRAME_US * NS_PER_US)
    keys = [follower.crossings(pixels, start_ns, start_ns + FRAME_US * NS_PER_US) for start_ns in intervals]
    events = decode(np.concatenate(keys), KeyLayout(*signal.shape), 0)
    rendered = 1 + follower.rendered_pixels / signal.size
    return Recording(events=events, rendered=rendered, seconds=time.perf_counter() - started)


def at_fixed_rate(scene: TimingScene, step_us: int, duration_us: int) -> Recording:
    """Record the scene from images every ``step_us``, with a straight line between.

    The sensor's arithmetic knows no unit of time: told times 1000 times as long, its microseconds are nanoseconds.
    """
    options = EventSensorOptions(model="log", threshold_on=THRESHOLD, threshold_off=THRESHOLD)
    sensor = EventSensor(options, scene.camera.height, scene.camera.width, np.random.SeedSequence(0))
    started = time.perf_counter()
    sensor.start(0, scene.luma_dn(0.0))
    times_us = range(step_us, duration_us + 1, step_us)
    batches = [sensor.advance(t_us * NS_PER_US * 1_000, scene.luma_dn(t_us / US_PER_S)) for t_us in times_us]
    events = EventBatch(*(np.concatenate([getattr(b, name) for b in batches]) for name in ("x", "y", "t_us", "p")))
    return Recording(events=events, rendered=1 + len(times_us), seconds=time.perf_counter() - started)


def timing_error(recording: Recording, truth: Truth) -> TimingError:
    """Compare a recording with the truth, pixel by pixel."""
    batch, late_ns, events, wrong = recording.events, [np.empty(0)], 0, 0
    for (column, row), expected in truth.items():
        mine = (batch.x == column) & (batch.y == row)
        times_s, polarities = [time_s for time_s, _ in expected], [p for _, p in expected]
        events += len(expected)
        if batch.p[mine].tolist() == polarities:
            late_ns.append(batch.t_us[mine] - np.array(times_s) * NS_PER_S)
        else:
            wrong += 1
    all_ns = np.concatenate(late_ns)
    return TimingError(
        events=events,
        pixels=len(truth),
        wrong_pixels=wrong,
        rms_us=float(np.sqrt(np.mean(all_ns**2)) / NS_PER_US),
        largest_us=float(np.abs(all_ns).max() / NS_PER_US),
    )
