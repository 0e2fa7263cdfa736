"""Grids on which timestamps lie because of the number format that they went through."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import US_PER_S

_LEAST_SPACING_US: Final = 2.0
"""Below, single-precision seconds are about as fine as a microsecond, and every timestamp can be one."""


def single_precision_spacing_us(times_us: NDArray[np.float64]) -> float:
    """Return the coarsest spacing of single-precision seconds if all timestamps (n,) could have been such, 0 otherwise.

    A float32 has 24 bits (IEEE 754): seconds above 2^k are 2^(k-23) s apart, 3.8 us from 32 s on. Timestamps must round
    to the microsecond of such a number; by chance a timestamp does so with probability one over the spacing in us. The
    result is 0 where chance alone would let all of them do so more often than once in a million files.

    Parameters
    ----------
    times_us
        (n,) timestamps as the file holds them, us.

    Returns
    -------
    float
        us.
    """
    seconds = np.asarray(times_us, dtype=np.float64) / US_PER_S
    single = seconds.astype(np.float32)
    spacing_us = np.abs(np.spacing(single)).astype(np.float64) * US_PER_S
    coarse = spacing_us >= _LEAST_SPACING_US
    if not coarse.any():
        return 0.0
    nearest_us = np.rint(single[coarse].astype(np.float64) * US_PER_S)
    if not np.array_equal(nearest_us, np.rint(times_us[coarse])):
        return 0.0
    return float(spacing_us.max()) if surely_no_chance(spacing_us[coarse]) else 0.0


def surely_no_chance(grids_us: NDArray[np.float64]) -> bool:
    """Whether random timestamps would all lie on their grids, spacings (n,) us, less often than once in a million."""
    # Each lies on its grid with probability 1 / g (g in us, timestamps of 1 us): the product is below 1e-6.
    return float(np.log10(grids_us).sum()) > 6.0
