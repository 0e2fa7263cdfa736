"""Depth of one frame, carried by the camera's motion into another, against the depth of that frame.

What is the same for all pixels is read before a compiled loop: arrays that are written might be the ones that are read,
so that a compiler reads these again for each pixel. Indices are taken as numbers without sign, which need no look
whether they count from the end.
"""

from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import SINGLE_PRECISION, DepthImage, inverse_at
from fedora_qa.geometry.camera import RigidMotion

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
_Camera = tuple[float, float, float, float, float]
"""Focal length across, skew, focal length down, column and row of the centre: px."""
_Motion = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Rotation, row by row, and translation."""

FEWEST_IN_LATTICE: Final = 4000
"""Pixels of a lattice that small images have nevertheless: each of 48 tiles then holds some eighty."""

FARTHEST_RAY: Final = 10.0
"""Power of the ray's length beyond which nothing is a depth: 0 and 1 occur. Powers of hundreds leave double precision.
"""

ModelNumber = Literal["scale", "ray"]
"""A number of a model by which residuals can be differentiated."""

_NUMBERS: Final = {None: 0, "scale": 1, "ray": 2}

_PIXEL_ROUNDINGS: Final = 4
"""Roundings that meet a pixel coordinate of the image's size in the maker's single-precision arithmetic."""


@dataclass(frozen=True, slots=True)
class DepthLattice:
    """Pixels of the first frame.

    Attributes
    ----------
    columns, rows
        (n,) px.
    depths_m
        (n,) z-depth.
    relative_errors
        (n,) share of the depth by which it may err.
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64

    def with_relative_error(self, relative_error: float) -> "DepthLattice":
        """Return the same pixels, whose depths may err by a further share of themselves."""
        return replace(self, relative_errors=self.relative_errors + relative_error)

    def thinned(self, most: int) -> "DepthLattice":
        """Return at most so many of the pixels, evenly spread over their order."""
        if len(self.columns) <= most:
            return self
        chosen = np.linspace(0, len(self.columns) - 1, most).astype(np.intp)
        return DepthLattice(
            *(values[chosen] for values in (self.columns, self.rows, self.depths_m, self.relative_errors))
        )


@dataclass(frozen=True, slots=True)
class DepthModel:
    """Camera, motion and kind of depth that two depth frames have.

    Attributes
    ----------
    K, motion
        Intrinsics of both frames, and how points move from the first to the second.
    ray
        0 where depths are z, 1 where they are lengths of the ray: depths are ``z |m|^ray`` with m = (x/z, y/z, 1).
    scale
        How many times too large depths are: so much longer the camera's path is in their unit.
    motion_error
        (6,) twist by which the motion may err; 0 where it is a sample's.
    """

    K: Float64
    motion: RigidMotion
    ray: float = 0.0
    scale: float = 1.0
    motion_error: Float64 | float = 0.0

    @property
    def conceivable(self) -> bool:
        """Whether depths could be so at all: a fit that diverges ends elsewhere."""
        return bool(abs(self.ray) <= FARTHEST_RAY and np.isfinite(self.scale))

    @property
    def motion_of_points(self) -> RigidMotion:
        """The motion in the unit of the depths."""
        return RigidMotion(self.motion.R, self.scale * self.motion.t_m)


@dataclass(frozen=True, slots=True)
class WarpedLattice:
    """The lattice in the second frame; NaN where the two frames cannot be compared.

    Attributes
    ----------
    residuals
        (n,) relative error of the second frame's inverse depth: ``Z1 / Z_read - 1``.
    bounds
        (n,) largest residual of a correct file.
    twist_derivatives
        (n, 6) derivative of the residual by a twist (rad, m) that follows the motion; 0 where it is not compared.
    number_derivatives
        (n,) derivative of the residual by a number of the model; 0 where it is not compared, or none was asked for.
    compared
        How many pixels are compared.
    """

    residuals: Float64
    bounds: Float64
    twist_derivatives: Float64
    number_derivatives: Float64
    compared: int


def lattice_stride(height: int, width: int, share: float) -> int:
    """Return the step between pixels of a lattice: 1/share both ways, or less to keep some thousands of pixels."""
    of_small_image = int(np.sqrt(height * width / FEWEST_IN_LATTICE))
    return max(1, min(round(1 / share), of_small_image))


def lattice_of(image: DepthImage, stride: int, most: int | None = None) -> DepthLattice:
    """Choose the pixels of a regular lattice that lie clear of edges.

    Parameters
    ----------
    image
        The first frame.
    stride
        Distance of the lattice's columns and rows, px.
    most
        Number of pixels that the lattice is thinned to; None: all.
    """
    lattice = DepthLattice(*lattice_values(image, stride)).with_relative_error(image.quantisation_error)
    return lattice if most is None else lattice.thinned(most)


def lattice_values(image: DepthImage, stride: int) -> Float64:
    """Return columns, rows, depths and relative errors (4, n) of a lattice, but for steps of quantised depths."""
    row, column = np.nonzero(image.near_edge[::stride, ::stride] == 0)
    row, column = row * stride, column * stride
    depths_m = image.depths_m[row, column].astype(np.float64)
    return np.stack((column, row, depths_m, image.error_per_m[row, column] * depths_m))


def warp(
    model: DepthModel, lattice: DepthLattice, image1: DepthImage, number: ModelNumber | None = None
) -> WarpedLattice:
    """Carry the lattice into the second frame and compare its inverse depths with those read there.

    Parameters
    ----------
    model
        Camera and motion of both frames.
    lattice
        Pixels of the first frame.
    image1
        The second frame.
    number
        A number of the model by which residuals are differentiated, besides by the motion.

    Returns
    -------
    WarpedLattice
        Pixels count where they land clear of edges of the second frame by more than anything nearer may have moved
        against them: hidden surfaces are not compared. The mask does not depend on the residual.
    """
    n = len(lattice.columns)
    height, width = image1.depths_m.shape
    warped = _Residuals(np.empty(n), np.empty(n), np.empty((n, 6)), np.empty(n))
    compared = _warp_pixels(
        _geometry(model),
        _ModelErrors(
            np.broadcast_to(model.motion_error, 6).copy(), SINGLE_PRECISION * _PIXEL_ROUNDINGS * (width + height)
        ),
        _Pixels(lattice.columns, lattice.rows, lattice.depths_m, lattice.relative_errors),
        _second_frame(image1),
        _NUMBERS[number],
        warped,
    )
    return WarpedLattice(*warped, compared)


def residuals_after(model: DepthModel, lattice: DepthLattice, image1: DepthImage) -> Float64:
    """Return the residuals (n,) of ``warp`` alone."""
    pixels = _Pixels(lattice.columns, lattice.rows, lattice.depths_m, lattice.relative_errors)
    return _residuals(_geometry(model), pixels, _second_frame(image1))


def ray_lengths(K: Float64, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the length of each pixel's ray (H, W), where z is 1."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    y = (rows - K[1, 2]) / K[1, 1]
    x = (columns - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return np.asarray(np.sqrt(1.0 + x**2 + y**2)).astype(np.float32)


class _Geometry(NamedTuple):
    """A ``DepthModel``: t is in the unit of the depths, ``scale`` times ``path``, which is in metres."""

    K: Float64
    R: Float64
    t: Float64
    path: Float64
    scale: float
    ray: float


class _ModelErrors(NamedTuple):
    """Twist (6,) by which the motion may err, and the rounding of a pixel coordinate, px."""

    twist: Float64
    pixel_px: float


class _Pixels(NamedTuple):
    """A ``DepthLattice``."""

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64


class _SecondFrame(NamedTuple):
    """A ``DepthImage`` without its marks of edges."""

    depths_m: Depths
    error_per_m: Float32
    quantisation_error: float
    clearance_px: Float32
    block_px: int
    nearest_per_m: float


class _Residuals(NamedTuple):
    """What a compiled loop writes of a ``WarpedLattice``."""

    residuals: Float64
    bounds: Float64
    twist_derivatives: Float64
    number_derivatives: Float64


def _geometry(model: DepthModel) -> _Geometry:
    motion = model.motion_of_points
    return _Geometry(model.K, motion.R, motion.t_m, model.motion.t_m, float(model.scale), float(model.ray))


def _second_frame(image: DepthImage) -> _SecondFrame:
    return _SecondFrame(
        image.depths_m, image.error_per_m, float(image.quantisation_error), image.clearance_px, image.block_px,
        float(image.nearest_per_m),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _scalars(K: Float64, R: Float64, t: Float64) -> tuple[_Camera, _Motion]:
    camera = (K[0, 0], K[0, 1], K[1, 1], K[0, 2], K[1, 2])
    return camera, (R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2], t[0], t[1], t[2])


@njit(cache=True, error_model="numpy")
def _ray_length(camera: _Camera, column: float, row: float) -> float:
    """Return the length of a pixel's ray, where z is 1."""
    fx, skew, fy, cx, cy = camera
    y = (row - cy) / fy
    x = (column - cx - skew * y) / fx
    return float(np.sqrt(1.0 + x * x + y * y))


@njit(cache=True, error_model="numpy")
def _project(
    camera: _Camera, motion: _Motion, path_px: float, ray: float, pixel: tuple[float, float, float], frame: _SecondFrame
) -> tuple[bool, float, float, float, float, float]:
    """Return whether a pixel can be compared in the second frame (H, W); its column and row there, X1, Y1, Z1.

    A pixel is its column, row and depth. It can be compared where nothing nearer may have moved in front of it: by
    f |t| |m| times the difference of 1/Z; ``path_px`` is f |t|.
    """
    fx, skew, fy, cx, cy = camera
    Rxx, Rxy, Rxz, Ryx, Ryy, Ryz, Rzx, Rzy, Rzz, tx, ty, tz = motion
    column, row, depth = pixel
    y0 = (row - cy) / fy
    x0 = (column - cx - skew * y0) / fx
    length = np.sqrt(1.0 + x0 * x0 + y0 * y0)
    z0 = depth / length**ray if ray != 0.0 else depth
    # X1 = R X0 + t with X0 = z0 (x0, y0, 1)
    X1 = z0 * (Rxx * x0 + (Rxy * y0 + Rxz)) + tx
    Y1 = z0 * (Ryx * x0 + (Ryy * y0 + Ryz)) + ty
    Z1 = z0 * (Rzx * x0 + (Rzy * y0 + Rzz)) + tz
    column1 = (fx * X1 + skew * Y1) / Z1 + cx
    row1 = fy * Y1 / Z1 + cy
    height, width = frame.depths_m.shape
    if not ((Z1 > 0.0) & (column1 >= 0.0) & (column1 < width - 1) & (row1 >= 0.0) & (row1 < height - 1)):
        return False, 0.0, 0.0, X1, Y1, Z1
    # The nearest surface moves most against the pixel: no occluder comes from farther away.
    parallax_px = path_px * length * max(frame.nearest_per_m - 1.0 / z0, 0.0)
    block = np.uint32(frame.block_px)
    clear_px = frame.clearance_px[np.uint64(_nearest(row1) // block), np.uint64(_nearest(column1) // block)]
    return bool(clear_px > parallax_px), column1, row1, X1, Y1, Z1


@njit(cache=True, error_model="numpy")
def _nearest(coordinate: float) -> np.uint32:
    return np.uint32(np.int32(np.rint(coordinate)))


@njit(cache=True, error_model="numpy")
def _read_inverse_depth(depths: Depths, column: float, row: float) -> tuple[float, float, float]:
    """Return the bilinear inverse depth at a position within the image, and its derivatives along columns and rows."""
    left, top, step = np.uint64(np.int32(column)), np.uint64(np.int32(row)), np.uint64(1)
    right, below = column - np.int32(column), row - np.int32(row)
    first, second = inverse_at(depths, top, left), inverse_at(depths, top, left + step)
    third, fourth = inverse_at(depths, top + step, left), inverse_at(depths, top + step, left + step)
    above, under = first + right * (second - first), third + right * (fourth - third)
    by_column = (1 - below) * (second - first) + below * (fourth - third)
    return above + below * (under - above), by_column, under - above


@njit(cache=True, error_model="numpy")
def _residuals(geometry: _Geometry, pixels: _Pixels, frame: _SecondFrame) -> Float64:
    """Return the residuals (n,) of ``_warp_pixels`` alone."""
    t, ray = geometry.t, geometry.ray
    columns, rows, depths_m = pixels.columns, pixels.rows, pixels.depths_m
    camera, motion = _scalars(geometry.K, geometry.R, t)
    path_px = camera[0] * np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    residuals = np.empty(len(columns))
    for i in range(len(columns)):
        compared, column1, row1, _, _, Z1 = _project(
            camera, motion, path_px, ray, (columns[i], rows[i], depths_m[i]), frame
        )
        residuals[i] = np.nan
        if compared:
            shortening = _ray_length(camera, column1, row1) ** ray if ray != 0.0 else 1.0
            # r = Z1 / Z_read - 1, a share of the depth: near and far surfaces compare alike.
            residuals[i] = _read_inverse_depth(frame.depths_m, column1, row1)[0] * shortening * Z1 - 1.0
    return residuals


@njit(cache=True, error_model="numpy")
def _warp_pixels(
    geometry: _Geometry, errors: _ModelErrors, pixels: _Pixels, frame: _SecondFrame, number: int, warped: _Residuals
) -> int:
    """Write residuals, bounds and derivatives of pixels; NaN, NaN and 0 where they are not compared.

    Returns how many are compared. ``number`` says by what the derivatives by a number are taken: 0 nothing, 1 the
    scale, 2 the ray's power.
    """
    t, scale, ray = geometry.t, geometry.scale, geometry.ray
    columns, rows, depths_m, relative_errors = pixels
    depths1_m, errors1_per_m, quantisation_error = frame.depths_m, frame.error_per_m, frame.quantisation_error
    residuals, bounds, twist_derivatives, number_derivatives = warped
    pixel_px = errors.pixel_px
    camera, motion = _scalars(geometry.K, geometry.R, t)
    fx, skew, fy, cx, cy = camera
    tx, ty, tz = t[0], t[1], t[2]
    path_x, path_y, path_z = geometry.path[0], geometry.path[1], geometry.path[2]
    path_px = fx * np.sqrt(tx * tx + ty * ty + tz * tz)
    err_a, err_b, err_c = errors.twist[0], errors.twist[1], errors.twist[2]
    err_x, err_y, err_z = errors.twist[3], errors.twist[4], errors.twist[5]
    count = 0
    for i in range(len(columns)):
        compared, column1, row1, X1, Y1, Z1 = _project(
            camera, motion, path_px, ray, (columns[i], rows[i], depths_m[i]), frame
        )
        by_twist = twist_derivatives[i]
        number_derivatives[i] = 0.0
        if not compared:
            residuals[i] = bounds[i] = np.nan
            by_twist[:] = 0.0
            continue
        count += 1
        inverse, by_column, by_row = _read_inverse_depth(depths1_m, column1, row1)
        # 1/z from the inverse length of the ray: times |m|^ray.
        shortening = _ray_length(camera, column1, row1) ** ray if ray != 0.0 else 1.0
        inverse, by_column, by_row = inverse * shortening, by_column * shortening, by_row * shortening
        # Gradient of the residual r = inverse(u, v) Z - 1 by the point (X, Y, Z), with u = (fx X + skew Y) / Z + cx.
        by_x = by_column * fx
        by_y = by_column * skew + by_row * fy
        by_z = inverse - (by_column * (column1 - cx) + by_row * (row1 - cy))
        # A twist (w, v) moves the point by w x X + v, so that dr/dw = X x dr/dX.
        a, b, c = Y1 * by_z - Z1 * by_y, Z1 * by_x - X1 * by_z, X1 * by_y - Y1 * by_x
        x, y, z = scale * by_x, scale * by_y, scale * by_z
        by_twist[0], by_twist[1], by_twist[2], by_twist[3], by_twist[4], by_twist[5] = a, b, c, x, y, z
        if number == 1:
            # t = scale path
            number_derivatives[i] = by_x * path_x + by_y * path_y + by_z * path_z
        elif number == 2:  # z is the shorter, the longer its ray is, and so is what is read
            nearer = by_x * (X1 - tx) + by_y * (Y1 - ty) + by_z * (Z1 - tz)
            length1, length0 = _ray_length(camera, column1, row1), _ray_length(camera, columns[i], rows[i])
            number_derivatives[i] = inverse * Z1 * np.log(length1) - nearer * np.log(length0)
        # The bound adds all errors in the worst direction: of both depths, of the pixel's coordinates, of the motion.
        error_per_m = np.float64(errors1_per_m[np.uint64(_nearest(row1)), np.uint64(_nearest(column1))])
        bound = relative_errors[i] + error_per_m * shortening * Z1 + quantisation_error * inverse * Z1
        bound += pixel_px * (abs(by_column) + abs(by_row)) * Z1
        bound += abs(a) * err_a + abs(b) * err_b + abs(c) * err_c + abs(x) * err_x + abs(y) * err_y + abs(z) * err_z
        residuals[i], bounds[i] = inverse * Z1 - 1.0, bound
    return count
