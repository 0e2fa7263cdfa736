"""By how much one frame is brighter than another where both show the same points.

The logarithm of the ratio of sums, tile by tile, and the median over tiles: what moved, appeared or shines spoils some
tiles, exposure changes all. Sums, and not means of logarithms, since rounding averages out of them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

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

_MAD_TO_SIGMA: Final = 1.4826


@dataclass(frozen=True, slots=True)
class Gain:
    """Natural logarithm of later over earlier brightness, and its standard error from the spread over tiles."""

    log_gain: float
    standard_error: float


def brightness_gain(before_dn: NDArray[np.floating], after_dn: NDArray[np.floating]) -> Gain | None:
    """Return the gain between two images (h, w) of the same points, NaN where a point is not shown by both.

    None where too few tiles are bright and not clipped.
    """
    before, after = np.asarray(before_dn, dtype=np.float64), np.asarray(after_dn, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        squares = before * after
        usable = (before > 0) & (after > 0) & (squares >= LEVELS_DN[0] ** 2) & (squares <= LEVELS_DN[1] ** 2)
    rows, columns = (
        (np.arange(size) * tiles // size).astype(np.intp) for size, tiles in zip(usable.shape, TILES, strict=True)
    )
    tile = (rows[:, np.newaxis] * TILES[1] + columns)[usable]
    count = TILES[0] * TILES[1]
    pixels = np.bincount(tile, minlength=count)
    enough = pixels >= FEWEST_PIXELS
    if np.count_nonzero(enough) < FEWEST_TILES:
        return None
    sums = [np.bincount(tile, image[usable], minlength=count)[enough] for image in (before, after)]
    gains = np.log(sums[1] / sums[0])
    middle = float(np.median(gains))
    spread = _MAD_TO_SIGMA * float(np.median(np.abs(gains - middle)))
    # Rounding, uniform over a step in either frame, is what is left where nothing moves.
    rounding = float(np.sqrt(np.mean(pixels[enough] * (1 / 12) * (1 / sums[0] ** 2 + 1 / sums[1] ** 2))))
    return Gain(middle, _MEDIAN_EFFICIENCY * max(spread, rounding) / float(np.sqrt(len(gains))))
