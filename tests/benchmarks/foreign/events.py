"""The order and the stamps of events."""

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import keep_rows, replace_values, update_index_maps


def order_by_columns(file: h5py.File) -> None:
    """Sort events of the same microsecond by column and then row; those of one pixel keep their order."""
    keys = [file[f"path/events/{name}"][...] for name in ("y", "x", "t")]
    keep_rows(file, "events", np.lexsort(keys))


def packets(file: h5py.File) -> None:
    """Stamp each event with the first tick of 200 us not before it, as a reader of packets does, and declare it."""
    timestamps_us = file["path/events/t"][...]
    replace_values(file, "path/events/t", -(-timestamps_us // 200) * 200)
    keys = [file[f"path/events/{name}"][...] for name in ("x", "y", "t")]
    keep_rows(file, "events", np.lexsort(keys))
    file["metadata/events"].attrs["packet_interval_us"] = np.int64(200)
    update_index_maps(file)
