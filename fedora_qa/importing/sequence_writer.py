"""Write blocks of rows to the canonical layout, with memory that does not grow with their number."""

from collections.abc import Mapping
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import FORMAT_NAME, FORMAT_VERSION, R_BODY_OPTICAL
from fedora_qa.errors import MisuseError
from fedora_qa.importing.recording import Block, Resolution
from fedora_qa.layout.canonical import DATASETS, FRAMES_OF_MAP, STREAMS, TIMESTAMPS_OF
from fedora_qa.layout.create import create_dataset

UNCALIBRATED: Final = "unknown"
"""Camera model of a recording without calibration: every check that projects is not applicable."""


_LEVEL: Final = 3
"""Of compression. Level 5, of files that are written once and read often, takes 2.4 times as long and saves 4%."""


class GrowingDataset:
    """A dataset to which rows are appended by whole chunks, so that none is compressed twice."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset = dataset
        self._chunk_rows = int(dataset.chunks[0])
        self.row_shape: tuple[int, ...] = tuple(dataset.shape[1:])
        """Shape of a row; kept, as HDF5 would be asked for it with every row."""
        self._waiting: list[NDArray[Any]] = []
        self._waiting_rows = 0

    def append(self, rows: NDArray[Any]) -> None:
        """Add rows; whole chunks are written."""
        self._waiting.append(rows)
        self._waiting_rows += len(rows)
        if self._waiting_rows >= self._chunk_rows:
            self._write(self._waiting_rows // self._chunk_rows * self._chunk_rows)

    def finish(self) -> None:
        """Write the rows that wait."""
        if self._waiting_rows:
            self._write(self._waiting_rows)

    def _write(self, count: int) -> None:
        rows = np.concatenate(self._waiting) if len(self._waiting) > 1 else self._waiting[0]
        written = len(self._dataset)
        self._dataset.resize(written + count, axis=0)
        self._dataset[written:] = rows[:count]
        # A copy: a view would keep all rows that are written.
        self._waiting = [rows[count:].copy()] if count < len(rows) else []
        self._waiting_rows = len(rows) - count


class SequenceWriter:
    """An HDF5 file that is being written in the canonical layout.

    Parameters
    ----------
    file
        Open for writing, and empty.
    allow_backwards
        Whether timestamps that decrease are written as they are; else they are refused.
    """

    def __init__(self, file: h5py.File, *, allow_backwards: bool) -> None:
        self._file = file
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
                dataset = self._datasets[key] = GrowingDataset(create_dataset(self._file, key, sizes, level=_LEVEL))
            if rows.shape[1:] != dataset.row_shape:
                raise MisuseError(
                    f"Expected all {spec.stream} images to have the shape {dataset.row_shape}, got {rows.shape[1:]}; "
                    "bring in only one camera, or only the part of one size"
                )
            dataset.append(rows)

    def finish(self, *, cameras: Mapping[str, Resolution], root: Mapping[str, str]) -> None:
        """Write the rows that wait, index maps, and what is declared.

        Parameters
        ----------
        cameras
            Size of the images of each camera.
        root
            Attributes of the file, besides its format and version.
        """
        for dataset in self._datasets.values():
            dataset.finish()
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
        before = np.concatenate([[self._last_us.get(stream, times_us[0])], times_us[:-1]])
        backwards = np.flatnonzero(times_us < before)
        if len(backwards):
            first = int(backwards[0])
            row = self.rows.get(stream, 0) + first
            raise MisuseError(
                f"Expected {stream} timestamps that do not decrease, got {times_us[first]} us after {before[first]} us "
                f"at row {row}; record again, or write them as they are with --allow-backwards and let check report "
                "them"
            )
        self._last_us[stream] = int(times_us[-1])

    def _write_index_map(self, key: str, timestamps_key: str) -> None:
        """Count the events before each frame, a chunk of events at a time."""
        frames_us = np.asarray(self._file[timestamps_key][:])
        events = self._file[TIMESTAMPS_OF["events"]]
        indices = np.zeros(len(frames_us), np.int64)
        for start in range(0, len(events), events.chunks[0]):
            # Sums over chunks: for sorted events this is the index of the earliest event not before the frame.
            indices += np.searchsorted(np.sort(events[start : start + events.chunks[0]]), frames_us, side="left")
        dataset = create_dataset(self._file, key, {str(DATASETS[key].shape[0]): len(frames_us)})
        dataset[:] = indices


def present_streams(rows: Mapping[str, int]) -> list[str]:
    """Return the streams that have rows, in the order of the layout."""
    return [stream for stream in STREAMS if rows.get(stream)]
