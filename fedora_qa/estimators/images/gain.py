"""By how much one frame is brighter than another where both show the same points.

The logarithm of the ratio of sums, tile by tile, and the median over tiles: what moved, appeared or shines spoils some
tiles, exposure changes all. Sums, and not means of logarithms, since rounding averages out of them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA

Float64 = NDArray[np.float64]

TILES: Final = (9, 12)
"""Rows and columns of tiles."""

FEWEST_TILES: Final = 12
FEWEST_PIXELS: Final = 4
"""Tiles, and pixels in a tile, below which nothing is said."""

LEVELS_DN: Final = (8.0, 240.0)
"""Between which a pixel counts, by the geometric mean of both frames: neither rounded away nor clipped.

The mean of both and not one of them, so that the choice favours neither direction.
"""

_MEDIAN_EFFICIENCY: Final = float(np.sqrt(np.pi / 2))
"""Standard error of a median over that of a mean, normal values."""


@dataclass(frozen=True, slots=True)
class Gain:
    """Natural logarithm of later over earlier brightness, and its standard error from the spread over tiles."""

    log_gain: float
    standard_error: float


def brightness_gain(before_dn: NDArray[np.floating], after_dn: NDArray[np.floating]) -> Gain | None:
    """Return the gain between two images (h, w) of the same points, NaN where a point is not shown by both.

    None where too few tiles are bright and not clipped.
    """
    before, after = (np.ascontiguousarray(image) for image in (before_dn, after_dn))
    pixels, of_before, of_after = _sums_of_tiles(before, after, TILES, LEVELS_DN[0] ** 2, LEVELS_DN[1] ** 2)
    enough = pixels >= FEWEST_PIXELS
    if np.count_nonzero(enough) < FEWEST_TILES:
        return None
    sums = of_before[enough], of_after[enough]
    gains = np.log(sums[1] / sums[0])
    middle = float(np.median(gains))
    spread = MAD_TO_SIGMA * float(np.median(np.abs(gains - middle)))
    # Rounding, uniform over a step in either frame, is what is left where nothing moves.
    rounding = float(np.sqrt(np.mean(pixels[enough] * (1 / 12) * (1 / sums[0] ** 2 + 1 / sums[1] ** 2))))
    return Gain(middle, _MEDIAN_EFFICIENCY * max(spread, rounding) / float(np.sqrt(len(gains))))


@njit(cache=True)
def _sums_of_tiles(
    before: NDArray[np.floating], after: NDArray[np.floating], tiles: tuple[int, int], least: float, most: float
) -> tuple[NDArray[np.int64], Float64, Float64]:
    """Return how many pixels of each tile count, and the sums of both images over them: (tiles,), row by row.

    They do where the product of both lies between two values.
    """
    height, width = before.shape
    count = tiles[0] * tiles[1]
    pixels, of_before, of_after = np.zeros(count, np.int64), np.zeros(count), np.zeros(count)
    for row in range(height):
        first = row * tiles[0] // height * tiles[1]
        for column in range(width):
            one, other = np.float64(before[row, column]), np.float64(after[row, column])
            square = one * other
            if one > 0 and other > 0 and least <= square <= most:
                tile = first + column * tiles[1] // width
                pixels[tile] += 1
                of_before[tile] += one
                of_after[tile] += other
    return pixels, of_before, of_after
