"""Refuse datasets that HDF5 cannot decode: by their filters, and by chunks too short for them."""

from collections.abc import Iterator
from math import prod
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  the import registers the codecs with HDF5

from fedora_qa.layout.links import RefusedError

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

BITSHUFFLE: Final = 32008
"""The number under which Bitshuffle is registered with HDF5."""

_VERIFIABLE: Final = ([BITSHUFFLE], [BITSHUFFLE, h5py.h5z.FILTER_FLETCHER32])
"""Sequences of filters with Bitshuffle whose chunks can be verified: behind another codec its bytes are not at hand."""

_ELEMENT_BYTES: Final = 2
"""Where the parameters of Bitshuffle hold the size of a value (bshuf_h5filter.c)."""

FLETCHER32_BYTES: Final = 4
"""Length of the checksum of Fletcher-32 behind each chunk."""

_LENGTH_KEEPING_FILTERS: Final = frozenset({h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32})
"""Filters that keep the length of a chunk, but for the checksum."""


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
    if BITSHUFFLE in numbers:
        parameters = filter_parameters(dataset, numbers.index(BITSHUFFLE))
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
