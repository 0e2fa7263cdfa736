"""Refuse datasets that claim more than their file can hold, or a machine can take.

A header claims any size in a few bytes. What is checked is decoded, so that work and memory must be bounded by what the
file truly stores, before the first byte is read. Nothing here depends on values.
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
"""What was never written reads as fill values. More than this, and more than was written, is a claim and no data."""

MOST_EXPANSION: Final = 1 << 15
"""The most that any one codec of HDF5 makes of a byte: Zstandard's shortest block takes 4 bytes and gives 128 KiB (RFC
8878, 3.1.1.2). Deflate gives 1032, Blosc with Zstandard 7900 as measured on zeros. More is a codec within a codec."""

SMALL_BYTES: Final = 64 << 20
"""Decoded, this costs nobody anything."""


def require_bounded(spec: DatasetSpec, dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset that is larger than its bytes can hold, or than a machine should take.

    Parameters
    ----------
    spec
        What the dataset is to be; its shape has been found legal.

    Raises
    ------
    RefusedError
        A chunk, an image or a stream of samples beyond the limits above; chunks that lie over each other; far more
        claimed than written.
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
        return  # its sources have been held to the same
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
    """Count the chunks that take no place in the file, and all chunks: a writer that was stopped leaves such."""
    if not prod(dataset.shape):  # not its size, which wraps around at 2^63
        return 0, 0
    if dataset.chunks is None:
        if dataset.is_virtual:
            return 0, 1  # its sources have been looked at
        return int(dataset.id.get_storage_size() == 0), 1
    # Chunks at the far edges count whole: HDF5 stores them padded.
    chunks = prod(ceil(size / chunk) for size, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    return chunks - dataset.id.get_num_chunks(), chunks


def require_small_chunks(dataset: h5py.Dataset, path: str) -> None:
    """Refuse chunks above ``LARGEST_CHUNK_BYTES``, which one value would be decoded with."""
    chunk_bytes = prod(dataset.chunks) * dataset.dtype.itemsize if dataset.chunks else 0
    if chunk_bytes > LARGEST_CHUNK_BYTES:
        _refuse_size(path, f"chunks of {LARGEST_CHUNK_BYTES} bytes", f"{chunk_bytes} bytes")


def _refuse_size(path: str, most: str, size: str) -> None:
    raise RefusedError("too_large", "wrong_shape", f"Expected {path} in {most} at most, got {size}")


def _file_bytes(dataset: h5py.Dataset) -> int:
    return int(dataset.file.id.get_filesize())
