"""A compiled loop for the checksum that HDF5 keeps behind a chunk."""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

# 65535 * n (n + 1) / 2 must stay below 2^32, which holds up to n = 361; n = 256 gives 2.2e9.
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
            # HDF5 takes the first byte of a pair as the high one (H5checksum.c), a little-endian read as the low one.
            word = np.uint32(np.uint16(block[i] << 8) | np.uint16(block[i] >> 8))
            total = np.uint32(total + word)
            by_weight = np.uint32(by_weight + np.uint32(word * np.uint32(len(block) - i)))
        # Sums s and W before a block of n words w_i, i from 0: s' = s + sum w_i, W' = W + n s + sum (n - i) w_i, modulo
        # 2^16 - 1 (Fletcher, IEEE Trans. Commun. 30, 1982).
        weighted = (weighted + np.uint64(len(block)) * simple + np.uint64(by_weight)) % np.uint64(65535)
        simple = (simple + np.uint64(total)) % np.uint64(65535)
    if last >= 0:
        # An odd last byte is the high byte of a word whose low byte is 0.
        simple = (simple + np.uint64(last << 8)) % np.uint64(65535)
        weighted = (weighted + simple) % np.uint64(65535)
    return int(weighted) << 16 | int(simple)
