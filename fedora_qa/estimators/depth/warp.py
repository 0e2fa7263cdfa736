"""Depth of one frame, warped by the motion of the camera into another frame, compared with the depth of that frame.

Numbers that are equal for all pixels are read before a compiled loop. Inside the loop the compiler would read them
again for each pixel, because the arrays that are written could overlap them. Indices are unsigned, because signed ones
are tested for negative values at each access.
"""

from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import SINGLE_PRECISION, DepthImage, inverse_at
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import PINHOLE, CompiledLens, compiled, distort, distort_slopes, rays_of_pixels, undistort
from fedora_qa.sequence.declared import Lens

Depths = NDArray[np.floating[Any]]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
_Camera = tuple[float, float, float, float, float]
"""fx, skew, fy, cx, cy: focal lengths, skew and principal point, px."""
_Motion = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
"""Rotation (by rows), and translation in the unit of the depths."""

FEWEST_IN_LATTICE: Final = 4000
"""Approximate least number of pixels of a lattice: each of 48 tiles then holds about eighty. Small images have denser
lattices for this."""

FARTHEST_RAY: Final = 10.0
"""Largest absolute power of the ray length in a conceivable model. Files have 0 and 1; powers of hundreds exceed double
precision."""

ModelNumber = Literal["scale", "ray"]
"""A number of a model by which residuals can be differentiated."""

# Codes of the numbers in compiled loops.
_NUMBERS: Final = {None: 0, "scale": 1, "ray": 2}

_PIXEL_ROUNDINGS: Final = 4
"""Number of roundings of a pixel coordinate in the single-precision arithmetic of the file's writer."""


@dataclass(frozen=True, slots=True)
class DepthLattice:
    """Pixels of the first frame.

    Attributes
    ----------
    columns, rows
        (n,) positions, px.
    depths_m
        (n,) depths, m: z-depth, or ray length where the model states so.
    relative_errors
        (n,) bounds on the errors of the depths, as shares of them.
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64

    def with_relative_error(self, relative_error: float) -> "DepthLattice":
        """Return the same pixels, with a further relative error (a share of the depth) added to their bounds."""
        return replace(self, relative_errors=self.relative_errors + relative_error)

    def thinned(self, most: int) -> "DepthLattice":
        """Return at most ``most`` of the pixels, evenly spaced in their order."""
        if len(self.columns) <= most:
            return self
        chosen = np.linspace(0, len(self.columns) - 1, most).astype(np.intp)
        return DepthLattice(
            *(values[chosen] for values in (self.columns, self.rows, self.depths_m, self.relative_errors))
        )


@dataclass(frozen=True, slots=True)
class DepthModel:
    """Camera, motion and kind of depth of two depth frames.

    Attributes
    ----------
    K
        (3, 3) intrinsics of both frames, px.
    motion
        Transform of points from the camera frame at the first depth frame into that at the second, m.
    ray
        Depths are ``z |m|^ray`` with m = (x/z, y/z, 1): 0 for z-depth, 1 for ray length.
    scale
        Ratio of the depths to the true ones. Translations are multiplied by it to have the unit of the depths.
    motion_error
        (6,) bound on the error of the motion as a twist (rad, m); 0 where the motion is between samples of the pose.
    lens
        Distortion of both frames; None for a pinhole.
    """

    K: Float64
    motion: RigidMotion
    ray: float = 0.0
    scale: float = 1.0
    motion_error: Float64 | float = 0.0
    lens: Lens | None = None

    @property
    def conceivable(self) -> bool:
        """Whether the numbers are within what a file can hold; a fit that diverges leaves these bounds."""
        return bool(abs(self.ray) <= FARTHEST_RAY and np.isfinite(self.scale))

    @property
    def motion_of_points(self) -> RigidMotion:
        """The motion, with its translation in the unit of the depths."""
        return RigidMotion(self.motion.R, self.scale * self.motion.t_m)


@dataclass(frozen=True, slots=True)
class WarpedLattice:
    """The lattice in the second frame.

    Attributes
    ----------
    residuals
        (n,) relative error of the inverse depth of the second frame: ``Z1 / Z_read - 1``, with Z1 the z-depth of the
        point there, and Z_read the z-depth that the frame holds. NaN where a pixel is not compared.
    bounds
        (n,) largest absolute residuals of a correct file; NaN where a pixel is not compared.
    twist_derivatives
        (n, 6) derivatives of the residual by a twist (rad, m) that follows the motion; 0 where a pixel is not compared.
    number_derivatives
        (n,) derivatives of the residual by a number of the model; 0 without one, or where a pixel is not compared.
    compared
        Number of pixels that are compared.
    """

    residuals: Float64
    bounds: Float64
    twist_derivatives: Float64
    number_derivatives: Float64
    compared: int

    @property
    def typical_bound(self) -> float:
        """Median of the finite bounds."""
        return median_of(self.bounds[np.isfinite(self.bounds)])

    def allowing(self, twists: Float64) -> "WarpedLattice":
        """Return the lattice with larger bounds: by the effects of independent errors of the motion.

        Parameters
        ----------
        twists
            (6, k) largest errors, one in each column (rad, then m).
        """
        return replace(self, bounds=self.bounds + np.abs(self.twist_derivatives @ twists).sum(axis=1))


def lattice_stride(height: int, width: int, share: float) -> int:
    """Return the distance of neighbouring pixels of a lattice.

    Parameters
    ----------
    height, width
        Size of the image, px.
    share
        Share of the columns, and of the rows, that the lattice should have, above 0 and at most 1.

    Returns
    -------
    int
        Distance of columns and of rows, px: 1 / share, or less where the lattice would have fewer than
        ``FEWEST_IN_LATTICE`` pixels; 1 at least.
    """
    of_small_image = int(np.sqrt(height * width / FEWEST_IN_LATTICE))
    return max(1, min(round(1 / share), of_small_image))


def lattice_of(image: DepthImage, stride: int, most: int | None = None) -> DepthLattice:
    """Return the pixels of a regular lattice that are not near an edge.

    Parameters
    ----------
    image
        The first frame.
    stride
        Distance of the columns and of the rows of the lattice, px.
    most
        Largest number of pixels; the lattice is thinned to it. None: all pixels.

    Returns
    -------
    DepthLattice
        With bounds of errors that include the steps of quantised depths.
    """
    lattice = DepthLattice(*lattice_values(image, stride)).with_relative_error(image.quantisation_error)
    return lattice if most is None else lattice.thinned(most)


def lattice_values(image: DepthImage, stride: int) -> Float64:
    """Return the pixels of a regular lattice that are not near an edge, as an array.

    Parameters
    ----------
    image
        The first frame.
    stride
        Distance of the columns and of the rows of the lattice, px.

    Returns
    -------
    Float64
        (4, n): columns, rows (px), depths (m) and bounds of their relative errors. The bounds do not include the steps
        of quantised depths.
    """
    row, column = np.nonzero(image.near_edge[::stride, ::stride] == 0)
    row, column = row * stride, column * stride
    depths_m = image.depths_m[row, column].astype(np.float64)
    return np.stack((column, row, depths_m, image.error_per_m[row, column] * depths_m))


def warp(
    model: DepthModel, lattice: DepthLattice, image1: DepthImage, number: ModelNumber | None = None
) -> WarpedLattice:
    """Warp the lattice into the second frame and compare its inverse depths with those of that frame.

    Parameters
    ----------
    model
        Camera, motion and kind of depth of both frames.
    lattice
        Pixels of the first frame.
    image1
        The second frame.
    number
        Number of the model by which residuals are differentiated, besides the twist of the motion; None: no number.

    Returns
    -------
    WarpedLattice
        A pixel is compared if its distance from the edges of the second frame exceeds the parallax of any nearer
        surface: occluded surfaces are not compared. The choice does not depend on the residuals.
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
    """Return the residuals of ``warp`` without their bounds and derivatives.

    Parameters
    ----------
    model
        Camera, motion and kind of depth of both frames.
    lattice
        n pixels of the first frame.
    image1
        The second frame.

    Returns
    -------
    Float64
        (n,) ``Z1 / Z_read - 1``; NaN where a pixel is not compared.
    """
    pixels = _Pixels(lattice.columns, lattice.rows, lattice.depths_m, lattice.relative_errors)
    return _residuals(_geometry(model), pixels, _second_frame(image1))


def ray_lengths(K: Float64, lens: Lens | None, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the ray length over the z-depth of each pixel.

    Parameters
    ----------
    K, lens
        (3, 3) intrinsics, px, with whole numbers at pixel centres, and the distortion; None for a pinhole.
    shape
        Rows H and columns W of the image.

    Returns
    -------
    NDArray
        (H, W) |m| with m = (x/z, y/z, 1), 1 at least.
    """
    # m = (x, y, 1), the ray with z = 1.
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    x, y = rays_of_pixels(K, lens, columns, rows)
    return np.asarray(np.sqrt(1.0 + x**2 + y**2)).astype(np.float32)


class _Geometry(NamedTuple):
    """A ``DepthModel`` for compiled loops; t = scale * path is in the unit of the depths, ``path`` in metres."""

    K: Float64
    R: Float64
    t: Float64
    path: Float64
    scale: float
    ray: float
    lens: CompiledLens


class _ModelErrors(NamedTuple):
    """Bound on the error of the motion as a twist (6,) (rad, m), and on the rounding of a pixel coordinate, px."""

    twist: Float64
    pixel_px: float


class _Pixels(NamedTuple):
    """A ``DepthLattice`` for compiled loops."""

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64


class _SecondFrame(NamedTuple):
    """A ``DepthImage`` for compiled loops, without its marks of edges."""

    depths_m: Depths
    error_per_m: Float32
    quantisation_error: float
    clearance_px: Float32
    block_px: int
    nearest_per_m: float


class _Residuals(NamedTuple):
    """The arrays of a ``WarpedLattice``, which a compiled loop writes."""

    residuals: Float64
    bounds: Float64
    twist_derivatives: Float64
    number_derivatives: Float64


def _geometry(model: DepthModel) -> _Geometry:
    motion = model.motion_of_points
    return _Geometry(
        model.K, motion.R, motion.t_m, model.motion.t_m, float(model.scale), float(model.ray), compiled(model.lens)
    )


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
def _ray(camera: _Camera, lens: CompiledLens, column: float, row: float) -> tuple[float, float]:
    """Return the slopes of the ray of a pixel; NaN where none is imaged there."""
    fx, skew, fy, cx, cy = camera
    y = (row - cy) / fy
    x = (column - cx - skew * y) / fx
    return undistort(lens, x, y) if lens.model != PINHOLE else (x, y)


@njit(cache=True, error_model="numpy")
def _ray_length(camera: _Camera, lens: CompiledLens, column: float, row: float) -> float:
    """Return the ray length over the z-depth of a pixel."""
    x, y = _ray(camera, lens, column, row)
    return float(np.sqrt(1.0 + x * x + y * y))


@njit(cache=True, error_model="numpy")
def _project(
    camera: _Camera,
    lens: CompiledLens,
    motion: _Motion,
    path_px: float,
    ray: float,
    pixel: tuple[float, float, float],
    frame: _SecondFrame,
) -> tuple[bool, float, float, float, float, float]:
    """Return whether a pixel can be compared in the second frame (H, W); its column and row there, px; X1, Y1, Z1.

    ``pixel`` is column, row (px) and depth. It can be compared where no nearer surface can have moved in front of it.
    The parallax of a nearer surface is at most f |t| |m| times the difference of both 1/Z; ``path_px`` is f |t|. A lens
    multiplies it by its largest derivative, which is taken where the point is seen.
    """
    fx, skew, fy, cx, cy = camera
    Rxx, Rxy, Rxz, Ryx, Ryy, Ryz, Rzx, Rzy, Rzz, tx, ty, tz = motion
    column, row, depth = pixel
    x0, y0 = _ray(camera, lens, column, row)
    length = np.sqrt(1.0 + x0 * x0 + y0 * y0)
    z0 = depth / length**ray if ray != 0.0 else depth
    # X1 = R X0 + t with X0 = z0 (x0, y0, 1)
    X1 = z0 * (Rxx * x0 + (Rxy * y0 + Rxz)) + tx
    Y1 = z0 * (Ryx * x0 + (Ryy * y0 + Ryz)) + ty
    Z1 = z0 * (Rzx * x0 + (Rzy * y0 + Rzz)) + tz
    if lens.model == PINHOLE:
        column1 = (fx * X1 + skew * Y1) / Z1 + cx
        row1 = fy * Y1 / Z1 + cy
    else:
        x1, y1 = X1 / Z1, Y1 / Z1
        if not np.sqrt(x1 * x1 + y1 * y1) <= lens.largest_radius:
            return False, 0.0, 0.0, X1, Y1, Z1
        xx, xy, yx, yy = distort_slopes(lens, x1, y1)
        path_px *= max(abs(xx) + abs(xy), abs(yx) + abs(yy))
        x1, y1 = distort(lens, x1, y1)
        column1, row1 = fx * x1 + skew * y1 + cx, fy * y1 + cy
    height, width = frame.depths_m.shape
    if not ((Z1 > 0.0) & (column1 >= 0.0) & (column1 < width - 1) & (row1 >= 0.0) & (row1 < height - 1)):
        return False, 0.0, 0.0, X1, Y1, Z1
    # parallax = f |t| |m| (1 / Z_nearest - 1 / z0): the nearest surface has the largest.
    parallax_px = path_px * length * max(frame.nearest_per_m - 1.0 / z0, 0.0)
    block = np.uint32(frame.block_px)
    clear_px = frame.clearance_px[np.uint64(_nearest(row1) // block), np.uint64(_nearest(column1) // block)]
    return bool(clear_px > parallax_px), column1, row1, X1, Y1, Z1


@njit(cache=True, error_model="numpy")
def _nearest(coordinate: float) -> np.uint32:
    return np.uint32(np.int32(np.rint(coordinate)))


@njit(cache=True, error_model="numpy")
def _read_inverse_depth(depths: Depths, column: float, row: float) -> tuple[float, float, float]:
    """Return the bilinear inverse depth at a position, 1/m, and its derivatives by column and row, 1/m/px."""
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
    t, ray, lens = geometry.t, geometry.ray, geometry.lens
    columns, rows, depths_m = pixels.columns, pixels.rows, pixels.depths_m
    camera, motion = _scalars(geometry.K, geometry.R, t)
    path_px = camera[0] * np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    residuals = np.empty(len(columns))
    for i in range(len(columns)):
        compared, column1, row1, _, _, Z1 = _project(
            camera, lens, motion, path_px, ray, (columns[i], rows[i], depths_m[i]), frame
        )
        residuals[i] = np.nan
        if compared:
            shortening = _ray_length(camera, lens, column1, row1) ** ray if ray != 0.0 else 1.0
            # r = Z1 / Z_read - 1, a share of the depth.
            residuals[i] = _read_inverse_depth(frame.depths_m, column1, row1)[0] * shortening * Z1 - 1.0
    return residuals


@njit(cache=True, error_model="numpy")
def _warp_pixels(
    geometry: _Geometry, errors: _ModelErrors, pixels: _Pixels, frame: _SecondFrame, number: int, warped: _Residuals
) -> int:
    """Write residuals, bounds and derivatives of pixels; NaN, NaN and 0 where they are not compared.

    Returns the number of pixels that are compared. ``number`` is the code of the number of the model by which residuals
    are differentiated: 0 none, 1 the scale, 2 the power of the ray length.
    """
    t, scale, ray, lens = geometry.t, geometry.scale, geometry.ray, geometry.lens
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
            camera, lens, motion, path_px, ray, (columns[i], rows[i], depths_m[i]), frame
        )
        by_twist = twist_derivatives[i]
        number_derivatives[i] = 0.0
        if not compared:
            residuals[i] = bounds[i] = np.nan
            by_twist[:] = 0.0
            continue
        count += 1
        inverse, by_column, by_row = _read_inverse_depth(depths1_m, column1, row1)
        # 1 / z = |m|^ray / depth
        shortening = _ray_length(camera, lens, column1, row1) ** ray if ray != 0.0 else 1.0
        inverse, by_column, by_row = inverse * shortening, by_column * shortening, by_row * shortening
        # Gradient of the residual r = inverse(u, v) Z - 1 by the point (X, Y, Z), with u = (fx X + skew Y) / Z + cx.
        by_x = by_column * fx
        by_y = by_column * skew + by_row * fy
        by_z = inverse - (by_column * (column1 - cx) + by_row * (row1 - cy))
        if lens.model != PINHOLE:
            # With u = fx x_d + skew y_d + cx the derivative of the lens comes between; slopes are X / Z and Y / Z.
            xx, xy, yx, yy = distort_slopes(lens, X1 / Z1, Y1 / Z1)
            by_x, by_y = by_x * xx + by_y * yx, by_x * xy + by_y * yy
            by_z = inverse - (by_x * X1 + by_y * Y1) / Z1
        # A twist (w, v) moves the point by w x X + v, so that dr/dw = X x dr/dX.
        a, b, c = Y1 * by_z - Z1 * by_y, Z1 * by_x - X1 * by_z, X1 * by_y - Y1 * by_x
        x, y, z = scale * by_x, scale * by_y, scale * by_z
        by_twist[0], by_twist[1], by_twist[2], by_twist[3], by_twist[4], by_twist[5] = a, b, c, x, y, z
        if number == 1:
            # t = scale path, so that dr/dscale = dr/dX . path.
            number_derivatives[i] = by_x * path_x + by_y * path_y + by_z * path_z
        elif number == 2:  # d(1/Z_read)/dray = log|m1| / Z_read, dz0/dray = -log|m0| z0
            nearer = by_x * (X1 - tx) + by_y * (Y1 - ty) + by_z * (Z1 - tz)
            length1, length0 = _ray_length(camera, lens, column1, row1), _ray_length(camera, lens, columns[i], rows[i])
            number_derivatives[i] = inverse * Z1 * np.log(length1) - nearer * np.log(length0)
        # The bound is the sum of all absolute errors: of both depths, of the pixel coordinates and of the motion.
        error_per_m = np.float64(errors1_per_m[np.uint64(_nearest(row1)), np.uint64(_nearest(column1))])
        bound = relative_errors[i] + error_per_m * shortening * Z1 + quantisation_error * inverse * Z1
        bound += pixel_px * (abs(by_column) + abs(by_row)) * Z1
        bound += abs(a) * err_a + abs(b) * err_b + abs(c) * err_c + abs(x) * err_x + abs(y) * err_y + abs(z) * err_z
        residuals[i], bounds[i] = inverse * Z1 - 1.0, bound
    return count
