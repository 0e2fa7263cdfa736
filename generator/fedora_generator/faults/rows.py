"""Editing the rows of a stream in place, a block at a time, so that memory does not grow with the file."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_qa.conventions import US_PER_S
from fedora_qa.layout.canonical import (
    STREAMS,
    TIMESTAMPS_OF,
    companions_of,
    datasets_of,
    flow_stream_of,
    in_file_order,
    is_timed,
    timestamps_of,
)

Array = NDArray[Any]

_BLOCK_BYTES: Final = 16 * 1024 * 1024


def flow_streams_in(file: h5py.File) -> tuple[str, ...]:
    """Return the flow streams of which the file holds anything, the lowest rate first."""
    keys = (f"path/flow/{name}" for name in file.get("path/flow", ()))
    return in_file_order({stream for key in keys if (stream := flow_stream_of(key))})


def streams_in(file: h5py.File, stream: str) -> tuple[str, ...]:
    """Return the stream itself, or for ``flow`` every rate that the file holds."""
    names = flow_streams_in(file) if stream == "flow" else (stream,)
    streams = tuple(name for name in names if any(spec.key in file for spec in datasets_of(name)))
    if not streams:
        others = [name for name in STREAMS if any(spec.key in file for spec in datasets_of(name))]
        got = f"only {', '.join(others)}" if others else "no stream of the canonical layout"
        raise FaultError(f"Expected a file with the stream {stream}, got {got}; name another stream or file")
    return streams


def datasets_in(file: h5py.File, stream: str) -> dict[str, h5py.Dataset]:
    """Return every dataset of one stream by its key, with the datasets that share its rows."""
    specs = (*datasets_of(stream), *companions_of(stream))
    return {spec.key: file[spec.key] for spec in specs if spec.key in file}


def values_in(file: h5py.File, stream: str) -> list[h5py.Dataset]:
    """Return the datasets of one stream other than its timestamps."""
    return [file[spec.key] for spec in datasets_of(stream) if spec.key in file and not spec.is_timestamps]


def timestamps_in(file: h5py.File, stream: str) -> h5py.Dataset:
    """Return the timestamps of one stream, (n,) or for flow (n, 2), us."""
    if not is_timed(stream) or timestamps_of(stream) not in file:
        raise FaultError(f"Expected a stream with stamps, got {stream}; name a stream that the file holds")
    return file[timestamps_of(stream)]


def blocks(dataset: h5py.Dataset, rows: slice | None = None) -> Iterator[slice]:
    """Cut rows into slices of a size that fits memory, whole chunks where that is possible."""
    start, stop, _ = (rows or slice(None)).indices(len(dataset))
    row_bytes = max(1, dataset.dtype.itemsize * int(np.prod(dataset.shape[1:])))
    step = max(1, _BLOCK_BYTES // row_bytes)
    if dataset.chunks:
        step = max(1, step // dataset.chunks[0]) * dataset.chunks[0]
    edges = [start, *range((start // step + 1) * step, stop, step), stop]
    return (slice(begin, end) for begin, end in pairwise(edges) if begin < end)


def edit(dataset: h5py.Dataset, rows: slice, change: Callable[[Array], Array]) -> None:
    """Replace rows of a dataset in place, block by block.

    Parameters
    ----------
    rows
        Those that change.
    change
        From a block of rows to one of the same shape.
    """
    for block in blocks(dataset, rows):
        dataset[block] = change(dataset[block])


def edit_values(file: h5py.File, fault: Fault, change: Callable[[Array], Array]) -> None:
    """Apply a change to every value of the fault's streams, within its interval.

    Parameters
    ----------
    change
        From a block of rows to one of the same shape.
    """
    for stream in streams_in(file, fault.stream):
        window = window_of(file, stream, fault)
        for dataset in values_in(file, stream):
            edit(dataset, window, change)


def origin_us(file: h5py.File) -> int:
    """Return the earliest first timestamp of the file, us."""
    keys = {*TIMESTAMPS_OF.values(), *map(timestamps_of, flow_streams_in(file))}
    firsts = [int(np.min(file[key][:1])) for key in keys if key in file and len(file[key])]
    return min(firsts, default=0)


def rows_before(timestamps: h5py.Dataset, times_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the rows (m,) stamped before each of ``times_us`` (m,), which in a sorted stream is their index."""
    counts = np.zeros(len(times_us), np.int64)
    for block in blocks(timestamps):
        rows_us = timestamps[block]
        starts_us = rows_us[:, 0] if rows_us.ndim == 2 else rows_us  # an interval of flow is stamped with its start
        counts += np.searchsorted(starts_us, times_us, side="left")
    return counts


def length_of(file: h5py.File, stream: str) -> int:
    """Return the number of rows of a stream; no fault can be planted in an empty one."""
    length = len(next(iter(datasets_in(file, stream).values())))
    if length == 0:
        raise FaultError(f"Expected rows in {stream}, got none; name another stream")
    return length


def window_of(file: h5py.File, stream: str, fault: Fault) -> slice:
    """Return the rows of a stream that lie in the fault's interval.

    Raises
    ------
    FaultError
        No row lies in the interval, or the stream has none.
    """
    if fault.start_s is None and fault.stop_s is None:
        return slice(0, length_of(file, stream))
    timestamps = timestamps_in(file, stream)
    limits_us = [
        origin_us(file) + round(end_s * US_PER_S) for end_s in (fault.start_s, fault.stop_s) if end_s is not None
    ]
    rows = [int(row) for row in rows_before(timestamps, np.array(limits_us, np.int64))]
    start = rows[0] if fault.start_s is not None else 0
    stop = rows[-1] if fault.stop_s is not None else len(timestamps)
    if start >= stop:
        raise FaultError(f"Expected rows of {stream} between {fault.start_s} and {fault.stop_s} s, got none")
    return slice(start, stop)


def affected_rows(file: h5py.File, stream: str, fault: Fault, count: int) -> slice:
    """Return consecutive rows from ``start_s`` on, or in the middle of the stream; never the first row.

    Parameters
    ----------
    file, stream
        The rows are those of the stream's datasets.
    fault
        Its interval confines the rows.
    count
        Number of rows.

    Raises
    ------
    FaultError
        The stream, or the interval up to ``stop_s``, has too few rows.
    """
    length = length_of(file, stream)
    if count > length - 1:
        raise FaultError(f"Expected fewer than the {length} rows of {stream}, got {count}; lower the magnitude")
    first = window_of(file, stream, fault).start if fault.start_s is not None else (length - count + 1) // 2
    first = min(max(first, 1), length - count)
    require_before_stop(file, stream, fault, first + count)
    return slice(first, first + count)


def require_before_stop(file: h5py.File, stream: str, fault: Fault, stop: int) -> None:
    """Raise FaultError where rows up to ``stop``, not included, would leave the fault's interval."""
    if fault.stop_s is not None and stop > window_of(file, stream, fault).stop:
        raise FaultError(
            f"Expected {fault.magnitude:g} {fault.unit} of {stream} before {fault.stop_s:g} s, got rows after it; "
            "lower the magnitude, or start earlier"
        )


def keep_rows(dataset: h5py.Dataset, keep: Callable[[slice], NDArray[np.bool_]]) -> None:
    """Remove rows in place.

    Parameters
    ----------
    dataset
        Chunked, with an unlimited first axis.
    keep
        From a block of rows to a mask of those that stay.

    Raises
    ------
    FaultError
        The dataset cannot be resized.
    """
    _require_resizable(dataset)
    length = 0  # of the rows that stay, so far
    for block in blocks(dataset):
        mask = keep(block)
        if length == block.start and mask.all():
            length = block.stop  # every row so far stays at its place: no need to compress these rows again
            continue
        rows = dataset[block][mask]
        dataset[length : length + len(rows)] = rows
        length += len(rows)
    dataset.resize(length, axis=0)


def delete_rows(file: h5py.File, stream: str, rows: slice) -> None:
    """Remove consecutive rows from every dataset of a stream."""
    for dataset in datasets_in(file, stream).values():
        keep_rows(
            dataset,
            lambda block: (
                (np.arange(block.start, block.stop) < rows.start) | (np.arange(block.start, block.stop) >= rows.stop)
            ),
        )


def insert_rows(dataset: h5py.Dataset, before: NDArray[np.int64], values: Array) -> None:
    """Insert rows in place.

    It works from the end of the dataset, so that no row is overwritten before it has been moved.

    Parameters
    ----------
    dataset
        Chunked, with an unlimited first axis.
    before
        (m,) row, in the numbering before the insertion, in front of which each value is inserted; ascending.
    values
        (m, ...) rows to insert.

    Raises
    ------
    FaultError
        The dataset cannot be resized.
    """
    _require_resizable(dataset)
    old_length = len(dataset)
    old_blocks = list(blocks(dataset))
    dataset.resize(old_length + len(before), axis=0)
    stop = len(before)  # of the values that are not inserted yet
    for block in reversed(old_blocks):
        first = int(np.searchsorted(before, block.start))
        merged = np.insert(dataset[block], before[first:stop] - block.start, values[first:stop], axis=0)
        dataset[block.start + first : block.start + first + len(merged)] = merged
        stop = first


def _require_resizable(dataset: h5py.Dataset) -> None:
    if dataset.chunks is None or dataset.maxshape[0] is not None:
        raise FaultError(
            f"Expected {dataset.name} to be chunked with an unlimited first axis, as the layout has it, "
            f"got maxshape {dataset.maxshape}; write it so, or plant a fault that keeps the number of rows"
        )
