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

from fedora_qa.layout.filters import BITSHUFFLE, FLETCHER32_BYTES, filter_parameters, filters_of

_CODEC: Final = 4
"""Where the parameters of the filter hold the codec (bshuf_h5filter.c)."""

_PACKED: Final = (2, 3)
"""LZ4 and Zstandard; without a codec the bits of the values are transposed and keep their length."""

_HEADER: Final = struct.Struct(">QI")
"""Bytes of all values, and bytes of a block, before the blocks of a packed chunk."""

_BLOCK: Final = struct.Struct(">I")
"""Packed bytes of a block, before each of them."""

_VALUES_TOGETHER: Final = 8
"""Values whose bits are transposed together; those left over at the end of a chunk are stored as they are."""


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
