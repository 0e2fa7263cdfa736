"""Refuse datasets whose stated size exceeds what their file can hold, or what a machine can process.

A header states any size in a few bytes. A dataset is decoded to be checked, so that work and memory must be bounded by
its stored bytes before the first of them is read. No bound depends on values.
"""

from math import ceil, prod
from typing import Final

import h5py

from fedora_qa.layout.canonical import DatasetSpec
from fedora_qa.layout.links import RefusedError

LARGEST_CHUNK_BYTES: Final = 512 << 20
"""A chunk is decoded whole. An image of 33 megapixels with two channels of float64 takes as much."""

LARGEST_IMAGE_PIXELS: Final = 1 << 25
"""An image of 7680 x 4320 fits. Checks hold a dozen arrays of an image's size."""

MOST_SAMPLES: Final = 1 << 25
"""Timestamps of frames and samples, and index maps, are held whole: nine hours of an IMU at 1 kHz fit."""

MOST_UNWRITTEN_BYTES: Final = 64 << 20
"""Chunks that were never written read as fill values. A dataset with more of these, and with more of these than of
written ones, is refused."""

MOST_EXPANSION: Final = 1 << 15
"""Largest number of bytes that one codec of HDF5 decodes from a byte: Zstandard's shortest block has 4 bytes and holds
128 KiB (RFC 8878, 3.1.1.2). Deflate reaches 1032, Blosc with Zstandard 7900 as measured on zeros. Only a codec within a
codec reaches more."""

SMALL_BYTES: Final = 64 << 20
"""A dataset of this decoded size is harmless, however it is stored."""


def require_bounded(spec: DatasetSpec, dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset that is larger than its bytes can hold, or than a machine should process.

    Parameters
    ----------
    spec
        Description of the dataset, whose shape has been tested against it.

    Raises
    ------
    RefusedError
        A chunk, an image or a stream of samples is beyond the limits above; chunks overlap; far more is stated than
        written.
    """
    require_small_chunks(dataset, path)
    # Axis 0 is time, axes 1 and 2 are rows and columns; channels do not count.
    pixels = prod(dataset.shape[1:3])
    if spec.is_image and pixels > LARGEST_IMAGE_PIXELS:
        _refuse_size(path, f"images of {LARGEST_IMAGE_PIXELS} pixels", f"{pixels} pixels")
    # Events are read block by block, so that their number needs no bound. All other rows are held in memory whole.
    if not spec.is_image and spec.stream != "events" and dataset.shape[0] > MOST_SAMPLES:
        _refuse_size(path, f"{MOST_SAMPLES} rows", f"{dataset.shape[0]} rows")
    if dataset.is_virtual or dataset.external:
        return  # its sources have passed the same tests
    decoded, stored = prod(dataset.shape) * dataset.dtype.itemsize, int(dataset.id.get_storage_size())
    # Chunks of a correct file do not overlap, so that their sum is at most the size of the file. A hostile index points
    # to one chunk many times.
    if stored > _file_bytes(dataset):
        message = (
            f"Expected the chunks of {path} beside each other, got {stored} bytes of them in a file of "
            f"{_file_bytes(dataset)}: they lie over each other, or beyond its end"
        )
        raise RefusedError("overlapping_chunks", "corrupt_chunk", message)
    if decoded <= SMALL_BYTES:
        return
    unwritten, chunks = unwritten_chunks(dataset)
    lost = decoded * unwritten // chunks
    # Both conditions: what a stopped writer leaves with less than half unwritten is reported, and stays readable.
    if lost > MOST_UNWRITTEN_BYTES and 2 * unwritten > chunks:
        message = f"Expected {path} to be written, got {unwritten} of {chunks} chunks ({lost} bytes) that never were"
        raise RefusedError("unwritten", "truncated", message, 100 * unwritten / chunks)
    if decoded > MOST_EXPANSION * max(stored, 1):
        message = f"Expected {path} to unpack to {MOST_EXPANSION} times its size at most, got {decoded} of {stored}"
        raise RefusedError("expands", "unknown", f"{message} bytes; write it through one codec")


def unwritten_chunks(dataset: h5py.Dataset) -> tuple[int, int]:
    """Return the numbers of chunks without a place in the file, which a stopped writer leaves, and of all chunks."""
    if not prod(dataset.shape):  # not its size, which wraps around at 2^63
        return 0, 0
    if dataset.chunks is None:
        if dataset.is_virtual:
            return 0, 1  # its sources have been tested
        return int(dataset.id.get_storage_size() == 0), 1
    # Chunks at the far edges count whole: HDF5 stores them padded.
    chunks = prod(ceil(size / chunk) for size, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    return chunks - dataset.id.get_num_chunks(), chunks


def require_small_chunks(dataset: h5py.Dataset, path: str) -> None:
    """Refuse chunks above ``LARGEST_CHUNK_BYTES``: HDF5 decodes a whole chunk for one value."""
    chunk_bytes = prod(dataset.chunks) * dataset.dtype.itemsize if dataset.chunks else 0
    if chunk_bytes > LARGEST_CHUNK_BYTES:
        _refuse_size(path, f"chunks of {LARGEST_CHUNK_BYTES} bytes", f"{chunk_bytes} bytes")


def _refuse_size(path: str, most: str, size: str) -> None:
    raise RefusedError("too_large", "wrong_shape", f"Expected {path} in {most} at most, got {size}")


def _file_bytes(dataset: h5py.Dataset) -> int:
    return int(dataset.file.id.get_filesize())
