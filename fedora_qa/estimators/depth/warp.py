"""Depth of one frame, carried by the camera's motion into another, against the depth that stands there."""

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import SINGLE_PRECISION, DepthImage
from fedora_qa.estimators.depth.warp_kernels import carry, residuals_of
from fedora_qa.geometry.camera import RigidMotion

Float64 = NDArray[np.float64]

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
class Lattice:
    """Pixels of the first frame: columns and rows (n,), z-depths in metres, and the share by which each may err."""

    columns: Float64
    rows: Float64
    depths_m: Float64
    relative_errors: Float64

    def with_steps(self, of_step: float) -> "Lattice":
        """Return the same pixels, whose depths err by a share of themselves as well."""
        return replace(self, relative_errors=self.relative_errors + of_step)

    def thinned(self, most: int) -> "Lattice":
        """Return at most so many of the pixels, evenly spread over their order."""
        if len(self.columns) <= most:
            return self
        chosen = np.linspace(0, len(self.columns) - 1, most).astype(np.intp)
        return Lattice(*(values[chosen] for values in (self.columns, self.rows, self.depths_m, self.relative_errors)))


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
        (n, 6) derivative of the residual by a twist (rad, m) that follows the motion; 0 where it is not compared.
    by_number
        (n,) derivative of the residual by a number of the model; 0 where it is not compared, or none was asked for.
    seen
        How many pixels are compared.
    """

    residuals: Float64
    bounds: Float64
    by_twist: Float64
    by_number: Float64
    seen: int


def lattice_stride(height: int, width: int, share: float) -> int:
    """Return the step between pixels that are looked at: 1/share both ways, or less to keep some thousands of them."""
    enough = int(np.sqrt(height * width / FEWEST_IN_LATTICE))
    return max(1, min(round(1 / share), enough))


def lattice_of(image: DepthImage, stride: int, most: int | None = None) -> Lattice:
    """Return every so many-th pixel in both directions that lies clear of edges, thinned to at most ``most``."""
    lattice = Lattice(*lattice_values(image, stride)).with_steps(image.of_step)
    return lattice if most is None else lattice.thinned(most)


def lattice_values(image: DepthImage, stride: int) -> Float64:
    """Return columns, rows, depths and relative errors (4, n) of a lattice, but for steps of quantised depths."""
    row, column = np.nonzero(image.near_edge[::stride, ::stride] == 0)
    row, column = row * stride, column * stride
    depths_m = image.depths_m[row, column].astype(np.float64)
    return np.stack((column, row, depths_m, image.error_per_m[row, column] * depths_m))


def warp(model: DepthModel, lattice: Lattice, image1: DepthImage, number: ModelNumber | None = None) -> Warped:
    """Carry the lattice into the second frame and compare; differentiate by the motion, and by a number of the model.

    Pixels count where they land clear of edges of the second frame by more than anything nearer may have moved
    against them: what is hidden there is not compared. The mask does not look at the residual.
    """
    motion, n = model.motion_of_points, len(lattice.columns)
    height, width = image1.depths_m.shape
    residuals, bounds, by_twist, by_number = np.empty(n), np.empty(n), np.empty((n, 6)), np.empty(n)
    seen = carry(
        model.K, motion.R, motion.t_m, model.ray, model.scale, model.motion.t_m,
        np.broadcast_to(model.motion_error, 6).copy(),
        SINGLE_PRECISION * _PIXEL_ROUNDINGS * (width + height),
        lattice.columns, lattice.rows, lattice.depths_m, lattice.relative_errors, image1.depths_m,
        image1.error_per_m, image1.of_step, image1.clearance_px, image1.block_px, image1.nearest_per_m,
        residuals, bounds, by_twist, _NUMBERS[number], by_number,
    )  # fmt: skip
    return Warped(residuals, bounds, by_twist, by_number, seen)


def residuals_after(model: DepthModel, lattice: Lattice, image1: DepthImage) -> Float64:
    """Return the residuals (n,) of ``warp`` alone."""
    motion = model.motion_of_points
    return residuals_of(
        model.K, motion.R, motion.t_m, model.ray, lattice.columns, lattice.rows, lattice.depths_m,
        image1.depths_m, image1.clearance_px, image1.block_px, image1.nearest_per_m,
    )  # fmt: skip


def ray_lengths(K: Float64, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the length of each pixel's ray (H, W), where z is 1."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    return _ray_lengths(K, columns, rows).astype(np.float32)


def _ray_lengths(K: Float64, columns: Float64, rows: Float64) -> Float64:
    y = (rows - K[1, 2]) / K[1, 1]
    x = (columns - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return np.asarray(np.sqrt(1.0 + x**2 + y**2))
