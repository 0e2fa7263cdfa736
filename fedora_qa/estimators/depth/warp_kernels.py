"""Compiled loops that carry pixels of one depth frame into another.

What is the same for all pixels is read before the loop: arrays that are written might be the ones that are read, so
that a compiler reads these again for each pixel. Places are taken as numbers without sign, which need no look whether
they count from the end.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth_kernels import inverse_at

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Camera = tuple[float, float, float, float, float]
"""Focal length across, skew, focal length down, column and row of the centre: px."""
Motion = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Rotation, row by row, and translation."""


@njit(cache=True, error_model="numpy")
def _scalars(K: Float64, R: Float64, t: Float64) -> tuple[Camera, Motion]:
    camera = (K[0, 0], K[0, 1], K[1, 1], K[0, 2], K[1, 2])
    return camera, (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2], t[0], t[1], t[2])


@njit(cache=True, error_model="numpy")
def _ray_length(camera: Camera, column: float, row: float) -> float:
    """Return the length of a pixel's ray, where z is 1."""
    fx, skew, fy, cx, cy = camera
    y = (row - cy) / fy
    x = (column - cx - skew * y) / fx
    return float(np.sqrt(1.0 + x * x + y * y))


@njit(cache=True, error_model="numpy")
def _landed(
    camera: Camera, motion: Motion, path_px: float, ray: float, column: float, row: float, depth_m: float,
    shape: tuple[int, int], clearance_px: Float32, block_px: int, nearest_per_m: float,
) -> tuple[bool, float, float, float, float, float]:  # fmt: skip
    """Return whether a pixel can be compared in the second frame (H, W); its column and row there, X1, Y1, Z1.

    It can where nothing nearer may have moved in front of it: by f |t| |m| times the difference of 1/Z; ``path_px`` is
    f |t|.
    """
    fx, skew, fy, cx, cy = camera
    Rxx, Rxy, Rxz, Ryx, Ryy, Ryz, Rzx, Rzy, Rzz, tx, ty, tz = motion
    y0 = (row - cy) / fy
    x0 = (column - cx - skew * y0) / fx
    length = np.sqrt(1.0 + x0 * x0 + y0 * y0)
    z0 = depth_m / length**ray if ray != 0.0 else depth_m
    X1 = z0 * (Rxx * x0 + (Rxy * y0 + Rxz)) + tx
    Y1 = z0 * (Ryx * x0 + (Ryy * y0 + Ryz)) + ty
    Z1 = z0 * (Rzx * x0 + (Rzy * y0 + Rzz)) + tz
    column1 = (fx * X1 + skew * Y1) / Z1 + cx
    row1 = fy * Y1 / Z1 + cy
    height, width = shape
    if not ((Z1 > 0.0) & (column1 >= 0.0) & (column1 < width - 1) & (row1 >= 0.0) & (row1 < height - 1)):
        return False, 0.0, 0.0, X1, Y1, Z1
    parallax_px = path_px * length * max(nearest_per_m - 1.0 / z0, 0.0)
    block = np.uint32(block_px)
    clear_px = clearance_px[np.uint64(_nearest(row1) // block), np.uint64(_nearest(column1) // block)]
    return bool(clear_px > parallax_px), column1, row1, X1, Y1, Z1


@njit(cache=True, error_model="numpy")
def _nearest(place: float) -> np.uint32:
    return np.uint32(np.int32(np.rint(place)))


@njit(cache=True, error_model="numpy")
def _read(depths: Depths, column: float, row: float) -> tuple[float, float, float]:
    """Return the bilinear inverse depth at a position within the image, and its derivatives along columns and rows."""
    left, top, one = np.uint64(np.int32(column)), np.uint64(np.int32(row)), np.uint64(1)
    right, below = column - np.int32(column), row - np.int32(row)
    first, second = inverse_at(depths, top, left), inverse_at(depths, top, left + one)
    third, fourth = inverse_at(depths, top + one, left), inverse_at(depths, top + one, left + one)
    above, under = first + right * (second - first), third + right * (fourth - third)
    by_column = (1 - below) * (second - first) + below * (fourth - third)
    return above + below * (under - above), by_column, under - above


@njit(cache=True, error_model="numpy")
def residuals_of(
    K: Float64, R: Float64, t: Float64, ray: float, columns: Float64, rows: Float64, depths_m: Float64,
    depths1_m: Depths, clearance_px: Float32, block_px: int, nearest_per_m: float,
) -> Float64:  # fmt: skip
    """Return the residuals (n,) of ``carry`` alone."""
    camera, motion = _scalars(K, R, t)
    path_px = camera[0] * np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    residuals = np.empty(len(columns))
    for i in range(len(columns)):
        seen, column1, row1, _, _, Z1 = _landed(
            camera, motion, path_px, ray, columns[i], rows[i], depths_m[i],
            depths1_m.shape, clearance_px, block_px, nearest_per_m,
        )  # fmt: skip
        residuals[i] = np.nan
        if seen:
            shortening = _ray_length(camera, column1, row1) ** ray if ray != 0.0 else 1.0
            residuals[i] = _read(depths1_m, column1, row1)[0] * shortening * Z1 - 1.0
    return residuals


@njit(cache=True, error_model="numpy")
def carry(
    K: Float64, R: Float64, t: Float64, ray: float, scale: float, path: Float64, motion_error: Float64,
    per_slope: float, columns: Float64, rows: Float64, depths_m: Float64, relative_errors: Float64, depths1_m: Depths,
    errors1_per_m: Float32, of_step: float, clearance_px: Float32, block_px: int,
    nearest_per_m: float, residuals: Float64, bounds: Float64, by_twist: Float64, number: int, by_number: Float64,
) -> int:  # fmt: skip
    """Write residuals (n,), bounds (n,) and derivatives (n, 6) of pixels; NaN, NaN and 0 where they are not seen.

    ``t`` is ``scale`` times ``path``; ``per_slope`` is the rounding of a pixel coordinate, px. Returns how many are
    seen. ``number`` says by what the derivatives (n,) are taken, too: 0 nothing, 1 the scale, 2 the ray's power.
    """
    camera, motion = _scalars(K, R, t)
    fx, skew, fy, cx, cy = camera
    tx, ty, tz = t[0], t[1], t[2]
    along_x, along_y, along_z = path[0], path[1], path[2]
    path_px = fx * np.sqrt(tx * tx + ty * ty + tz * tz)
    err_a, err_b, err_c = motion_error[0], motion_error[1], motion_error[2]
    err_x, err_y, err_z = motion_error[3], motion_error[4], motion_error[5]
    count = 0
    for i in range(len(columns)):
        seen, column1, row1, X1, Y1, Z1 = _landed(
            camera, motion, path_px, ray, columns[i], rows[i], depths_m[i],
            depths1_m.shape, clearance_px, block_px, nearest_per_m,
        )  # fmt: skip
        of_one = by_twist[i]
        by_number[i] = 0.0
        if not seen:
            residuals[i] = bounds[i] = np.nan
            of_one[:] = 0.0
            continue
        count += 1
        found, by_column, by_row = _read(depths1_m, column1, row1)
        shortening = _ray_length(camera, column1, row1) ** ray if ray != 0.0 else 1.0
        found, by_column, by_row = found * shortening, by_column * shortening, by_row * shortening
        by_x = by_column * fx
        by_y = by_column * skew + by_row * fy
        by_z = found - (by_column * (column1 - cx) + by_row * (row1 - cy))
        a, b, c = Y1 * by_z - Z1 * by_y, Z1 * by_x - X1 * by_z, X1 * by_y - Y1 * by_x
        x, y, z = scale * by_x, scale * by_y, scale * by_z
        of_one[0], of_one[1], of_one[2], of_one[3], of_one[4], of_one[5] = a, b, c, x, y, z
        if number == 1:
            by_number[i] = by_x * along_x + by_y * along_y + by_z * along_z
        elif number == 2:  # z is the shorter, the longer its ray is, and so is what is found
            nearer = by_x * (X1 - tx) + by_y * (Y1 - ty) + by_z * (Z1 - tz)
            longer, shorter = _ray_length(camera, column1, row1), _ray_length(camera, columns[i], rows[i])
            by_number[i] = found * Z1 * np.log(longer) - nearer * np.log(shorter)
        error_per_m = np.float64(errors1_per_m[np.uint64(_nearest(row1)), np.uint64(_nearest(column1))])
        bound = relative_errors[i] + error_per_m * shortening * Z1 + of_step * found * Z1
        bound += per_slope * (abs(by_column) + abs(by_row)) * Z1
        bound += abs(a) * err_a + abs(b) * err_b + abs(c) * err_c + abs(x) * err_x + abs(y) * err_y + abs(z) * err_z
        residuals[i], bounds[i] = found * Z1 - 1.0, bound
    return count
