"""Residual flow of image tiles: how far, in pixels, a frame warped back by a flow still lies from the frame before it.

Least squares on ``W - A = g . d + a + b (A + W)/2``, g being the gradient of (A + W)/2 and d the flow's error (stored
minus true); a and b absorb changes of exposure and vignetting. B. D. Lucas, T. Kanade, IJCAI (1981) 674; the symmetric
gradient after S. Birchfield (1997), whose noise is uncorrelated with the difference, so that noise does not bias d = 0.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.residual_kernels import solved, sums_of_tiles

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

TILE_PX: Final = 32
HALO_PX: Final = 2
"""The derivative's reach."""

_CORRELATED_PIXELS: Final = 4 * np.pi
"""Sum of the autocorrelation of white noise seen through a kernel of variance 1 px^2: so many pixels count as one."""


@dataclass(frozen=True, slots=True)
class TileResiduals:
    """Estimates for n tiles.

    Attributes
    ----------
    flow_errors_px
        (n, 2) stored minus true flow.
    noise_covariances_px2
        (n, 2, 2) under the noise floor: an upper bound, see `tile_residuals`. The gate for texture.
    covariances_px2
        (n, 2, 2) from what the fit leaves, where that is more than the noise floor: unresolved detail, mostly.
    mismatch, unexplained
        (n,) squared difference of the frames, before and after the fit, over that of the image about its mean: about 0
        for frames that match, 1 and more for frames that have nothing in common.
    valid_share
        (n,) share of the tile's pixels that were used.
    """

    flow_errors_px: Float64
    noise_covariances_px2: Float64
    covariances_px2: Float64
    mismatch: Float64
    unexplained: Float64
    valid_share: Float64


def tile_residuals(
    before: Float32, warped: Float32, valid: NDArray[np.bool_], noise_variance_dn2: float
) -> TileResiduals:
    """Estimate the flow's error in each tile.

    Parameters
    ----------
    before, warped
        (n, 36, 36) patches of A and W, smoothed by a kernel of variance 1 px^2: a tile of 32 px and a halo of 2.
    valid
        (n, 32, 32) pixels to use.
    noise_variance_dn2
        Variance of white noise of a pixel of either frame before smoothing. Smoothing correlates the noise, but nowhere
        makes its spectral density larger, so ``2 variance (G^T G)^-1`` bounds the covariance.
    """
    sums = sums_of_tiles(before, warped, valid, HALO_PX)
    contrast, floor = np.maximum(sums[:, 3, 3], 1e-9), 2 * noise_variance_dn2
    errors_px, inverse, left, variances_dn2 = solved(sums, floor, _CORRELATED_PIXELS)
    return TileResiduals(
        flow_errors_px=errors_px,
        noise_covariances_px2=np.asarray(floor * inverse, dtype=np.float64),
        covariances_px2=variances_dn2[:, None, None] * inverse,
        mismatch=sums[:, 4, 4] / contrast,
        unexplained=left / contrast,
        valid_share=sums[:, 2, 2] / TILE_PX**2,
    )
