"""Decode and encode chunks of Blosc without HDF5, and outside HDF5's lock.

HDF5 decodes a chunk into memory of its own, computes its checksum byte by byte, and copies it. Without these steps the
images of a second of 1440x1080 take a fifth less (1.16 s of processor instead of 1.46 s). HDF5 compresses one chunk at
a time; ``ChunkWriter`` does it in threads. A reader sees no difference: the codec, its level and shuffle are those of
the dataset, and the checksum follows.
"""

import sys
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final, Self

import h5py
import numpy as np
from numba import njit
from numcodecs import blosc
from numpy.typing import NDArray

from fedora_qa.layout.decodable import FLETCHER32_BYTES, filter_parameters, filters_of, uses_bitshuffle

blosc.use_threads = False  # --jobs decides how many cores are used


_BLOSC: Final = 32001
"""The number under which the filter is registered with HDF5."""

_PIPELINES: Final = ([_BLOSC], [_BLOSC, h5py.h5z.FILTER_FLETCHER32])
"""Sequences of filters that are decoded here."""

# 65535 * n (n + 1) / 2 must stay below 2^32, which holds up to n = 361; n = 256 gives 2.2e9.
_WORDS_TOGETHER: Final = 256
"""Words whose weighted sum fits 32 bits."""

_MOST_BESIDE_BYTES: Final = 20
"""Header and checksum: no chunk of Blosc is longer than its values by more."""

_LEAST_BYTES: Final = 1 << 20
"""Smaller rows gain less than the query of their storage costs."""

_HEADER: Final = np.dtype([
    ("version", "u1"), ("codec_version", "u1"), ("flags", "u1"), ("item_bytes", "u1"),
    ("decoded_bytes", "<u4"), ("block_bytes", "<u4"), ("stored_bytes", "<u4"),
])  # fmt: skip
"""Of a chunk of Blosc 1 (README_CHUNK_FORMAT of C-Blosc)."""

_WAITING_BYTES: Final = 64 << 20
_WAITING_CHUNKS: Final = 16
"""Decoded chunks that wait for a thread, or to be written. More are not accepted before the oldest is written."""

_BLOCK_BYTES: Final = 256 << 10
"""Bytes of a chunk that are compressed together. Each block begins without knowledge: larger ones become smaller, in
less time, than the 64 KiB that Blosc chooses, and fit the cache of a core. A reader takes the size from the chunk."""

# Places in the parameters of the filter (blosc_filter.c of hdf5-blosc).
_LEVEL, _SHUFFLE = 4, 5


class StoredChunks:
    """The chunks of a dataset that stays open. Their storage is queried once: that takes as long as a small read.

    Attributes
    ----------
    dataset
        The dataset.
    uses_bitshuffle
        Whether its chunks must be verified before HDF5 decodes them.
    """

    def __init__(self, dataset: h5py.Dataset) -> None:
        self.dataset = dataset
        self.uses_bitshuffle = uses_bitshuffle(dataset)
        self._shape: tuple[int, ...] | None = dataset.chunks
        self._filters: list[int] | None = None

    def decode(self, start: int, rows: NDArray[Any]) -> bool:
        """Decode the rows of one whole chunk into an array of their type; return whether that was done.

        Rows that are stored in any other way, or whose bytes are damaged, are not decoded. HDF5 reads the former, and
        its error names what is wrong with the latter.
        """
        # Exactly one chunk: a part of one needs a buffer and a copy, which is what HDF5 does anyway.
        if rows.nbytes < _LEAST_BYTES or self._shape != rows.shape or start % rows.shape[0]:
            return False
        if self._filters is None:
            # The decoder only copies bytes: HDF5 converts a stored type that is not the NumPy type of the dataset.
            needs_conversion = self.dataset.id.get_type() != h5py.h5t.py_create(self.dataset.dtype)
            self._filters = [] if needs_conversion else [number for number, _ in filters_of(self.dataset)]
        # The kernel of the checksum expects words in little-endian order; elsewhere HDF5 verifies it.
        if self._filters not in _PIPELINES or (self._filters != [_BLOSC] and sys.byteorder != "little"):
            return False
        stored = self.dataset.id
        try:
            place = (start, *(0 for _ in rows.shape[1:]))
            info = stored.get_chunk_info_by_coord(place)
            longest = rows.nbytes + _MOST_BESIDE_BYTES
            if info.filter_mask or not 0 < info.size <= longest:  # a chunk that was never written has no size
                return False
            _, bytes_ = stored.read_direct_chunk(place)
            chunk = memoryview(bytes_)
            if self._filters != [_BLOSC]:
                chunk, checksum = chunk[:-FLETCHER32_BYTES], int.from_bytes(chunk[-FLETCHER32_BYTES:], "little")
                words = np.frombuffer(chunk, np.uint16, count=len(chunk) // 2)
                computed = fletcher32(words, chunk[-1] if len(chunk) % 2 else -1)
                if _halves(computed) != _halves(checksum):
                    return False
            if len(chunk) < _HEADER.itemsize:
                return False
            # Blosc does not verify the sizes in its header; a wrong one would make it read or write beyond the buffers.
            header = np.frombuffer(chunk, _HEADER, count=1)[0]
            if int(header["decoded_bytes"]) != rows.nbytes or int(header["stored_bytes"]) != len(chunk):
                return False
            blosc.decompress(chunk, rows)
        except (OSError, RuntimeError, ValueError):
            return False
        return True


def _halves(checksum: int) -> tuple[int, int]:
    """Return the two sums of a checksum modulo 65535, of which HDF5 writes 65535 for 0."""
    return (checksum >> 16) % 65535, (checksum & 0xFFFF) % 65535


@njit(cache=True, nogil=True)
def fletcher32(words: NDArray[np.uint16], last: int) -> int:
    """Return the Fletcher-32 checksum of bytes as HDF5 computes it (H5_checksum_fletcher32).

    Parameters
    ----------
    words
        (n,) pairs of bytes, as a little-endian machine reads them.
    last
        The last byte where the number of bytes is odd; -1 where it is even.
    """
    simple, weighted = np.uint64(0), np.uint64(0)
    for start in range(0, len(words), _WORDS_TOGETHER):
        block = words[start : start + _WORDS_TOGETHER]
        total, by_weight = np.uint32(0), np.uint32(0)
        for i in range(len(block)):
            word = np.uint32(block[i])
            total = np.uint32(total + word)
            by_weight = np.uint32(by_weight + np.uint32(word * np.uint32(len(block) - i)))
        # Sums s and W before a block of n words w_i, i from 0: s' = s + sum w_i, W' = W + n s + sum (n - i) w_i, modulo
        # 2^16 - 1 (Fletcher, IEEE Trans. Commun. 30, 1982).
        weighted = (weighted + np.uint64(len(block)) * simple + np.uint64(by_weight)) % np.uint64(65535)
        simple = (simple + np.uint64(total)) % np.uint64(65535)
    if last >= 0:
        # An odd last byte is the first of a pair whose second byte is 0.
        simple = (simple + np.uint64(last)) % np.uint64(65535)
        weighted = (weighted + simple) % np.uint64(65535)
    # HDF5 takes the first byte of a pair as the high one (H5checksum.c), a little-endian read as the low one. To swap
    # the bytes of a word is to multiply it by 256 modulo 2^16 - 1 (RFC 1071, 2 B), and so its sums.
    swapped = np.uint64(256)
    return int(swapped * weighted % np.uint64(65535)) << 16 | int(swapped * simple % np.uint64(65535))


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
        chunk = self._threads.submit(_encoded_chunk, rows, parameters[_LEVEL], parameters[_SHUFFLE])
        self._waiting.append((dataset, start, rows.nbytes, chunk))
        self._waiting_bytes += rows.nbytes
        # Not as soon as it is compressed: where a chunk lies in the file must not depend on the speed of threads.
        while self._waiting_bytes > _WAITING_BYTES or len(self._waiting) > _WAITING_CHUNKS:
            self._write_oldest()

    def finish(self) -> None:
        """Write all chunks that wait."""
        while self._waiting:
            self._write_oldest()

    def _write_oldest(self) -> None:
        dataset, start, size, chunk = self._waiting.popleft()
        self._waiting_bytes -= size
        dataset.id.write_direct_chunk((start, *(0 for _ in dataset.shape[1:])), chunk.result())


def _encoded_chunk(rows: NDArray[Any], level: int, shuffle: int) -> bytes:
    """Return a chunk as HDF5 stores it: compressed by Blosc-Zstandard, with the checksum behind it."""
    chunk: bytes = blosc.compress(rows, b"zstd", level, shuffle, _BLOCK_BYTES)
    return chunk + checksum_of(chunk)


def checksum_of(chunk: bytes) -> bytes:
    """Return the checksum that HDF5 stores behind bytes of which one at least is not 0."""
    words = np.frombuffer(chunk, "<u2", count=len(chunk) // 2).astype(np.uint16, copy=False)
    sums = fletcher32(words, chunk[-1] if len(chunk) % 2 else -1)
    # HDF5 writes 65535 for a sum of 0 modulo 65535: no sum of its own is 0 behind a byte that is not.
    weighted, simple = (sums >> 16) or 0xFFFF, (sums & 0xFFFF) or 0xFFFF
    return (weighted << 16 | simple).to_bytes(FLETCHER32_BYTES, "little")
