"""Write blocks of rows to the canonical layout, with memory that does not grow with their number."""

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import FORMAT_NAME, FORMAT_VERSION, R_BODY_OPTICAL
from fedora_qa.errors import MisuseError
from fedora_qa.importing.recording import Block, Resolution
from fedora_qa.layout.canonical import DATASETS, FRAMES_OF_MAP, STREAMS, TIMESTAMPS_OF, UNCALIBRATED
from fedora_qa.layout.create import create_dataset
from fedora_qa.layout.direct_chunks import ChunkWriter


class GrowingDataset:
    """A dataset to which rows are appended by whole chunks, so that none is compressed twice.

    Parameters
    ----------
    dataset
        Empty.
    chunks
        Writes its chunks.
    """

    def __init__(self, dataset: h5py.Dataset, chunks: ChunkWriter) -> None:
        self._dataset = dataset
        self._chunks = chunks
        self._shape: tuple[int, ...] = dataset.chunks
        self._dtype = dataset.dtype
        self._rows = 0
        """Rows of the chunks that are given to the writer."""
        self._chunk = np.empty(self._shape, self._dtype)
        self._filled = 0

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of a row."""
        return self._shape[1:]

    def append(self, rows: NDArray[Any]) -> None:
        """Add a copy of rows."""
        while len(rows):
            count = min(len(rows), len(self._chunk) - self._filled)
            self._chunk[self._filled : self._filled + count] = rows[:count]
            self._filled += count
            rows = rows[count:]
            if self._filled == len(self._chunk):
                self._write()

    def finish(self) -> None:
        """Give the rows that wait to the writer."""
        if self._filled:
            # HDF5 fills the rest of the last chunk in the same way.
            self._chunk[self._filled :] = 0
            self._write()

    def _write(self) -> None:
        self._dataset.resize(self._rows + self._filled, axis=0)
        self._chunks.write(self._dataset, self._rows, self._chunk)
        self._rows += self._filled
        self._chunk, self._filled = np.empty(self._shape, self._dtype), 0


class SequenceWriter:
    """An HDF5 file that is being written in the canonical layout.

    Parameters
    ----------
    file
        Open for writing, and empty.
    chunks
        Writes its chunks.
    level
        Of compression, 1 to 9.
    allow_backwards
        Whether timestamps that decrease are written as they are; else they are refused.
    """

    def __init__(self, file: h5py.File, chunks: ChunkWriter, *, level: int, allow_backwards: bool) -> None:
        self._file = file
        self._chunks = chunks
        self._level = level
        self._allow_backwards = allow_backwards
        self._datasets: dict[str, GrowingDataset] = {}
        self._last_us: dict[str, int] = {}
        self.rows: dict[str, int] = {}
        """Rows of each stream so far."""

    def append(self, block: Block) -> None:
        """Add rows.

        Raises
        ------
        MisuseError
            Timestamps decrease, or images have another size than those before.
        """
        for key, rows in block.columns.items():
            spec = DATASETS[key]
            if spec.is_timestamps:
                self._require_order(spec.stream, rows)
                self.rows[spec.stream] = self.rows.get(spec.stream, 0) + len(rows)
            dataset = self._datasets.get(key)
            if dataset is None:
                # The sizes of a row are those of the first one; the axis of time is empty.
                sizes = dict(zip(map(str, spec.shape), (0, *rows.shape[1:]), strict=True))
                stored = create_dataset(self._file, key, sizes, level=self._level)
                dataset = self._datasets[key] = GrowingDataset(stored, self._chunks)
            if rows.shape[1:] != dataset.row_shape:
                raise MisuseError(
                    f"Expected all {spec.stream} images to have the shape {dataset.row_shape}, got {rows.shape[1:]}; "
                    "bring in only one camera, or only the part of one size"
                )
            dataset.append(rows)

    def finish(self, *, cameras: Mapping[str, Resolution], root: Mapping[str, str]) -> None:
        """Write the rows that wait, index maps, and what is declared."""
        for dataset in self._datasets.values():
            dataset.finish()
        self._chunks.finish()
        for index_map, frames in FRAMES_OF_MAP.items():
            if frames in self.rows and "events" in self.rows:
                self._write_index_map(f"metadata/{index_map}", TIMESTAMPS_OF[frames])
        self._file.attrs.update({"format": FORMAT_NAME, "format_version": FORMAT_VERSION, **root})
        for name, (width, height) in cameras.items():
            if name not in self.rows:
                continue
            camera = self._file.create_group(f"metadata/cameras/{name}")
            T_body_camera = np.eye(4)
            T_body_camera[:3, :3] = R_BODY_OPTICAL
            # Required by the layout, and placeholders: with this model no check reads them. The focal length is one
            # width, the principal point the centre, and the camera looks straight ahead.
            K = np.array([[width, 0.0, (width - 1) / 2], [0.0, width, (height - 1) / 2], [0.0, 0.0, 1.0]])
            camera.attrs.update(
                {"width": width, "height": height, "K": K, "T_body_camera": T_body_camera, "camera_model": UNCALIBRATED}
            )
        if "events" in self.rows:
            self._file.create_group("metadata/events").attrs.update({"model": "unknown", "polarity": "1=brighter"})

    def _require_order(self, stream: str, times_us: NDArray[np.int64]) -> None:
        if self._allow_backwards or not len(times_us):
            return
        last_us = self._last_us.get(stream, int(times_us[0]))
        if times_us[0] < last_us or np.any(times_us[1:] < times_us[:-1]):
            before_us = np.concatenate([[last_us], times_us[:-1]])
            first = int(np.flatnonzero(times_us < before_us)[0])
            row = self.rows.get(stream, 0) + first
            raise MisuseError(
                f"Expected {stream} timestamps that do not decrease, got {times_us[first]} us after "
                f"{before_us[first]} us at row {row}; record again, or write them as they are with --allow-backwards "
                "and let check report them"
            )
        self._last_us[stream] = int(times_us[-1])

    def _write_index_map(self, key: str, timestamps_key: str) -> None:
        """Count the events before each frame, a chunk of events at a time."""
        frames_us = np.asarray(self._file[timestamps_key][:])
        events = self._file[TIMESTAMPS_OF["events"]]
        order = np.argsort(frames_us, kind="stable")
        ascending_us = frames_us[order]
        # Sums over chunks: for sorted events this is the index of the earliest event not before the frame.
        events_before = np.zeros(len(frames_us), np.int64)
        for start in range(0, len(events), events.chunks[0]):
            times_us = np.sort(events[start : start + events.chunks[0]])
            # Frames up to the first event of the chunk have none of its events before them, those after the last all.
            first, last = np.searchsorted(ascending_us, times_us[[0, -1]], side="right")
            events_before[first:last] += np.searchsorted(times_us, ascending_us[first:last], side="left")
            events_before[last:] += len(times_us)
        indices = np.empty_like(events_before)
        indices[order] = events_before
        dataset = create_dataset(self._file, key, {str(DATASETS[key].shape[0]): len(frames_us)})
        dataset[:] = indices


def present_streams(rows: Mapping[str, int]) -> list[str]:
    """Return the streams that have rows, in the order of the layout."""
    return [stream for stream in STREAMS if rows.get(stream)]
