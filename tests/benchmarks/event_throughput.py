"""How fast the comparator is, as a ratio to the yardstick in the same run: one thread, log frames given."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.comparator import Comparator
from fedora_generator.events.keys import EventBatch, KeyLayout, sort_and_decode
from fedora_qa.conventions import NS_PER_US
from tests.benchmarks.plain_scan_kernels import PlainScan

Floats = NDArray[np.float64]
Advance = Callable[[Floats, Floats, int, int], EventBatch]
Movie = Callable[[int, int, int], Iterator[Floats]]

THRESHOLD: Final = 0.2
STEP_NS: Final = 1_000_000
FRAMES_A_TURN: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Throughput:
    """Medians over the frames: seconds a frame of each, and of the ratio between them; events a frame."""

    comparator_s: float
    plain_s: float
    ratio: float
    events: float


def dense_sinusoid(frames: int, height: int, width: int) -> Iterator[Floats]:
    """A sinusoidal grating of 40 px that drifts at 2 Hz: 35 events a pixel and second, everywhere."""
    x, y = np.arange(width), np.arange(height)[:, None]
    turns = (0.8 * x + 0.6 * y) / 40
    for k in range(frames):
        yield math.log(100) + 0.92 * np.sin(2 * math.pi * (turns - 2 * k * STEP_NS * 1e-9))


def sparse_edge(frames: int, height: int, width: int) -> Iterator[Floats]:
    """A vertical edge from 160 to 40 DN, averaged over the pixel, that moves 300 px/s."""
    for k in range(frames):
        covered = np.clip(0.15 * width + 300 * k * STEP_NS * 1e-9 - np.arange(width), 0, 1)
        yield np.tile(np.log(40 + 120 * covered), (height, 1))


def measure(movie: Movie, frames: int, height: int, width: int) -> Throughput:
    """Run both over the same frames, ten frames one and ten the other, and compare every event.

    Turns of several frames leave each its own caches, as in a recording, where there is one sensor. A frame is copied
    into a buffer just before, as a renderer would leave it. Seconds are of the thread, so that what else runs on the
    machine costs it no more than cache.

    Raises
    ------
    ValueError
        An event of one is not one of the other.
    """
    images = movie(frames, height, width)
    first = next(images)
    reference = _reference_of_a_running_sensor(*movie(2, height, width))
    contenders = (
        _Contender(comparator_from(reference), first),
        _Contender(PlainScan(THRESHOLD, reference.copy()).advance, first),
    )
    turn, events = 0, 0
    while block := list(islice(images, FRAMES_A_TURN)):
        batches = {which: contenders[which].play(block) for which in ((0, 1), (1, 0))[turn % 2]}
        for ours, plain in zip(batches[0], batches[1], strict=True):
            require_identical(ours, plain)
            events += len(ours)
        turn += 1
    seconds = np.array([contender.seconds for contender in contenders])
    comparator_s, plain_s = np.median(seconds, axis=1).tolist()
    ratio = float(np.median(seconds[1] / seconds[0]))
    return Throughput(comparator_s=comparator_s, plain_s=plain_s, ratio=ratio, events=events / (frames - 1))


class _Contender:
    """One of the two, its own buffers, and the seconds of each of its frames."""

    def __init__(self, advance: Advance, first: Floats) -> None:
        self._advance = advance
        self._previous, self._signal = first.copy(), first.copy()
        self.seconds: list[float] = []

    def play(self, images: list[Floats]) -> list[EventBatch]:
        """Events of the next frames."""
        batches = []
        for image in images:
            np.copyto(self._signal, image)
            start_ns = len(self.seconds) * STEP_NS
            started = time.thread_time()
            batches.append(self._advance(self._previous, self._signal, start_ns, start_ns + STEP_NS))
            self.seconds.append(time.thread_time() - started)
            self._previous, self._signal = self._signal, self._previous
        return batches


def _reference_of_a_running_sensor(first: Floats, second: Floats) -> Floats:
    """Levels (H, W) passed lately on the way that the signal goes."""
    share = np.random.default_rng(0).random(first.shape)
    return first - THRESHOLD * share * np.sign(second - first)


def comparator_from(reference: Floats) -> Advance:
    """Return the comparator of the sensor, from a first reference (H, W), to whole events."""
    layout = KeyLayout(*reference.shape)
    threshold = np.full((1, layout.width), THRESHOLD)
    comparator = Comparator(layout, threshold, threshold, reference.copy())

    def advance(previous: Floats, signal: Floats, start_ns: int, stop_ns: int) -> EventBatch:
        keys = comparator.crossings(previous, signal, start_ns, stop_ns)
        span_us = (start_ns // NS_PER_US, -(-stop_ns // NS_PER_US))
        return sort_and_decode(keys, layout, *span_us, 0, comparator.spare(keys.size))

    return advance


def require_identical(ours: EventBatch, plain: EventBatch) -> None:
    """Raise ValueError where an event of one is not one of the other."""
    for name in ("x", "y", "t_us", "p"):
        if not np.array_equal(getattr(ours, name), getattr(plain, name)):
            raise ValueError(f"Expected the events of the plain scan, got others in {name}")
