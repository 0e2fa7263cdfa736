"""Which frames are so large that a part of their pixels is enough to measure a fault of a whole field.

What errs in a whole field errs in all of its pixels. Of larger frames than usual, checks that ask for such faults use
a part, spread over all of the image, unless all of it is to be used.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.window import USUAL_PIXELS, Window

Bools = NDArray[np.bool_]

_GOLDEN: Final = (5**0.5 - 1) / 2
"""Multiples of it, less whole ones, lie evenly however many there are and whichever are left out (H. Weyl, 1916)."""

_BANDS: Final = 2
"""Bands of rows that are used in either half of an image."""


def is_large(pixels: int, window: Window) -> bool:
    """Whether a part of a frame of so many pixels is enough in a window."""
    return pixels > USUAL_PIXELS and window.sampling.tile_share < 1


def turn_of(number: int) -> float:
    """Return a number from 0 to 1 for the field or frame of a number; those of successive ones lie evenly."""
    return number * _GOLDEN % 1.0


def bands(height: int, share: float, number: int) -> Bools:
    """Return which rows of a field are used.

    They are the same upside down. From field to field bands move, so that all rows are used in turn.

    Parameters
    ----------
    height
        Rows of the field.
    share
        How many of them are used, 0 to 1.
    number
        Of the field.

    Returns
    -------
    (height,).
    """
    # Distance from the middle row over half the height, 0 to 1: equal for a row and its mirror image.
    from_middle = np.abs(2 * np.arange(height) - (height - 1)) / height
    return np.asarray((_BANDS * from_middle + turn_of(number)) % 1.0 < share)


def near(rows: Bools, reach: int) -> Bools:
    """Return the rows (height,) that lie no farther than ``reach`` from any that is used.

    Parameters
    ----------
    rows
        (height,) True for the rows that are used.
    reach
        Rows.
    """
    counts = np.cumsum(np.pad(rows, (reach + 1, reach)))
    return np.asarray(counts[2 * reach + 1 :] > counts[: -2 * reach - 1])
