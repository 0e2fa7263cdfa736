"""Write chunks of Blosc that threads compress, without HDF5, which compresses one chunk at a time.

A reader sees no difference: the codec, its level and shuffle are those of the dataset, and the checksum follows.
"""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final, Self

import h5py
import numpy as np
from numcodecs import blosc
from numpy.typing import NDArray

from fedora_qa.layout.direct_chunks import fletcher32
from fedora_qa.layout.filters import FLETCHER32_BYTES, filter_parameters

_WAITING_BYTES: Final = 64 << 20
"""Decoded chunks that wait for a thread, or to be written. More are not accepted before the oldest is written."""

_BLOCK_BYTES: Final = 256 << 10
"""Bytes of a chunk that are compressed together. Each block begins without knowledge: larger ones become smaller, in
less time, than the 64 KiB that Blosc chooses, and fit the cache of a core. A reader takes the size from the chunk."""

# Places in the parameters of the filter (blosc_filter.c of hdf5-blosc).
_LEVEL, _SHUFFLE = 4, 5


class ChunkWriter:
    """Compresses whole chunks in threads, and writes them in the order in which they are given.

    Use as a context manager. Only the caller's thread calls HDF5.

    Parameters
    ----------
    threads
        Number of threads that compress.
    """

    def __init__(self, threads: int) -> None:
        self._threads = ThreadPoolExecutor(threads, thread_name_prefix="compression")
        self._waiting: deque[tuple[h5py.Dataset, int, int, Future[bytes]]] = deque()
        self._waiting_bytes = 0

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the threads; chunks that wait are dropped."""
        self._threads.shutdown(cancel_futures=True)

    def write(self, dataset: h5py.Dataset, start: int, rows: NDArray[Any]) -> None:
        """Write a chunk.

        Parameters
        ----------
        dataset
            As ``create_dataset`` makes it, and long enough to have the chunk.
        start
            First row of the chunk.
        rows
            All rows of the chunk, in the type of the dataset. They must not be changed afterwards.
        """
        parameters = filter_parameters(dataset, 0)
        chunk = self._threads.submit(encoded_chunk, rows, parameters[_LEVEL], parameters[_SHUFFLE])
        self._waiting.append((dataset, start, rows.nbytes, chunk))
        self._waiting_bytes += rows.nbytes
        while self._waiting_bytes > _WAITING_BYTES or (self._waiting and self._waiting[0][-1].done()):
            self._write_oldest()

    def finish(self) -> None:
        """Write all chunks that wait."""
        while self._waiting:
            self._write_oldest()

    def _write_oldest(self) -> None:
        dataset, start, size, chunk = self._waiting.popleft()
        self._waiting_bytes -= size
        dataset.id.write_direct_chunk((start, *(0 for _ in dataset.shape[1:])), chunk.result())


def encoded_chunk(rows: NDArray[Any], level: int, shuffle: int) -> bytes:
    """Return a chunk as HDF5 stores it: compressed by Blosc-Zstandard, with the checksum behind it.

    Parameters
    ----------
    rows
        All rows of the chunk.
    level, shuffle
        Of Blosc.
    """
    chunk: bytes = blosc.compress(rows, b"zstd", level, shuffle, _BLOCK_BYTES)
    return chunk + checksum_of(chunk)


def checksum_of(chunk: bytes) -> bytes:
    """Return the checksum that HDF5 stores behind bytes of which one at least is not 0."""
    words = np.frombuffer(chunk, "<u2", count=len(chunk) // 2).astype(np.uint16, copy=False)
    sums = fletcher32(words, chunk[-1] if len(chunk) % 2 else -1)
    # HDF5 writes 65535 for a sum of 0 modulo 65535: no sum of its own is 0 behind a byte that is not.
    weighted, simple = (sums >> 16) or 0xFFFF, (sums & 0xFFFF) or 0xFFFF
    return (weighted << 16 | simple).to_bytes(FLETCHER32_BYTES, "little")
