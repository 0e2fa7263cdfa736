"""Replace the rows of datasets, with the index maps that follow from them."""

from typing import Any, Final

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import DATASETS

FLOW_RATES: Final = ("10hz", "25hz", "50hz")
CANONICAL_STORAGE: Final[dict[str, Any]] = {**hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=1), "fletcher32": True}


def present_keys(file: h5py.File) -> list[str]:
    """Return the keys of the layout that the file holds."""
    return [key for key in DATASETS if key in file]


def timestamp_keys(file: h5py.File) -> list[str]:
    """Return the keys of all timestamps that the file holds."""
    return [key for key in present_keys(file) if DATASETS[key].is_timestamps]


def replace_values(file: h5py.File, key: str, values: NDArray[Any], **storage: Any) -> None:
    """Store other values under a key, with the attributes of the old ones; ``storage`` as in the layout if empty."""
    attributes = dict(file[key].attrs)
    del file[key]
    if not storage and DATASETS[key].chunk_rows:
        rows = min(DATASETS[key].chunk_rows, max(1, len(values)))
        storage = {**CANONICAL_STORAGE, "chunks": (rows, *values.shape[1:])}
    file.create_dataset(key, data=values, **storage)
    file[key].attrs.update(attributes)


def keep_rows(file: h5py.File, stream: str, rows: slice | NDArray[Any]) -> None:
    """Keep some rows of all datasets of a stream."""
    for key in present_keys(file):
        if DATASETS[key].stream == stream:
            replace_values(file, key, file[key][...][rows])


def update_index_maps(file: h5py.File) -> None:
    """Count the events before each frame: entry i is the least k with ``t_event[k] >= t_frame[i]``."""
    for stream in ("rgb", "depth"):
        timestamps_us = file[f"path/{stream}_ts"][...]
        indices = np.searchsorted(file["path/events/t"][...], timestamps_us, side="left")
        replace_values(file, f"metadata/{stream}_to_event", indices.astype(np.int64))
