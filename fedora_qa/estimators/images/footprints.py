"""Means of a colour frame over the footprints of a few pixels of the event camera: those that are asked for, no others.

The weights are those of ``footprint``, separable in rows and columns, of which some four by four are not zero.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.footprint import Footprints

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


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
    rows, columns = prints.rows.edge_aware, prints.columns.edge_aware
    at_rows, at_columns = np.divmod(np.asarray(pixels, dtype=np.int64), len(columns.first))
    means = np.empty((len(pixels), 3))
    _average(rgb, linear_dn, at_rows, at_columns, rows.first, rows.weights, columns.first, columns.weights, means)
    return np.maximum(means, 0.0)


@njit(cache=True)
def _average(
    rgb: NDArray[np.uint8],
    linear_dn: Float64,
    at_rows: Int64,
    at_columns: Int64,
    first_rows: Int64,
    row_weights: Float64,
    first_columns: Int64,
    column_weights: Float64,
    means: Float64,
) -> None:
    for i in range(len(at_rows)):
        row, column = at_rows[i], at_columns[i]
        red = green = blue = 0.0
        for a in range(row_weights.shape[1]):
            line = rgb[first_rows[row] + a]
            for b in range(column_weights.shape[1]):
                weight = row_weights[row, a] * column_weights[column, b]
                pixel = line[first_columns[column] + b]
                red += weight * linear_dn[pixel[0]]
                green += weight * linear_dn[pixel[1]]
                blue += weight * linear_dn[pixel[2]]
        means[i, 0], means[i, 1], means[i, 2] = red, green, blue
