"""Refuse datasets that HDF5 cannot decode, or not safely: by filters, chunks, blocks of Bitshuffle and sizes.

A header states any size in a few bytes. A dataset is decoded to be checked, so that work and memory must be bounded by
its stored bytes before the first of them is read. No bound depends on values.

The decoder of Bitshuffle follows the sizes in a chunk without comparing them with its length: a damaged chunk makes it
read and write beyond its memory. Of 15,000 damaged chunks, all that ended the process had a size that these tests
refuse: docs/hostile-files.md.
"""

import struct
from collections.abc import Iterator
from itertools import product
from math import ceil, prod
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  the import registers the codecs with HDF5

from fedora_qa.layout.canonical import DatasetSpec
from fedora_qa.layout.hdf5_objects import RefusedError

_KNOWN_FILTERS: Final = {
    4: "szip",
    32002: "MAFISC",
    32007: "JPEG-XR",
    32010: "LPC-Rice",
    32014: "fpzip",
    32018: "FCIDECOMP",
    32019: "JPEG",
    32020: "VBZ",
    32022: "BitGroom",
    32023: "Granular BitRound",
    32025: "Delta-Rice",
    32027: "FLAC",
    36559: "ECF, Prophesee's codec for events (github.com/prophesee-ai/hdf5_ecf)",
}
"""Filters that neither HDF5 nor hdf5plugin brings, by the numbers under which they are registered."""

_BITSHUFFLE: Final = 32008
"""The number under which Bitshuffle is registered with HDF5."""

_VERIFIABLE: Final = ([_BITSHUFFLE], [_BITSHUFFLE, h5py.h5z.FILTER_FLETCHER32])
"""Sequences of filters with Bitshuffle whose chunks can be verified: behind another codec its bytes are not at hand."""

_ELEMENT_BYTES: Final = 2
"""Where the parameters of Bitshuffle hold the size of a value (bshuf_h5filter.c)."""

FLETCHER32_BYTES: Final = 4
"""Length of the checksum of Fletcher-32 behind each chunk."""

_LENGTH_KEEPING_FILTERS: Final = frozenset({h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32})
"""Filters that keep the length of a chunk, but for the checksum."""

_CODEC: Final = 4
"""Where the parameters of Bitshuffle hold the codec (bshuf_h5filter.c)."""

_PACKED: Final = (2, 3)
"""The codecs LZ4 and Zstandard; without one the bits of the values are transposed and keep their length."""

_HEADER: Final = struct.Struct(">QI")
"""Bytes of all values, and bytes of a block, before the blocks of a packed chunk."""

_BLOCK: Final = struct.Struct(">I")
"""Packed bytes of a block, before each of them."""

_VALUES_TOGETHER: Final = 8
"""Values whose bits Bitshuffle transposes together; those left over at the end of a chunk are stored as they are."""

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


def require_filters(dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset that cannot be decoded here, or not safely.

    Chunks of Bitshuffle are verified before they are decoded (``require_sound_blocks``), where that is possible.

    Raises
    ------
    RefusedError
        A filter is not installed, or its chunks cannot be verified. The message names it and the remedy.
    """
    filters = list(filters_of(dataset))
    numbers = [number for number, _ in filters]
    if _BITSHUFFLE in numbers:
        parameters = filter_parameters(dataset, numbers.index(_BITSHUFFLE))
        fits = parameters[_ELEMENT_BYTES : _ELEMENT_BYTES + 1] == (dataset.id.get_type().get_size(),)
        if numbers not in _VERIFIABLE or not fits:
            message = (
                f"Expected {path} through a codec whose chunks can be verified, got Bitshuffle with filters {numbers} "
                f"and parameters {list(parameters)}; write the data again through Blosc-Zstd"
            )
            raise RefusedError("unsafe_filter", "unknown", message)
    for number, name in filters:
        if not h5py.h5z.filter_avail(number):
            # The name stands in the file and may have any length.
            title = _KNOWN_FILTERS.get(number) or name[:60] or "without a name"
            message = (
                f"Expected the filters of {path} to be installed, got number {number} ({title}), which is not; install "
                "its HDF5 plugin where HDF5_PLUGIN_PATH says, or write the data again through Blosc-Zstd"
            )
            raise RefusedError("missing_filter", "unknown", message)


def require_whole_chunks(dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset with a chunk too short for its values, or where a codec packs them, for its checksum.

    HDF5 2.0 subtracts the checksum from the stored size without a test, and takes the output of the filters for a whole
    chunk: a chunk of three bytes ends the process, and one of five shows memory that is not the file's.

    Raises
    ------
    RefusedError
        Names the first such chunk.
    """
    if not dataset.chunks:
        return
    filters = [number for number, _ in filters_of(dataset)]
    # Behind a codec only 1 byte is certain.
    keeps_length = _LENGTH_KEEPING_FILTERS.issuperset(filters)
    values_bytes = prod(dataset.chunks) * dataset.id.get_type().get_size() if keeps_length else 1
    checksums = [position for position, number in enumerate(filters) if number == h5py.h5z.FILTER_FLETCHER32]

    def too_short(chunk: h5py.h5d.StoreInfo) -> h5py.h5d.StoreInfo | None:
        # Bit i of ``filter_mask`` is set where filter i was left out for this chunk.
        applied = sum(not chunk.filter_mask >> position & 1 for position in checksums)
        return chunk if chunk.size < values_bytes + applied * FLETCHER32_BYTES else None

    short = dataset.id.chunk_iter(too_short)
    if short is not None:
        where = ", ".join(map(str, short.chunk_offset))
        message = f"Expected whole chunks in {path}, got one of {short.size} bytes at ({where})"
        raise RefusedError("short_chunk", "corrupt_chunk", message)


def filters_of(dataset: h5py.Dataset) -> Iterator[tuple[int, str]]:
    """Yield number and name of the filters of a dataset, in the order in which a writer applies them."""
    properties = dataset.id.get_create_plist()
    for position in range(properties.get_nfilters()):
        number, _, _, name = properties.get_filter(position)
        yield number, name.decode("utf-8", "replace")


def filter_parameters(dataset: h5py.Dataset, position: int) -> tuple[int, ...]:
    """Return the parameters of the filter at a position, counted in the order in which a writer applies them."""
    return tuple(dataset.id.get_create_plist().get_filter(position)[2])


def uses_bitshuffle(dataset: h5py.Dataset) -> bool:
    """Whether chunks of a dataset pass through Bitshuffle."""
    return bool(dataset.chunks) and any(number == _BITSHUFFLE for number, _ in filters_of(dataset))


def require_sound_blocks(dataset: h5py.Dataset, start: int, stop: int) -> None:
    """Verify the sizes in all chunks that hold some rows; do nothing for a dataset without Bitshuffle.

    Raises
    ------
    OSError
        A size in a chunk contradicts the length of the chunk or of its values.
    """
    if not uses_bitshuffle(dataset):
        return
    rows, *others = (range(0, length, size) for length, size in zip(dataset.shape, dataset.chunks, strict=True))
    size = dataset.chunks[0]
    for corner in product(rows[start // size : -(-stop // size)], *others):
        require_sound_chunk(dataset, corner)


def require_sound_chunk(dataset: h5py.Dataset, corner: tuple[int, ...]) -> None:
    """Verify the sizes in the chunk of Bitshuffle that begins at an index.

    Raises
    ------
    OSError
        As for ``require_sound_blocks``.
    """
    stored = dataset.id.get_chunk_info_by_coord(corner)
    if not stored.size:  # never written
        return
    # Bit i of the mask is set where filter i was left out for this chunk.
    mask, content = dataset.id.read_direct_chunk(corner)
    length = len(content)
    if dataset.id.get_create_plist().get_nfilters() > 1 and not mask & 2:
        length -= FLETCHER32_BYTES
    parameters = filter_parameters(dataset, 0)
    packed = not mask & 1 and len(parameters) > _CODEC and parameters[_CODEC] in _PACKED
    value_bytes = dataset.id.get_type().get_size()
    if not _is_sound(content, length, prod(dataset.chunks), value_bytes, packed=packed):
        where = ", ".join(map(str, corner))
        raise OSError(f"Expected blocks of Bitshuffle that fill the chunk at ({where}), got other sizes")


def _is_sound(content: bytes, length: int, values: int, value_bytes: int, *, packed: bool) -> bool:
    """Whether the blocks of a chunk fill its first ``length`` bytes, and hold all of its values."""
    if not packed:
        return length == values * value_bytes
    if length < _HEADER.size:
        return False
    total_bytes, block_bytes = _HEADER.unpack_from(content)
    together_bytes = _VALUES_TOGETHER * value_bytes
    if total_bytes != values * value_bytes or block_bytes == 0 or block_bytes % together_bytes:
        return False
    remainder_bytes = total_bytes % together_bytes
    position = _HEADER.size
    for _ in range(-(-(total_bytes - remainder_bytes) // block_bytes)):
        if position + _BLOCK.size > length:
            return False
        position += _BLOCK.size + _BLOCK.unpack_from(content, position)[0]
    return bool(position + remainder_bytes == length)


def require_bounded_shape(spec: DatasetSpec, shape: tuple[int, ...], path: str) -> None:
    """Refuse images of too many pixels, or too many rows of samples, wherever they are stored."""
    # Axis 0 is time, axes 1 and 2 are rows and columns; channels do not count.
    pixels = prod(shape[1:3])
    if spec.is_image and pixels > LARGEST_IMAGE_PIXELS:
        _refuse_size(path, f"images of {LARGEST_IMAGE_PIXELS} pixels", f"{pixels} pixels")
    # Events are read block by block, so that their number needs no bound. All other rows are held in memory whole.
    if not spec.is_image and spec.stream != "events" and shape[0] > MOST_SAMPLES:
        _refuse_size(path, f"{MOST_SAMPLES} rows", f"{shape[0]} rows")


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
    require_bounded_shape(spec, dataset.shape, path)
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
