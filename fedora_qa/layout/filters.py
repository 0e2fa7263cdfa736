"""Refuse datasets whose bytes pass through filters that are not installed, or that a damaged chunk can crash."""

from collections.abc import Iterator
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  importing it is how HDF5 learns the codecs

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


UNSAFE_FILTERS: Final = {32008: "Bitshuffle"}
"""Filters whose decoder trusts the sizes in a chunk and writes beyond its memory: docs/hostile-files.md."""


def require_filters(dataset: h5py.Dataset, path: str) -> None:
    """Refuse a dataset that cannot be decoded here, or not safely.

    Raises
    ------
    RefusedError
        A filter is not installed, or is one that a damaged chunk can crash; names it and says what to do.
    """
    for number, name in filters_of(dataset):
        if number in UNSAFE_FILTERS:
            message = (
                f"Expected {path} through a codec that damaged bytes cannot crash, got {UNSAFE_FILTERS[number]}; "
                "write the data again through Blosc-Zstd"
            )
            raise RefusedError("unsafe_filter", "unknown", message)
        if not h5py.h5z.filter_avail(number):
            # The name stands in the file and may have any length.
            title = _KNOWN_FILTERS.get(number) or name[:60] or "without a name"
            message = (
                f"Expected the filters of {path} to be installed, got number {number} ({title}), which is not; install "
                "its HDF5 plugin where HDF5_PLUGIN_PATH says, or write the data again through Blosc-Zstd"
            )
            raise RefusedError("missing_filter", "unknown", message)


def filters_of(dataset: h5py.Dataset) -> Iterator[tuple[int, str]]:
    """Yield number and name of the filters of a dataset, the first that a writer applies first."""
    kept = dataset.id.get_create_plist()
    for position in range(kept.get_nfilters()):
        number, _, _, name = kept.get_filter(position)
        yield number, name.decode("utf-8", "replace")
