"""The yardstick: every dataset of a file decoded once by plain h5py, chunk by chunk, in one thread."""

import json
import time
from pathlib import Path
from typing import Final

import h5py
import hdf5plugin  # noqa: F401  (reading needs its filters)

_ROWS_WITHOUT_CHUNKS: Final = 1 << 20


def decode(path: Path) -> int:
    """Decode every row of every dataset, and return how many bytes that were."""
    decoded = 0

    def read(_: str, item: h5py.Dataset | h5py.Group) -> None:
        nonlocal decoded
        if isinstance(item, h5py.Dataset) and item.shape:
            rows = item.chunks[0] if item.chunks else _ROWS_WITHOUT_CHUNKS
            decoded += sum(item[start : start + rows].nbytes for start in range(0, len(item), rows))

    with h5py.File(path) as file:
        file.visititems(read)
    return decoded


def main(path: str, target: str) -> None:
    """Decode a file twice, and write what the second time took: the first brings it into memory."""
    decode(Path(path))
    began, began_cpu = time.perf_counter(), time.process_time()
    decoded = decode(Path(path))
    wall_s, cpu_s = time.perf_counter() - began, time.process_time() - began_cpu
    said = {"decoded_bytes": decoded, "wall_s": wall_s, "cpu_s": cpu_s}
    Path(target).write_text(json.dumps(said), encoding="utf-8")
