"""Create datasets as the canonical layout describes them."""

from collections.abc import Mapping
from typing import Any, Final

import h5py
import hdf5plugin

from fedora_qa.layout.canonical import spec_of

LEVEL: Final = 5
"""Of Zstandard; how hard it tries is no part of the layout."""


def create_dataset(file: h5py.File, key: str, sizes: Mapping[str, int], *, level: int = LEVEL) -> h5py.Dataset:
    """Create one dataset with the type, chunks, codec, checksum and ``units`` of the layout.

    Parameters
    ----------
    file
        An HDF5 file open for writing.
    key
        A key of ``DATASETS``.
    sizes
        A number for each symbolic size of the dataset's shape. The axis of time can grow later.
    level
        Of compression, 1 to 9.

    Raises
    ------
    KeyError
        The key is not of the layout, or a size is missing.
    """
    spec = spec_of(key)
    shape = tuple(size if isinstance(size, int) else sizes[size] for size in spec.shape)
    storage: dict[str, Any] = {}
    if spec.chunk_rows:
        storage = {
            "chunks": (spec.chunk_rows, *shape[1:]),
            # Unlimited along time: rows can be appended later.
            "maxshape": (None, *shape[1:]),
            "fletcher32": True,
            # The pipeline of layout 1.0; ``direct_chunks`` decodes it without HDF5.
            **hdf5plugin.Blosc(cname="zstd", clevel=level, shuffle=hdf5plugin.Blosc.SHUFFLE),
        }
    dataset = file.create_dataset(key, shape=shape, dtype=spec.dtype, **storage)
    dataset.attrs["units"] = spec.units
    return dataset
