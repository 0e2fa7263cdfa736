"""Copy rows of a dataset into the file of a piece as they are stored: type, chunks, codec, checksum, attributes.

Whole chunks are copied as bytes, so that a damaged chunk stays damaged, and one that was never written stays unwritten.
Rows that start within a chunk are decoded and encoded again.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from math import ceil, prod
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.decodable import require_sound_blocks
from fedora_qa.layout.hdf5_objects import READ_ERRORS

_COPIED_AT_ONCE: Final = 16 << 20
"""Bytes of decoded rows in memory at once."""


def copy_attributes(source: h5py.Group | h5py.Dataset, target: h5py.Group | h5py.Dataset) -> None:
    """Copy attributes with their stored types, except those that cannot be read or refer to objects of the file."""
    names: list[str | bytes] = []
    with suppress(*READ_ERRORS):
        names += source.attrs
    for name in names:
        coded = name if isinstance(name, bytes) else name.encode()  # h5py returns names that are no UTF-8 as bytes
        with suppress(*READ_ERRORS):
            stored = h5py.h5a.open(source.id, coded)
            # A reference is an address within its file; in the piece it would point at other bytes.
            if _holds_references(stored.get_type()):
                continue
            copy = h5py.h5a.create(target.id, coded, stored.get_type(), stored.get_space())
            # A null dataspace has no values to copy; reading it raises.
            if stored.get_space().get_simple_extent_type() != h5py.h5s.NULL:
                values = np.empty(stored.shape, dtype=stored.dtype)
                stored.read(values, mtype=stored.get_type())
                copy.write(values, mtype=stored.get_type())


def _holds_references(stored_type: Any) -> bool:
    return bool(stored_type.detect_class(h5py.h5t.REFERENCE))


def needs_whole_chunks(dataset: h5py.Dataset, start: int, stop: int) -> bool:
    """Whether some rows cannot be decoded or were never written, which only a copy of whole chunks preserves."""
    if dataset.chunks is None or start % dataset.chunks[0] == 0:
        return False
    try:
        # The number of chunks that hold any of the rows: along the rows, times across the other axes.
        along = ceil(stop / dataset.chunks[0]) - start // dataset.chunks[0]
        across = (ceil(size / chunk) for size, chunk in zip(dataset.shape[1:], dataset.chunks[1:], strict=True))
        chunk_count = along * prod(across) if stop > start else 0
        # A chunk that was never written reads as the fill value; decoding would store it and remove that fault.
        if len(_written_corners(dataset, start, stop)) < chunk_count:
            return True
        # Decoding is the only test of a checksum; the values are not needed.
        for _ in _blocks(dataset, start, stop):
            continue
    except READ_ERRORS:
        return True
    return False


def copy_rows(dataset: h5py.Dataset, parent: h5py.Group, name: str, start: int, stop: int) -> None:
    """Copy rows of a dataset to a new dataset beneath a group.

    Raises
    ------
    OSError
        Rows that begin within a chunk cannot be decoded; see ``needs_whole_chunks``.
    """
    copy = new_dataset(dataset, parent, name, stop - start)
    if (
        dataset.chunks is not None
        and start % dataset.chunks[0] == 0
        # Stored bytes may be addresses of values in the file, as those of variable-length texts are.
        and not _holds_references(dataset.id.get_type())
        and not dataset.id.get_type().detect_class(h5py.h5t.VLEN)
        and not dataset.dtype.hasobject
    ):
        for corner in _written_corners(dataset, start, stop):
            filters, stored = dataset.id.read_direct_chunk(corner)
            copy.id.write_direct_chunk((corner[0] - start, *corner[1:]), stored, filters)
    # Contiguous storage that was never written has a size of 0: it stays unwritten in the piece.
    elif dataset.chunks is not None or is_external(dataset) or dataset.id.get_storage_size():
        for first, rows in _blocks(dataset, start, stop):
            copy[first - start : first - start + len(rows)] = rows
    copy_attributes(dataset, copy)


def copy_whole(dataset: h5py.Dataset, parent: h5py.Group, name: str) -> None:
    """Copy a dataset of any shape beneath a group; one whose values lie in other files still refers to them.

    HDF5's own copy is not used: damaged objects make it end the process.
    """
    stored = dataset.id
    made = h5py.h5d.create(parent.id, name.encode(), stored.get_type(), stored.get_space(), stored.get_create_plist())
    copy = h5py.Dataset(made)
    if dataset.shape is not None and not is_external(dataset) and stored.get_storage_size():
        if dataset.shape:
            require_sound_blocks(dataset, 0, len(dataset))
        copy[()] = dataset[()]
    copy_attributes(dataset, copy)


def opened_beside_its_file(dataset: h5py.Dataset) -> h5py.Dataset:
    """Open an externally stored dataset again, so that HDF5 looks for its files beside the file that names them.

    HDF5 returns a dataset that is open already, with its old prefix. Therefore the given one is closed, and no other
    may be open.
    """
    file, name = dataset.file, dataset.name
    dataset.id.close()
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_efile_prefix(os.fsencode(Path(file.filename).parent))
    opened = h5py.h5d.open(file.id, name.encode("utf-8", "surrogateescape"), access)
    return h5py.Dataset(opened, readonly=True)


def is_external(dataset: h5py.Dataset) -> bool:
    """Whether the values of a dataset lie in other files."""
    return bool(dataset.is_virtual or dataset.external)


def new_dataset(dataset: h5py.Dataset, parent: h5py.Group, name: str, rows: int) -> h5py.Dataset:
    """Create an empty dataset with a number of rows, stored like another one, but always within the new file."""
    shape = (rows, *dataset.shape[1:])
    longest = None if dataset.chunks is None else (h5py.h5s.UNLIMITED, *dataset.shape[1:])
    space = h5py.h5s.create_simple(shape, longest)
    plain = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    # The creation properties of such a dataset name the other files; the piece holds the values itself.
    stored = plain if is_external(dataset) else dataset.id.get_create_plist()
    made = h5py.h5d.create(parent.id, name.encode(), dataset.id.get_type(), space, stored)
    return h5py.Dataset(made)


def _written_corners(dataset: h5py.Dataset, start: int, stop: int) -> list[tuple[int, ...]]:
    """Return the first index of every chunk that holds any of the rows and was ever written."""
    first, corners = start // dataset.chunks[0] * dataset.chunks[0], []

    def note(chunk: Any) -> None:
        if first <= chunk.chunk_offset[0] < stop:
            corners.append(tuple(chunk.chunk_offset))

    dataset.id.chunk_iter(note)
    return corners


def _blocks(dataset: h5py.Dataset, start: int, stop: int) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield rows block by block, each with its first row; only a chunk in which two blocks meet is decoded twice."""
    row_bytes = max(dataset.dtype.itemsize * int(np.prod(dataset.shape[1:], dtype=np.int64)), 1)
    rows = max(_COPIED_AT_ONCE // row_bytes, 1)
    if dataset.chunks is not None:
        # Whole chunks at a time, so that a chunk is not decoded again for the next block.
        rows = ceil(rows / dataset.chunks[0]) * dataset.chunks[0]
    for first in range(start, stop, rows):
        last = min(first + rows, stop)
        require_sound_blocks(dataset, first, last)
        yield first, dataset[first:last]
