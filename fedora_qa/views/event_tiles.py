"""Parts of the event camera's image in which checks look for what is local."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

GRID: Final = 4
"""Tiles along each side."""


def tile_around(chosen: NDArray[np.bool_], shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom in pixels of the least rectangle around tiles (GRID^2,), rows first."""
    rows, columns = np.nonzero(chosen.reshape(GRID, GRID))
    height, width = shape
    left, right = (-(-int(edge) * width // GRID) for edge in (columns.min(), columns.max() + 1))
    top, bottom = (-(-int(edge) * height // GRID) for edge in (rows.min(), rows.max() + 1))
    return left, top, right, bottom
