"""Whether events and frames agree in axes, direction and sign: correlation of what both say has changed.

The change of level between frames is compared with the sum of the events in between, averaged over blocks of pixels
(which forgives small shifts), under the eight symmetries of the square and both signs.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

BLOCK_PX: Final = 4
"""Side of the blocks whose means are compared."""

SYMMETRIES: Final = tuple((swap, left, up) for swap in (False, True) for left in (False, True) for up in (False, True))
"""What could have been done to the events: axes exchanged, then columns mirrored, then rows mirrored."""


@dataclass(frozen=True, slots=True)
class Moments:
    """Sums over blocks of frame change d and event change e: (k, 6) of 1, d, e, d d, e e, d e."""

    sums: Float64

    def correlations(self) -> Float64:
        """Return the k correlation coefficients; 0 where either does not vary."""
        n, d, e, dd, ee, de = self.sums.T
        n = np.maximum(n, 1.0)
        spread = np.sqrt(np.maximum((dd - d * d / n) * (ee - e * e / n), 0.0))
        agreed = de - d * e / n
        correlations: Float64 = np.divide(agreed, spread, out=np.zeros_like(spread), where=spread > 0)
        return correlations

    def frame_variance(self) -> float:
        """Return the variance of d (of the first row)."""
        n, d, _, dd, *_ = self.sums[0]
        return max(float(dd - d * d / max(n, 1.0)), 0.0) / max(float(n), 1.0)


def moments(change: Float64, events: list[Float64], whole: NDArray[np.bool_]) -> Moments:
    """Return the moments of one frame change with each of the event changes, block means all, over whole blocks."""
    d = change[whole]
    rows = []
    for event_change in events:
        e = event_change[whole]
        rows.append([d.size, d.sum(), e.sum(), d @ d, e @ e, d @ e])
    return Moments(np.array(rows, dtype=np.float64))


def undone(square: Float64, shape: tuple[int, int]) -> list[Float64]:
    """Return block means of an event image on a square, each of ``SYMMETRIES`` undone on the sensor (h, w).

    The grid of blocks lies in the middle of the sensor, so that mirroring maps it onto itself (to half a pixel).
    """
    height, width = shape
    upright, swapped = block_means(square[:height, :width]), block_means(square[:width, :height].T)
    return [(swapped if swap else upright)[:: -1 if up else 1, :: -1 if left else 1] for swap, left, up in SYMMETRIES]


def block_means(image: Float64) -> Float64:
    """Return the means over blocks of ``BLOCK_PX`` that fit into an image (h, w), centred."""
    side = min(BLOCK_PX, *image.shape)
    rows, columns = image.shape[0] // side, image.shape[1] // side
    top, left = (image.shape[0] - rows * side) // 2, (image.shape[1] - columns * side) // 2
    blocks = image[top : top + rows * side, left : left + columns * side].reshape(rows, side, columns, side)
    means: Float64 = np.einsum("risj->rs", blocks) / side**2
    return means
