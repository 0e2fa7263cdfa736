"""A compiled loop for the checksum that HDF5 keeps behind a chunk."""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

_TOGETHER: Final = 256
"""Words whose weighted sum fits 32 bits."""


@njit(cache=True)
def fletcher32(words: NDArray[np.uint16], last: int) -> int:
    """Return the Fletcher-32 checksum of bytes as HDF5 computes it (H5_checksum_fletcher32).

    Parameters
    ----------
    words
        The bytes by twos, (n,), as a little-endian machine reads them; HDF5 takes the first of two for the higher one.
    last
        The last byte where their number is odd; -1 where it is not.
    """
    simple, weighted = np.uint64(0), np.uint64(0)
    for start in range(0, len(words), _TOGETHER):
        block = words[start : start + _TOGETHER]
        total, by_weight = np.uint32(0), np.uint32(0)
        for i in range(len(block)):
            word = np.uint32(np.uint16(block[i] << 8) | np.uint16(block[i] >> 8))
            total = np.uint32(total + word)
            by_weight = np.uint32(by_weight + np.uint32(word * np.uint32(len(block) - i)))
        weighted = (weighted + np.uint64(len(block)) * simple + np.uint64(by_weight)) % np.uint64(65535)
        simple = (simple + np.uint64(total)) % np.uint64(65535)
    if last >= 0:
        simple = (simple + np.uint64(last << 8)) % np.uint64(65535)
        weighted = (weighted + simple) % np.uint64(65535)
    return int(weighted) << 16 | int(simple)
