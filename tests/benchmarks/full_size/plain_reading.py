"""The yardstick: every dataset of a file decoded once by plain h5py, chunk by chunk, in one thread."""

import json
import time
from pathlib import Path
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  (reading needs its filters)
import numpy as np

_ROWS_WITHOUT_CHUNKS: Final = 1 << 20


def decode(path: Path, *, keep: bool = True) -> int:
    """Decode every row of every dataset, and return how many bytes that were.

    All chunks of a dataset go into one array that is kept, or each into a new one. Pages of new arrays may have to come
    from the system, which depends on the sizes of those before; the kept array is faster, and always the same.
    """
    decoded = 0

    def read(_: str, item: h5py.Dataset | h5py.Group) -> None:
        nonlocal decoded
        if isinstance(item, h5py.Dataset) and item.shape:
            rows = item.chunks[0] if item.chunks else _ROWS_WITHOUT_CHUNKS
            kept = np.empty((min(rows, len(item)), *item.shape[1:]), item.dtype) if keep and item.size else None
            for start in range(0, len(item), rows):
                if kept is None:
                    decoded += item[start : start + rows].nbytes
                else:
                    part = kept[: len(item) - start]
                    item.read_direct(part, np.s_[start : start + len(part)])
                    decoded += part.nbytes

    with h5py.File(path) as file:
        file.visititems(read)
    return decoded


def main(path: str, target: str) -> None:
    """Decode a file in both ways, and write what that took, after doing it once: that brings it into memory."""
    decode(Path(path))
    said = {"decoded_bytes": 0.0}
    for keep, name in ((True, "wall_s"), (False, "new_arrays_wall_s")):
        began = time.perf_counter()
        said["decoded_bytes"] = decode(Path(path), keep=keep)
        said[name] = time.perf_counter() - began
    Path(target).write_text(json.dumps(said), encoding="utf-8")
