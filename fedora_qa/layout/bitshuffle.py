"""Verify chunks of Bitshuffle before HDF5 decodes them.

The decoder follows the sizes in a chunk without comparing them with its length: a damaged chunk makes it read and
write beyond its memory. Of 15,000 damaged chunks, all that ended the process had a size that these tests refuse:
docs/hostile-files.md.
"""

import struct
from itertools import product
from math import prod
from typing import Final

import h5py

from fedora_qa.layout.filters import FLETCHER32_BYTES, filters_of
from fedora_qa.layout.links import RefusedError

BITSHUFFLE: Final = 32008
"""The number under which the filter is registered with HDF5."""

_PIPELINES: Final = ([BITSHUFFLE], [BITSHUFFLE, h5py.h5z.FILTER_FLETCHER32])
"""Sequences of filters whose chunks are verified: behind any other filter the bytes are not those that are stored."""

_ELEMENT_BYTES: Final = 2
_CODEC: Final = 4
"""Where the parameters of the filter hold the size of a value and the codec (bshuf_h5filter.c)."""

_PACKED: Final = (2, 3)
"""LZ4 and Zstandard; without a codec the bits of the values are transposed and keep their length."""

_HEADER: Final = struct.Struct(">QI")
"""Bytes of all values, and bytes of a block, before the blocks of a packed chunk."""

_BLOCK: Final = struct.Struct(">I")
"""Packed bytes of a block, before each of them."""

_VALUES_TOGETHER: Final = 8
"""Values whose bits are transposed together; those left over at the end of a chunk are stored as they are."""


def require_verifiable(dataset: h5py.Dataset, path: str) -> None:
    """Refuse Bitshuffle with parameters that do not fit the values, or before another filter than a checksum.

    Raises
    ------
    RefusedError
        Such a chunk cannot be verified before it is decoded.
    """
    if not uses_bitshuffle(dataset):
        return
    numbers = [number for number, _ in filters_of(dataset)]
    parameters = _parameters(dataset)
    value_bytes = dataset.id.get_type().get_size()
    fits = len(parameters) > _ELEMENT_BYTES and parameters[_ELEMENT_BYTES] == value_bytes
    if numbers not in _PIPELINES or not fits:
        message = (
            f"Expected {path} through a codec whose chunks can be verified, got Bitshuffle with filters {numbers} and "
            f"parameters {list(parameters)}; write the data again through Blosc-Zstd"
        )
        raise RefusedError("unsafe_filter", "unknown", message)


def uses_bitshuffle(dataset: h5py.Dataset) -> bool:
    """Whether chunks of a dataset pass through Bitshuffle."""
    return bool(dataset.chunks) and any(number == BITSHUFFLE for number, _ in filters_of(dataset))


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
    parameters = _parameters(dataset)
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


def _parameters(dataset: h5py.Dataset) -> tuple[int, ...]:
    """Return the parameters of the filter, which stands first in all pipelines that are verified."""
    return tuple(dataset.id.get_create_plist().get_filter(0)[2])
