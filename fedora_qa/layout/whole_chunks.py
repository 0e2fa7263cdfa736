"""Refuse chunks that are shorter than HDF5 takes them for.

HDF5 2.0 subtracts a checksum from the stored size without a look at it, and takes what comes out of the filters for a
whole chunk: a chunk of three bytes ends the process, one of five shows memory that is not the file's.
"""

from math import prod
from typing import Final

import h5py

from fedora_qa.layout.filters import filters_of
from fedora_qa.layout.links import RefusedError

_CHECKSUM_BYTES: Final = 4
"""Of Fletcher-32, behind each chunk."""

_OF_ONE_SIZE: Final = frozenset({h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32})
"""What leaves a chunk as long as it was, but for the checksum."""


def require_whole_chunks(dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset with a chunk too short for its values, or where a codec packs them, for its checksum.

    Raises
    ------
    RefusedError
        Names the first such chunk.
    """
    if not dataset.chunks:
        return
    filters = [number for number, _ in filters_of(dataset)]
    # Shuffle and Fletcher-32 keep the length of the values; behind a codec only 1 byte is certain.
    values_bytes = prod(dataset.chunks) * dataset.id.get_type().get_size() if _OF_ONE_SIZE.issuperset(filters) else 1
    checked = [place for place, number in enumerate(filters) if number == h5py.h5z.FILTER_FLETCHER32]

    def too_short(chunk: h5py.h5d.StoreInfo) -> h5py.h5d.StoreInfo | None:
        # Bit i of ``filter_mask`` is set where filter i was left out for this chunk.
        checksums = sum(not chunk.filter_mask >> place & 1 for place in checked)
        return chunk if chunk.size < values_bytes + checksums * _CHECKSUM_BYTES else None

    short = dataset.id.chunk_iter(too_short)
    if short is not None:
        where = ", ".join(map(str, short.chunk_offset))
        message = f"Expected whole chunks in {path}, got one of {short.size} bytes at ({where})"
        raise RefusedError("short_chunk", "corrupt_chunk", message)
