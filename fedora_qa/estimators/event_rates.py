"""Pixels that fire more than their neighbourhood."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import rank_filter

Float64 = NDArray[np.float64]

_RING: Final = np.ones((5, 5), np.bool_)
_RING[2, 2] = False
_NEIGHBOURS: Final = 24


@dataclass(frozen=True, slots=True)
class Loudness:
    """Counts of pixels beside those of their neighbours, (h, w) each.

    Attributes
    ----------
    excess
        Count above the third largest of the 24 neighbours (so that two bad pixels side by side do not hide each other).
    error
        Its standard deviation: Poisson, and the spread of the neighbours.
    median
        Of the neighbours.
    """

    excess: Float64
    error: Float64
    median: Float64


def loudness(counts: NDArray[np.int64]) -> Loudness:
    """Compare every pixel's count (h, w) with its 24 neighbours.

    What moves over a sensor moves over the neighbours as well; edges and textures make neighbours differ, and the
    distance of their third largest from their median (1.1 standard deviations of a normal distribution) measures by
    how much.
    """
    high = rank_filter(counts, rank=_NEIGHBOURS - 3, footprint=_RING, mode="mirror").astype(np.float64)
    median = rank_filter(counts, rank=_NEIGHBOURS // 2, footprint=_RING, mode="mirror").astype(np.float64)
    return Loudness(counts - high, np.sqrt(high + (high - median) ** 2 + 1.0), median)
