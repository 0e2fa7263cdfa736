"""The box of most violating pixels, against where events change pixels: a part of the sensor, or all of it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

FEWEST: Final = 8
"""Least number of violating pixels for a box."""

_OUTSIDE: Final = 20
"""One in so many pixels lies outside at each end of an axis: the box holds nine tenths of them by each axis."""

_REACH_PX: Final = 2
"""Distance within which another violating pixel lies where one does not lie alone. Of noise that disturbs a share p of
the pixels, 24 p have one."""


def with_neighbours(pixels: Bool) -> Bool:
    """Return the marked pixels that have another one within two pixels: what noise disturbs lies alone.

    Parameters
    ----------
    pixels
        (h, w).
    """
    height, width = pixels.shape
    padded = np.pad(pixels, _REACH_PX)
    steps = range(2 * _REACH_PX + 1)
    around = sum(
        padded[down : down + height, right : right + width].astype(np.int8) for down in steps for right in steps
    )
    return pixels & (np.asarray(around) > 1)


def share_in_box(changes: Float64, pixels: Bool) -> float:
    """Return the share of changes in the box of most marked pixels.

    Parameters
    ----------
    changes
        (r, c) sums over tiles of the image, which count by the part of the tile that lies in the box.
    pixels
        (h, w) violating pixels.

    Returns
    -------
    float
        0 to 1; 1 for fewer than ``FEWEST`` pixels, and without changes.
    """
    total = float(changes.sum())
    marked = np.nonzero(pixels)
    if len(marked[0]) < FEWEST or not total > 0:
        return 1.0
    inside: list[Float64] = []
    for indices, length_px, tiles in zip(marked, pixels.shape, changes.shape, strict=True):
        cut = len(indices) // _OUTSIDE
        kept = np.sort(indices)[cut : len(indices) - cut]
        edges_px = np.arange(tiles + 1) * length_px / tiles
        inside.append(np.diff(np.clip(edges_px, kept[0], kept[-1] + 1)) / np.diff(edges_px))
    return float(inside[0] @ changes @ inside[1]) / total
