"""A file that exists only in memory, cut into windows: colour, depth, flow and events with known values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.sequence.declared import Camera, Declared
from fedora_qa.sequence.facts import EventScan, Facts
from fedora_qa.sequence.window import Sampling, Span, Window
from tests.support.facts import MS, exact_facts

HEIGHT, WIDTH = 6, 8
SENSOR_HEIGHT, SENSOR_WIDTH = 3, 4
WINDOW_NS = 200 * MS
EVENT_STEP_NS = MS


@dataclass
class Memory:
    """Facts and rows. Frame i is i everywhere, depth i metres, flow (i, -i); events cross the sensor one each ms."""

    facts: Facts
    columns: Mapping[str, NDArray[Any]]
    unreadable: set[str] = field(default_factory=set)

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Rows of a dataset; keys named ``unreadable`` raise."""
        if key in self.unreadable:
            raise UnreadableRowsError(key, start, stop, "damaged")
        return self.columns[key][start:stop]

    def event_index(self, time_ns: int) -> int:
        """Number of events before an instant."""
        return int(np.searchsorted(self.columns["path/events/t"], time_ns))

    @property
    def spans(self) -> tuple[Span, ...]:
        """Windows of a fifth of a second."""
        timestamps = {name: one.times_ns for name, one in self.facts.clocks.items()}
        timestamps["events"] = self.columns["path/events/t"]
        last_ns = max(int(times[-1]) for times in timestamps.values() if len(times))
        spans = []
        for number, start_ns in enumerate(range(0, last_ns + 1, WINDOW_NS)):
            bounds = [start_ns, start_ns + WINDOW_NS]
            owned = {name: tuple(np.searchsorted(times, bounds).tolist()) for name, times in timestamps.items()}
            kept = {name: rows for name, rows in owned.items() if rows[0] < rows[1]}
            spans.append(Span(number, start_ns, start_ns + WINDOW_NS, kept))
        return tuple(spans)

    def window(self, number: int) -> Window:
        """One window."""
        return Window(self.spans[number], self.facts, self, Sampling())


def memory(seconds: int = 1) -> Memory:
    """A clean file."""
    facts = exact_facts(seconds)
    events_ns = np.arange(0, seconds * 1000 * MS, EVENT_STEP_NS)
    numbers = np.arange(len(events_ns))
    columns: dict[str, NDArray[Any]] = {
        "path/rgb": images(facts, "rgb", np.array([1, 1, 1])).astype(np.uint8),
        "path/depth": images(facts, "depth", np.float32(1000)),
        "path/events/t": events_ns,
        "path/events/x": (numbers % SENSOR_WIDTH).astype(np.uint16),
        "path/events/y": (numbers // SENSOR_WIDTH % SENSOR_HEIGHT).astype(np.uint16),
        "path/events/p": (numbers % 3 == 0).astype(np.uint8),
        "path/pose/position": np.outer(facts.clocks["pose"].times_ns / 1e9, [3.0, 4.0, 0.0]),
        "path/pose/orientation": np.tile([0.0, 0.0, 0.0, 1.0], (len(facts.clocks["pose"].times_ns), 1)),
    }
    for stream in facts.flow_streams:
        columns[f"path/{stream}"] = images(facts, stream, np.array([1, -1], np.float32))
    camera = Camera(WIDTH, HEIGHT, np.eye(3), np.eye(4))
    cameras = {"rgb": camera, "depth": camera, "events": replace(camera, width=SENSOR_WIDTH, height=SENSOR_HEIGHT)}
    scan = EventScan(len(events_ns), 0, int(events_ns[-1]), decreases=0, first_decrease=-1, grid_ns=MS)
    return Memory(replace(facts, declared=Declared(cameras=cameras), events=scan), columns)


def images(facts: Facts, stream: str, channels: NDArray[Any] | np.floating[Any]) -> NDArray[Any]:
    """Images (n, H, W, ...) whose every pixel is the number of the image times the channels."""
    numbers = np.arange(len(facts.clocks[stream].times_ns)).reshape(-1, 1, 1, *[1] * np.ndim(channels))
    tall = np.broadcast_to(numbers, (len(numbers), HEIGHT, WIDTH, *numbers.shape[3:]))
    return np.asarray(tall * channels).astype(np.asarray(channels).dtype)
