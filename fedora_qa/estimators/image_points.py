"""Means of a colour frame over the footprints of a few pixels of the event camera: those that are asked for, no others.

The weights are those of ``event_footprint``, separable in rows and columns, of which some four by four are not zero.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.event_footprint import Footprints

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]


def sharp_colours(prints: Footprints, rgb: NDArray[np.uint8], linear_dn: Float64, pixels: NDArray[Any]) -> Float64:
    """Return linear R, G, B (m, 3) over the footprints of pixels (m,), by the sharp reconstruction, in DN.

    Parameters
    ----------
    rgb
        (H, W, 3) codes of a frame.
    linear_dn
        (256,) what each code stands for.
    pixels
        row * width + column in the event camera.
    """
    rows, columns = prints.rows.sharp, prints.columns.sharp
    at = np.asarray(pixels, dtype=np.int64)
    means = np.empty((len(at), 3))
    _average(rgb, linear_dn, at // columns.shape[0], at % columns.shape[0],
             rows.indptr, rows.indices, rows.data, columns.indptr, columns.indices, columns.data, means)  # fmt: skip
    return np.maximum(means, 0.0)


@njit(cache=True)
def _average(
    rgb: NDArray[np.uint8], linear_dn: Float64, at_rows: NDArray[np.int64], at_columns: NDArray[np.int64],
    row_starts: Int32, row_places: Int32, row_weights: Float64,
    column_starts: Int32, column_places: Int32, column_weights: Float64, means: Float64,
) -> None:  # fmt: skip
    for i in range(len(at_rows)):
        row, column = at_rows[i], at_columns[i]
        red = green = blue = 0.0
        for a in range(row_starts[row], row_starts[row + 1]):
            line = rgb[row_places[a]]
            for b in range(column_starts[column], column_starts[column + 1]):
                weight = row_weights[a] * column_weights[b]
                pixel = line[column_places[b]]
                red += weight * linear_dn[pixel[0]]
                green += weight * linear_dn[pixel[1]]
                blue += weight * linear_dn[pixel[2]]
        means[i, 0], means[i, 1], means[i, 2] = red, green, blue
