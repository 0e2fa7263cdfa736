"""Compiled loops that carry pixels of one depth frame into another."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth_image_kernels import inverse_at

Depths = NDArray[np.floating[Any]]
Float64 = NDArray[np.float64]


@njit(cache=True)
def _ray_length(K: Float64, column: float, row: float) -> float:
    """Return the length of a pixel's ray, where z is 1."""
    y = (row - K[1, 2]) / K[1, 1]
    x = (column - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return float(np.sqrt(1.0 + x * x + y * y))


@njit(cache=True)
def _landed(
    K: Float64, R: Float64, t: Float64, ray: float, column: float, row: float, depth_m: float,
    shape: tuple[int, int], clearance_px: NDArray[np.float32], block_px: int, nearest_per_m: float,
) -> tuple[bool, float, float, float, float, float]:  # fmt: skip
    """Return whether a pixel can be compared in the second frame (H, W); its column and row there, X1, Y1, Z1.

    It can where nothing nearer may have moved in front of it: by f |t| |m| times the difference of 1/Z.
    """
    y0 = (row - K[1, 2]) / K[1, 1]
    x0 = (column - K[0, 2] - K[0, 1] * y0) / K[0, 0]
    length = np.sqrt(1.0 + x0 * x0 + y0 * y0)
    z0 = depth_m / length**ray if ray != 0.0 else depth_m
    X1 = z0 * (R[0, 0] * x0 + (R[0, 1] * y0 + R[0, 2])) + t[0]
    Y1 = z0 * (R[1, 0] * x0 + (R[1, 1] * y0 + R[1, 2])) + t[1]
    Z1 = z0 * (R[2, 0] * x0 + (R[2, 1] * y0 + R[2, 2])) + t[2]
    if not Z1 > 0.0:
        return False, 0.0, 0.0, X1, Y1, Z1
    column1 = (K[0, 0] * X1 + K[0, 1] * Y1) / Z1 + K[0, 2]
    row1 = K[1, 1] * Y1 / Z1 + K[1, 2]
    height, width = shape
    if not (0.0 <= column1 < width - 1 and 0.0 <= row1 < height - 1):
        return False, 0.0, 0.0, X1, Y1, Z1
    parallax_px = K[0, 0] * np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) * length
    parallax_px *= max(nearest_per_m - 1.0 / z0, 0.0)
    clear_px = clearance_px[int(np.rint(row1)) // block_px, int(np.rint(column1)) // block_px]
    return bool(clear_px > parallax_px), column1, row1, X1, Y1, Z1


@njit(cache=True)
def _read(depths: Depths, column: float, row: float) -> tuple[float, float, float]:
    """Return the bilinear inverse depth at a position within the image, and its derivatives along columns and rows."""
    left, top = int(column), int(row)
    right, below = column - left, row - top
    first, second = inverse_at(depths, top, left), inverse_at(depths, top, left + 1)
    third, fourth = inverse_at(depths, top + 1, left), inverse_at(depths, top + 1, left + 1)
    above, under = first + right * (second - first), third + right * (fourth - third)
    by_column = (1 - below) * (second - first) + below * (fourth - third)
    return above + below * (under - above), by_column, under - above


@njit(cache=True)
def residuals_of(
    K: Float64, R: Float64, t: Float64, ray: float, columns: Float64, rows: Float64, depths_m: Float64,
    depths1_m: Depths, clearance_px: NDArray[np.float32], block_px: int, nearest_per_m: float,
) -> Float64:  # fmt: skip
    """Return the residuals (n,) of ``carry`` alone."""
    residuals = np.empty(len(columns))
    for i in range(len(columns)):
        seen, column1, row1, _, _, Z1 = _landed(
            K,
            R,
            t,
            ray,
            columns[i],
            rows[i],
            depths_m[i],
            depths1_m.shape,
            clearance_px,
            block_px,
            nearest_per_m,
        )
        residuals[i] = np.nan
        if seen:
            shortening = _ray_length(K, column1, row1) ** ray if ray != 0.0 else 1.0
            residuals[i] = _read(depths1_m, column1, row1)[0] * shortening * Z1 - 1.0
    return residuals


@njit(cache=True)
def carry(
    K: Float64, R: Float64, t: Float64, ray: float, scale: float, path: Float64, motion_error: Float64,
    per_slope: float, columns: Float64, rows: Float64, depths_m: Float64, relative_errors: Float64, depths1_m: Depths,
    errors1_per_m: NDArray[np.float32], of_step: float, clearance_px: NDArray[np.float32], block_px: int,
    nearest_per_m: float, residuals: Float64, bounds: Float64, by_twist: Float64, number: int, by_number: Float64,
) -> int:  # fmt: skip
    """Write residuals (n,), bounds (n,) and derivatives (n, 6) of pixels; NaN, NaN and 0 where they are not seen.

    ``t`` is ``scale`` times ``path``; ``per_slope`` is the rounding of a pixel coordinate, px. Returns how many are
    seen. ``number`` says by what the derivatives (n,) are taken, too: 0 nothing, 1 the scale, 2 the ray's power.
    """
    count = 0
    for i in range(len(columns)):
        seen, column1, row1, X1, Y1, Z1 = _landed(
            K,
            R,
            t,
            ray,
            columns[i],
            rows[i],
            depths_m[i],
            depths1_m.shape,
            clearance_px,
            block_px,
            nearest_per_m,
        )
        residuals[i] = bounds[i] = np.nan
        by_twist[i] = by_number[i] = 0.0
        if not seen:
            continue
        count += 1
        found, by_column, by_row = _read(depths1_m, column1, row1)
        shortening = _ray_length(K, column1, row1) ** ray if ray != 0.0 else 1.0
        found, by_column, by_row = found * shortening, by_column * shortening, by_row * shortening
        by_x = by_column * K[0, 0]
        by_y = by_column * K[0, 1] + by_row * K[1, 1]
        by_z = found - (by_column * (column1 - K[0, 2]) + by_row * (row1 - K[1, 2]))
        of_one = by_twist[i]
        of_one[0], of_one[1], of_one[2] = Y1 * by_z - Z1 * by_y, Z1 * by_x - X1 * by_z, X1 * by_y - Y1 * by_x
        of_one[3], of_one[4], of_one[5] = scale * by_x, scale * by_y, scale * by_z
        if number == 1:
            by_number[i] = by_x * path[0] + by_y * path[1] + by_z * path[2]
        elif number == 2:  # z is the shorter, the longer its ray is, and so is what is found
            nearer = by_x * (X1 - t[0]) + by_y * (Y1 - t[1]) + by_z * (Z1 - t[2])
            by_number[i] = found * Z1 * np.log(_ray_length(K, column1, row1))
            by_number[i] -= nearer * np.log(_ray_length(K, columns[i], rows[i]))
        error_per_m = np.float64(errors1_per_m[int(np.rint(row1)), int(np.rint(column1))])
        bound = relative_errors[i] + error_per_m * shortening * Z1 + of_step * found * Z1
        bound += per_slope * (abs(by_column) + abs(by_row)) * Z1
        for axis in range(6):
            bound += abs(of_one[axis]) * motion_error[axis]
        residuals[i], bounds[i] = found * Z1 - 1.0, bound
    return count
