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
"""Tiles, and pixels in a tile, below which no gain is estimated."""

LEVELS_DN: Final = (8.0, 240.0)
"""Between which a pixel counts, by the geometric mean of both frames: neither rounded away nor clipped.

The mean of both and not one of them, so that the choice favours neither direction.
"""

_MEDIAN_EFFICIENCY: Final = float(np.sqrt(np.pi / 2))
"""Standard error of a median over that of a mean, normal values."""


@dataclass(frozen=True, slots=True)
class BrightnessGain:
    """Natural logarithm of later over earlier brightness, and its standard error from the spread over tiles."""

    log_gain: float
    standard_error: float


def brightness_gain(before_dn: NDArray[np.floating], after_dn: NDArray[np.floating]) -> BrightnessGain | None:
    """Estimate the gain between two images of the same points.

    Parameters
    ----------
    before_dn, after_dn
        (h, w), NaN where a point is not visible in both.

    Returns
    -------
    The gain; None where too few tiles are bright and not clipped.
    """
    before, after = (np.ascontiguousarray(image) for image in (before_dn, after_dn))
    pixels, before_sums, after_sums = _sums_of_tiles(before, after, TILES, LEVELS_DN[0] ** 2, LEVELS_DN[1] ** 2)
    usable = pixels >= FEWEST_PIXELS
    if np.count_nonzero(usable) < FEWEST_TILES:
        return None
    sums = before_sums[usable], after_sums[usable]
    log_gains = np.log(sums[1] / sums[0])
    median = float(np.median(log_gains))
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(log_gains - median)))
    # Where nothing moves, rounding remains: uniform over a step in either frame, of variance 1/12 a pixel.
    rounding = float(np.sqrt(np.mean(pixels[usable] * (1 / 12) * (1 / sums[0] ** 2 + 1 / sums[1] ** 2))))
    return BrightnessGain(median, _MEDIAN_EFFICIENCY * max(scatter, rounding) / float(np.sqrt(len(log_gains))))


@njit(cache=True)
def _sums_of_tiles(
    before: NDArray[np.floating], after: NDArray[np.floating], tiles: tuple[int, int], least: float, most: float
) -> tuple[NDArray[np.int64], Float64, Float64]:
    """Return how many pixels of each tile count, and the sums of both images over them: (tiles,), row by row.

    Pixels count where the product of both lies between two values.
    """
    height, width = before.shape
    count = tiles[0] * tiles[1]
    pixels, before_sums, after_sums = np.zeros(count, np.int64), np.zeros(count), np.zeros(count)
    for row in range(height):
        first = row * tiles[0] // height * tiles[1]
        for column in range(width):
            earlier, later = np.float64(before[row, column]), np.float64(after[row, column])
            square = earlier * later
            if earlier > 0 and later > 0 and least <= square <= most:
                tile = first + column * tiles[1] // width
                pixels[tile] += 1
                before_sums[tile] += earlier
                after_sums[tile] += later
    return pixels, before_sums, after_sums
