"""Depth of one frame, carried by the camera's motion into another, against the depth that stands there."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth_image import SINGLE_PRECISION, DepthImage
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import moved_points

Float64 = NDArray[np.float64]

FEWEST_IN_LATTICE: Final = 4000
"""Pixels of a lattice that small images have nevertheless: each of 48 tiles then holds some eighty."""

FARTHEST_RAY: Final = 10.0
"""Power of the ray's length beyond which nothing is a depth: 0 and 1 occur. Powers of hundreds leave double precision.
"""

_PIXEL_ROUNDINGS: Final = 4
"""Roundings that meet a pixel coordinate of the image's size in the maker's single-precision arithmetic."""


@dataclass(frozen=True, slots=True)
class Lattice:
    """Pixels of the first frame: columns and rows (n,), z-depths in metres, and the share by which each may err."""

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64


@dataclass(frozen=True, slots=True)
class DepthModel:
    """How two depth frames hang together.

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
        """Whether depths could be so at all: a fit that finds no hold ends elsewhere."""
        return bool(abs(self.ray) <= FARTHEST_RAY and np.isfinite(self.scale))

    @property
    def motion_of_points(self) -> RigidMotion:
        """The motion in the unit of the depths."""
        return RigidMotion(self.motion.R, self.scale * self.motion.t_m)


@dataclass(frozen=True, slots=True)
class Warped:
    """The lattice in the second frame; NaN where the two frames cannot be compared.

    Attributes
    ----------
    residuals
        (n,) relative error of the second frame's inverse depth: ``Z1 / Z_found - 1``.
    bounds
        (n,) how large it may honestly be.
    by_twist
        (n, 6) derivative of the residual by a twist (rad, m) that follows the motion.
    """

    residuals: Float64
    bounds: Float64
    by_twist: Float64


def lattice_stride(height: int, width: int, share: float) -> int:
    """Return the step between pixels that are looked at: 1/share both ways, or less to keep some thousands of them."""
    enough = int(np.sqrt(height * width / FEWEST_IN_LATTICE))
    return max(1, min(round(1 / share), enough))


def lattice_of(image: DepthImage, stride: int, most: int | None = None) -> Lattice:
    """Return every so many-th pixel in both directions that lies clear of edges, thinned to at most ``most``."""
    clear = image.clearance_px[::stride, ::stride] > 0
    row, column = np.nonzero(clear)
    if most is not None and len(row) > most:
        chosen = np.linspace(0, len(row) - 1, most).astype(np.intp)
        row, column = row[chosen], column[chosen]
    row, column = row * stride, column * stride
    inverse = image.inverse_per_m[row, column]
    return Lattice(
        column.astype(np.float64), row.astype(np.float64), 1.0 / inverse, image.error_per_m[row, column] / inverse
    )


def warp(model: DepthModel, lattice: Lattice, image1: DepthImage) -> Warped:
    """Carry the lattice into the second frame and compare.

    Pixels count where they land clear of edges of the second frame by more than anything nearer may have moved
    against them: what is hidden there is not compared. The mask does not look at the residual.
    """
    K, motion = model.K, model.motion_of_points
    lengths0 = _ray_lengths(K, lattice.columns, lattice.rows)
    depths0_m = lattice.depths_m / lengths0**model.ray
    X1, Y1, Z1 = moved_points(K, motion, lattice.columns, lattice.rows, depths0_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        x1 = (K[0, 0] * X1 + K[0, 1] * Y1) / Z1 + K[0, 2]
        y1 = K[1, 1] * Y1 / Z1 + K[1, 2]
    height, width = image1.inverse_per_m.shape
    seen = (Z1 > 0) & (x1 >= 0) & (x1 < width - 1) & (y1 >= 0) & (y1 < height - 1)
    x1, y1 = np.where(seen, x1, 0.0), np.where(seen, y1, 0.0)
    clearance_px = image1.clearance_px[_nearest(y1), _nearest(x1)]
    seen &= clearance_px > _parallax_px(K, motion, lengths0, image1.nearest_per_m, 1.0 / depths0_m)
    found, by_column, by_row = _read(image1.inverse_per_m, x1, y1)
    shortening = _ray_lengths(K, x1, y1) ** model.ray
    found, by_column, by_row = found * shortening, by_column * shortening, by_row * shortening
    by_point = np.stack((
        by_column * K[0, 0],
        by_column * K[0, 1] + by_row * K[1, 1],
        found - (by_column * (x1 - K[0, 2]) + by_row * (y1 - K[1, 2])),
    ), axis=-1)  # fmt: skip
    steepness = (np.abs(by_column) + np.abs(by_row)) * Z1
    bounds = (
        lattice.relative_errors
        + image1.error_per_m[_nearest(y1), _nearest(x1)] * shortening * Z1
        + SINGLE_PRECISION * _PIXEL_ROUNDINGS * (width + height) * steepness
    )
    points1_m = np.stack((X1, Y1, Z1), axis=-1)
    by_twist = np.concatenate((np.cross(points1_m, by_point), model.scale * by_point), axis=-1)
    return Warped(
        residuals=np.where(seen, found * Z1 - 1.0, np.nan),
        bounds=bounds + np.sum(np.abs(by_twist) * model.motion_error, axis=-1),
        by_twist=by_twist,
    )


def _parallax_px(
    K: Float64, motion: RigidMotion, lengths0: Float64, nearest_per_m: float, inverse0_per_m: Float64
) -> Float64:
    """Bound how far a surface as near as the nearest may have moved against each point: f |t| |m| times 1/Z apart."""
    moved = K[0, 0] * float(np.linalg.norm(motion.t_m)) * lengths0
    return np.asarray(moved * np.maximum(nearest_per_m - inverse0_per_m, 0.0))


def ray_lengths(K: Float64, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the length of each pixel's ray (H, W), where z is 1."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    return _ray_lengths(K, columns, rows).astype(np.float32)


def _ray_lengths(K: Float64, columns: Float64, rows: Float64) -> Float64:
    y = (rows - K[1, 2]) / K[1, 1]
    x = (columns - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return np.asarray(np.sqrt(1.0 + x**2 + y**2))


def _nearest(coordinates: Float64) -> NDArray[np.intp]:
    return np.rint(coordinates).astype(np.intp)


def _read(image: Float64, columns: Float64, rows: Float64) -> tuple[Float64, Float64, Float64]:
    """Return the bilinear value at positions within the image, and its derivatives along columns and rows."""
    column, row = np.floor(columns).astype(np.intp), np.floor(rows).astype(np.intp)
    right, below = columns - column, rows - row
    first, second = image[row, column], image[row, column + 1]
    third, fourth = image[row + 1, column], image[row + 1, column + 1]
    above, under = first + right * (second - first), third + right * (fourth - third)
    by_column = (1 - below) * (second - first) + below * (fourth - third)
    return above + below * (under - above), by_column, under - above
