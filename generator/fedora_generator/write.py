"""Writing the datasets of a sequence: whole ones, and those that grow event by event."""

from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.batch import EventBatch
from fedora_qa.layout.canonical import EVENT_CHUNK_ROWS
from fedora_qa.layout.create import create_dataset


def write_dataset(file: h5py.File, key: str, values: NDArray[Any], **sizes: int) -> None:
    """Create a dataset of the layout and fill it; ``sizes`` are its symbolic sizes."""
    create_dataset(file, key, sizes)[...] = values


class EventColumns:
    """The four event columns, grown by whole chunks so that none is compressed twice."""

    def __init__(self, file: h5py.File) -> None:
        self._columns = {name: create_dataset(file, f"path/events/{name}", {"E": 0}) for name in "xytp"}
        self._waiting: list[EventBatch] = []
        self._waiting_rows = 0
        self._written_rows = 0

    @property
    def rows(self) -> int:
        """Events appended so far."""
        return self._written_rows + self._waiting_rows

    def append(self, batch: EventBatch) -> None:
        """Add events that are not earlier than those before."""
        self._waiting.append(batch)
        self._waiting_rows += len(batch)
        if self._waiting_rows >= EVENT_CHUNK_ROWS:
            self._write(self._waiting_rows - self._waiting_rows % EVENT_CHUNK_ROWS)

    def finish(self) -> None:
        """Write the rows that wait."""
        self._write(self._waiting_rows)

    def _write(self, rows: int) -> None:
        if rows == 0:
            return
        waiting = self._waiting
        columns = {
            "x": np.concatenate([batch.x for batch in waiting]),
            "y": np.concatenate([batch.y for batch in waiting]),
            "t": np.concatenate([batch.t_us for batch in waiting]),
            "p": np.concatenate([batch.p for batch in waiting]),
        }
        for name, dataset in self._columns.items():
            dataset.resize(self._written_rows + rows, axis=0)
            dataset[self._written_rows :] = columns[name][:rows]
        self._written_rows += rows
        self._waiting_rows -= rows
        self._waiting = [EventBatch(*(columns[name][rows:] for name in "xytp"))]


class IndexMap:
    """``searchsorted(events_t, timestamps, "left")``, computed batch by batch."""

    def __init__(self, timestamps_us: NDArray[np.int64]) -> None:
        self._timestamps_us = timestamps_us
        self._indices = np.empty(len(timestamps_us), dtype=np.int64)
        self._resolved = 0
        self._events = 0

    def append(self, times_us: NDArray[np.int64]) -> None:
        """Add the times of the next events (n,), us, not earlier than those before."""
        if len(times_us) == 0:
            return
        reached = int(np.searchsorted(self._timestamps_us, times_us[-1], side="right"))
        if reached > self._resolved:
            ready = slice(self._resolved, reached)
            self._indices[ready] = self._events + np.searchsorted(times_us, self._timestamps_us[ready], side="left")
            self._resolved = reached
        self._events += len(times_us)

    def finish(self) -> NDArray[np.int64]:
        """Index (frames,) of the earliest event not before each timestamp; the number of events where none follows."""
        self._indices[self._resolved :] = self._events
        return self._indices
