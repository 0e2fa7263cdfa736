"""Faults of the file itself: missing, truncated, damaged, rounded, or stored in another form."""

import os
from pathlib import Path
from typing import Any, Final

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import CAMERAS, group_in
from fedora_generator.faults.rows import (
    blocks,
    datasets_in,
    delete_rows,
    edit,
    length_of,
    streams_in,
    values_in,
    window_of,
)

_LOSSY_TYPE: Final = {"uint8": "int8", "int64": "float32", "float64": "float16", "float32": "float16"}
"""Types that lose values: of 8-bit codes those above 127, of microseconds and indices those above 2^24, of samples all
but 11 bits."""

_LOSSY_DEPTH: Final = "uint8"
"""Depth as whole metres, as a writer of 8-bit images stores it."""

_DAMAGED_BYTES: Final = 16
_EVENT_TIMESTAMPS: Final = "path/events/t"


def truncated(file: h5py.File, fault: Fault) -> None:
    """Cut the last percent of the rows of a stream off, at least one."""
    for stream in streams_in(file, fault.stream):
        length = length_of(file, stream)
        delete_rows(file, stream, slice(length - _cut_length(length, fault), length))


def truncate_file(path: Path, fault: Fault) -> None:
    """Cut the last percent of the bytes of the file off."""
    size = path.stat().st_size
    os.truncate(path, size - _cut_length(size, fault))


def corrupt_chunk(path: Path, fault: Fault) -> None:
    """Invert 16 bytes in the middle of so many stored chunks of the stream's first dataset, at each rate of flow."""
    count = fault.positive_count()
    with h5py.File(path, locking=False) as file:  # the copy is open, with the lock, while a fault is planted
        of_streams = []  # offset and size in the file of every stored piece, by stream
        for stream in streams_in(file, fault.stream):
            dataset = _first_values(file, stream)
            if dataset.chunks is None:
                contiguous = (dataset.id.get_offset(), dataset.id.get_storage_size())
                of_streams.append([contiguous] if dataset.size else [])
            else:
                chunks = [dataset.id.get_chunk_info(index) for index in range(dataset.id.get_num_chunks())]
                of_streams.append([(chunk.byte_offset, chunk.size) for chunk in chunks])
    fewest = min(map(len, of_streams))
    if count > fewest:
        raise FaultError(f"Expected at most the {fewest} chunks of {fault.stream}, got {count}")
    rng = fault.rng()
    chunks_to_damage = [pieces[i] for pieces in of_streams for i in rng.choice(len(pieces), size=count, replace=False)]
    with path.open("r+b") as raw:
        for offset, size in sorted(chunks_to_damage):
            length = min(_DAMAGED_BYTES, size)
            raw.seek(offset + (size - length) // 2)
            intact = raw.read(length)
            raw.seek(-length, os.SEEK_CUR)
            raw.write(bytes(byte ^ 0xFF for byte in intact))


def missing_stream(file: h5py.File, fault: Fault) -> None:
    """Remove every dataset of the stream, or the whole group of metadata; declarations stay."""
    if fault.stream == "metadata":
        group_in(file, "metadata")
        del file["metadata"]
        return
    for stream in streams_in(file, fault.stream):
        for key in datasets_in(file, stream):
            del file[key]


def wrong_shape(file: h5py.File, fault: Fault) -> None:
    """Store the stream's first dataset with one axis more, of length 1; in the metadata, K as nine numbers."""
    if fault.stream == "metadata":
        for camera in group_in(file, CAMERAS).values():
            camera.attrs["K"] = np.ravel(camera.attrs["K"])
        return
    for stream in streams_in(file, fault.stream):
        dataset = _first_values(file, stream)
        _store_again(file, dataset, (*dataset.shape, 1), dataset.dtype)


def wrong_dtype(file: h5py.File, fault: Fault) -> None:
    """Store the first dataset (events: the stamps) in a type that loses values; of metadata, widths as text."""
    if fault.stream == "metadata":
        for camera in group_in(file, CAMERAS).values():
            camera.attrs["width"] = str(camera.attrs["width"])
        return
    for stream in streams_in(file, fault.stream):
        dataset = file[_EVENT_TIMESTAMPS] if stream == "events" else _first_values(file, stream)
        lossy = _LOSSY_DEPTH if stream == "depth" else _LOSSY_TYPE[dataset.dtype.name]
        _store_again(file, dataset, dataset.shape, np.dtype(lossy))


def quantised_values(file: h5py.File, fault: Fault) -> None:
    """Round every dataset of a stream to steps of so many percent of its largest absolute value."""
    share = abs(fault.magnitude_in("percent")) / 100
    for stream in streams_in(file, fault.stream):
        for dataset in values_in(file, stream):
            largest = max((float(np.nanmax(np.abs(block), initial=0.0)) for block in dataset), default=0.0)
            step = share * largest or 1.0

            def rounded(rows: NDArray[Any], step: float = step) -> NDArray[Any]:
                return (step * np.rint(rows / step)).astype(rows.dtype)

            edit(dataset, window_of(file, stream, fault), rounded)


def _cut_length(length: int, fault: Fault) -> int:
    percent = fault.magnitude_in("percent")
    if not 0 < percent <= 100:
        raise FaultError(f"Expected more than 0 and up to 100 percent, got {percent:g}")
    return max(1, round(length * percent / 100))


def _first_values(file: h5py.File, stream: str) -> h5py.Dataset:
    return values_in(file, stream)[0]


def _store_again(file: h5py.File, dataset: h5py.Dataset, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Replace a dataset by one of another shape or type with the same attributes and codec, and the nearest values."""
    key, temporary_key = dataset.name, f"{dataset.name}_aside"
    extra = (1,) * (len(shape) - dataset.ndim)
    replacement = file.create_dataset(
        temporary_key,
        shape,
        dtype,
        chunks=(*dataset.chunks, *extra) if dataset.chunks else None,
        maxshape=(*dataset.maxshape, *extra) if dataset.chunks else None,
        **(hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE) if dataset.chunks else {}),
    )
    for block in blocks(dataset):
        values = dataset[block]
        if dtype.kind in "iu":
            limits = np.iinfo(dtype)
            values = np.clip(np.nan_to_num(values), limits.min, limits.max)
        replacement[block] = values.astype(dtype).reshape(*values.shape, *extra)
    for name, value in dataset.attrs.items():
        replacement.attrs[name] = value
    del file[key]
    file.move(temporary_key, key)
