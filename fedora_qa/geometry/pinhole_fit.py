"""The pinhole camera that images given rays at given positions.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. (2004): 4.1 (direct linear transformation), A4.1.1 (RQ
decomposition), 8.4 (views with one centre).
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import rq

Float64 = NDArray[np.float64]

_MOST_RAYS: Final = 2000
"""Rays that are used, evenly spread: eight numbers are fitted to positions that are exact but for rounding."""


@dataclass(frozen=True, slots=True)
class PinholeFit:
    """A camera without distortion.

    Attributes
    ----------
    K
        (3, 3) intrinsics, px.
    R
        (3, 3) rotation from the axes of the rays to those of the camera.
    """

    K: Float64
    R: Float64

    def positions_px(self, x: NDArray[Any], y: NDArray[Any]) -> Float64:
        """Return where rays of the slopes x and y are imaged, (..., 2) px; NaN behind the camera."""
        along = np.stack([x, y, np.ones_like(x)], axis=-1) @ (self.K @ self.R).T
        ahead = np.where(along[..., 2:] > 0, along[..., 2:], np.nan)
        return np.asarray(along[..., :2] / ahead)


def fit_pinhole(x: NDArray[Any], y: NDArray[Any], positions_px: NDArray[Any], K: Float64) -> PinholeFit | None:
    """Fit a camera to rays and their positions.

    Parameters
    ----------
    x, y
        Slopes of the rays, of any shape.
    positions_px
        (..., 2) px; rays without a position are left out.
    K
        (3, 3) intrinsics of a camera like it, px, by which positions are normalised.

    Returns
    -------
    PinholeFit or None
        None where fewer than four rays have a position, or where no camera fits.
    """
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    points = positions_px.reshape(-1, 2)
    usable = np.flatnonzero(np.isfinite(rays).all(axis=-1) & np.isfinite(points).all(axis=-1))
    usable = usable[:: -(-len(usable) // _MOST_RAYS)] if len(usable) else usable
    if len(usable) < 4:
        return None
    rays = rays[usable]
    u, v, _ = np.linalg.inv(K) @ np.column_stack((points[usable], np.ones(len(usable)))).T
    # (u, v, 1) x H r = 0: two rows a ray, of which h is the vector of the least singular value.
    none = np.zeros_like(rays)
    equations = np.vstack((np.hstack((none, -rays, v[:, None] * rays)), np.hstack((rays, none, -u[:, None] * rays))))
    H = K @ np.linalg.svd(equations, full_matrices=False)[2][-1].reshape(3, 3)
    determinant = np.linalg.det(H)
    if not abs(determinant) > 0:
        return None
    # H is known up to a factor; its determinant is positive as K and R have positive ones.
    K_fit, R = rq(np.sign(determinant) * H)
    signs = np.sign(np.diag(K_fit))
    K_fit, R = K_fit * signs, signs[:, None] * R
    if not K_fit[2, 2] > 0:
        return None
    return PinholeFit(K_fit / K_fit[2, 2], R)
