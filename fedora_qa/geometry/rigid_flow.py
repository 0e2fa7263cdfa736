"""Optical flow of a rigid scene from depth and the camera's motion, its derivative, and its rounding.

The definition is that of format.md: the flow is given on the pixels of the depth image at the start of the interval.
With ``X1 = R X0 + t`` it is finite wherever X1 lies in front of the camera, and with a distorted lens wherever that
images both ends. Functions take the lens of the camera; None is a pinhole.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import (
    CompiledLens,
    compiled,
    distort_slopes,
    distortion_slopes,
    pixels_of_rays,
    rays_of_pixels,
)
from fedora_qa.sequence.declared import Lens
from fedora_qa.sequence.stored_step import SINGLE_ROUNDOFF, StoredStep

Float64 = NDArray[np.float64]

SINGLE_PRECISION: Final = 2.0**-24
"""Unit roundoff of float32."""

_ROUNDINGS: Final = 4
"""Number of roundings of one coordinate between the ray and the pixel: ray, rotation, translation, projection."""


_FLOAT32: Final = StoredStep(0.0, SINGLE_ROUNDOFF)


def moved_points(
    K: Float64, motion: RigidMotion, columns: Float64, rows: Float64, depths_m: Float64, lens: Lens | None = None
) -> tuple[Float64, Float64, Float64]:
    """Return the points of pixels in the second camera frame.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Of points, from the first to the second camera frame.
    columns, rows, depths_m
        Pixels, px, and their z-depths in the first frame, m; these arrays broadcast against each other.
    lens
        Of the camera.

    Returns
    -------
    X1, Y1, Z1
        Coordinates in the second camera frame (X right, Y down, Z forward), m; NaN where depth is NaN, or where the
        lens images no ray.
    """
    # X1 = Z0 R ray + t.
    x, y = rays_of_pixels(K, lens, columns, rows)
    R, t = motion.R, motion.t_m
    return (
        depths_m * (R[0, 0] * x + (R[0, 1] * y + R[0, 2])) + t[0],
        depths_m * (R[1, 0] * x + (R[1, 1] * y + R[1, 2])) + t[1],
        depths_m * (R[2, 0] * x + (R[2, 1] * y + R[2, 2])) + t[2],
    )


def rigid_flow(
    K: Float64, motion: RigidMotion, columns: Float64, rows: Float64, depths_m: Float64, lens: Lens | None = None
) -> Float64:
    """Return the flow (..., 2) of static points, px, u right and v down.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Of points, from the first to the second camera frame.
    columns, rows, depths_m
        Pixels, px, and their z-depths in the first frame, m; these arrays broadcast against each other.
    lens
        Of the camera.

    Returns
    -------
    ndarray of float64
        (..., 2) px. NaN where depth is NaN, the point lies behind the camera, or the lens does not image an end. Not
        finite where the point lies so close to the plane Z = 0 of the camera that float64 overflows.
    """
    X1, Y1, Z1 = moved_points(K, motion, columns, rows, depths_m, lens)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # u = (fx X1 + s Y1) / Z1 + cx - column, v = fy Y1 / Z1 + cy - row, and through the lens where there is any.
        inverse = np.where(Z1 > 0, 1.0 / Z1, np.nan)
        columns1, rows1 = pixels_of_rays(K, lens, X1 * inverse, Y1 * inverse)
        u = columns1 - columns
        v = rows1 - rows
    return np.stack((u, v), axis=-1)


def depths_by_flow(
    K: Float64, motion: RigidMotion, columns: Float64, rows: Float64, flow_px: Float64, lens: Lens | None = None
) -> Float64:
    """Return the z-depths (n,) in m whose rigid flow comes nearest to ``flow_px`` (n, 2).

    The second position of a pixel lies on its epipolar line, ``x1 (Z r_z + t_z) = Z r_xy + t_xy`` with the rotated ray
    r. This is solved for 1/Z by least squares (Hartley and Zisserman, Multiple View Geometry, 12.2).

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Of points, from the first to the second camera frame.
    columns, rows
        (n,) pixels of the first frame, px.
    flow_px
        (n, 2) u right, v down.
    lens
        Of the camera.

    Returns
    -------
    ndarray of float64
        (n,) m. Not positive where no point in front of the camera has this flow; NaN where the flow does not depend
        on the depth, as without translation.
    """
    ones = np.ones_like(columns)
    rays = np.stack(moved_points(K, RigidMotion(motion.R, np.zeros(3)), columns, rows, ones, lens), axis=-1)
    x1, y1, _ = moved_points(
        K, RigidMotion(np.eye(3), np.zeros(3)), columns + flow_px[:, 0], rows + flow_px[:, 1], ones, lens
    )
    end = np.stack((x1, y1), axis=-1)
    # (t_xy - x1 t_z) / Z = x1 r_z - r_xy: two equations in 1/Z.
    slopes = motion.t_m[:2] - end * motion.t_m[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        depths_m: Float64 = np.sum(slopes**2, axis=-1) / np.sum(slopes * (end * rays[:, 2:] - rays[:, :2]), axis=-1)
    return depths_m


def twist_jacobian(K: Float64, points1_m: Float64, lens: Lens | None = None) -> Float64:
    """Return the derivative of the flow by a twist that follows the motion.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    points1_m
        (n, 3) points X1 in the second camera frame, m, in front of the camera.
    lens
        Of the camera.

    Returns
    -------
    ndarray of float64
        (n, 2, 6) of (u, v): px per rad of the rotation vector, then px per metre of the translation.
    """
    jacobian = np.empty((len(points1_m), 2, 6))
    _twist_slopes_of_points(np.ascontiguousarray(K), compiled(lens), np.ascontiguousarray(points1_m), jacobian)
    return jacobian


@njit(cache=True, error_model="numpy")
def twist_slopes(K: Float64, lens: CompiledLens, X1: float, Y1: float, Z1: float, slopes: Float64) -> None:
    """Write the derivative (2, 6) of the flow of one pixel by a twist; see ``twist_jacobian``.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    lens
        Of the camera.
    X1, Y1, Z1
        Coordinates of the point in the second camera frame, m, in front of the camera.
    slopes
        (2, 6) of (u, v): px per rad of the rotation vector, then px per metre of the translation.
    """
    x1, y1 = X1 / Z1, Y1 / Z1
    # The slopes on the image plane by those of the ray; a pinhole's are equal.
    xx, xy, yx, yy = distort_slopes(lens, x1, y1)
    for axis in range(2):
        # d (u, v) / d X1, with u = fx x_d + s y_d + cx, v = fy y_d + cy, and the slopes X / Z and Y / Z.
        by_x_d, by_y_d = K[axis, 0], K[axis, 1]
        by_X = (by_x_d * xx + by_y_d * yx) / Z1
        by_Y = (by_x_d * xy + by_y_d * yy) / Z1
        by_Z = -(by_X * x1 + by_Y * y1)
        # A twist moves X1 by omega x X1 + tau: b . (omega x X1) = omega . (X1 x b).
        slopes[axis, 0], slopes[axis, 1] = Y1 * by_Z - Z1 * by_Y, Z1 * by_X - X1 * by_Z
        slopes[axis, 2] = X1 * by_Y - Y1 * by_X
        slopes[axis, 3], slopes[axis, 4], slopes[axis, 5] = by_X, by_Y, by_Z


@njit(cache=True, error_model="numpy")
def _twist_slopes_of_points(K: Float64, lens: CompiledLens, points1_m: Float64, jacobian: Float64) -> None:
    for i in range(len(points1_m)):
        twist_slopes(K, lens, points1_m[i, 0], points1_m[i, 1], points1_m[i, 2], jacobian[i])


def rounding_px(
    K: Float64,
    motion: RigidMotion,
    columns: Float64,
    rows: Float64,
    depths_m: Float64,
    flow_px: Float64,
    flow_step_px: StoredStep = _FLOAT32,
    depth_step_m: StoredStep = _FLOAT32,
    lens: Lens | None = None,
) -> Float64:
    """Return a bound on the difference between a correct stored flow and the recomputed one, px.

    The bound is the sum of three, u being the unit roundoff of float32:

    - the stored flow is rounded: ``u |flow|``, or half of a coarser step;
    - the stored depth is rounded twice (to float32 millimetres, and to metres when it is read), which moves the pixel
      by ``2 u Z0 |d flow / d Z0| = 2 u f |t - m t_z| / Z1`` with the slopes m of the point, X1/Z1 and Y1/Z1; half of a
      coarser step s of depth moves it by ``s / (2 Z0)`` in place of u;
    - the flow may have been computed in single precision. A coordinate of X1 then errs by some roundings of ``|X0| +
      |t|``, and the pixel by ``f (1 + |m|) / Z1`` times that, and by some roundings of the pixel itself and of the
      principal point.

    A lens magnifies both of the latter: rays are inverted at the first end, and projected at the second.

    Parameters
    ----------
    K, motion, columns, rows, depths_m
        As of ``rigid_flow``.
    flow_px
        (..., 2) as stored.
    flow_step_px, depth_step_m
        Steps in which flow, each component by its own, and depth are stored, px and m; float32 at least.
    lens
        Of the camera.

    Returns
    -------
    ndarray of float64
        (..., 2) px, for u and v.
    """
    X1, Y1, Z1 = moved_points(K, motion, columns, rows, depths_m, lens)
    distance0_m = depths_m * np.hypot(np.hypot((columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1]), 1.0)
    magnification: Float64 | float = 1.0
    if lens is not None:
        x0, y0 = rays_of_pixels(K, lens, columns, rows)
        distance0_m = depths_m * np.sqrt(1.0 + x0**2 + y0**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            at_start, at_end = distortion_slopes(lens, x0, y0), distortion_slopes(lens, X1 / Z1, Y1 / Z1)
        # Largest absolute row sums: a bound on what an error of a slope becomes, and the same of the inverse.
        enlarged = np.abs(at_end).sum(axis=-1).max(axis=-1)
        magnification = enlarged * np.maximum(np.abs(np.linalg.inv(at_start)).sum(axis=-1).max(axis=-1), 1.0)
    reach_m = distance0_m + float(np.linalg.norm(motion.t_m))
    # Error of the depth as a share of it: both roundings to float32, or that of storage and one of reading.
    depth_share = SINGLE_PRECISION + np.maximum(SINGLE_PRECISION, depth_step_m.error_bounds(depths_m) / depths_m)
    rounded, by_depth, by_arithmetic = [], [], []
    for axis, coordinate1, pixel in ((0, X1, columns), (1, Y1, rows)):
        # A point in the plane of the camera has no flow: its bound is infinite or NaN.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            slope = coordinate1 / Z1
            f_over_Z1 = K[axis, axis] / Z1
            # Second and third source of the docstring.
            by_depth.append(depth_share * (f_over_Z1 * np.abs(motion.t_m[axis] - slope * motion.t_m[2])))
            by_coordinates = f_over_Z1 * (1 + np.abs(slope)) * reach_m + pixel + K[axis, 2]
        by_arithmetic.append(SINGLE_PRECISION * (_ROUNDINGS * by_coordinates))
        step_px = flow_step_px.component(axis)
        rounded.append(
            np.maximum(SINGLE_PRECISION * np.abs(flow_px[..., axis]), step_px.error_bounds(flow_px[..., axis]))
        )
    if lens is not None:
        # A lens mixes both axes: the larger error of either counts.
        by_depth = [magnification * np.maximum(*by_depth)] * 2
        by_arithmetic = [magnification * np.maximum(*by_arithmetic)] * 2
    return np.stack([rounded[axis] + by_depth[axis] + by_arithmetic[axis] for axis in (0, 1)], axis=-1)
