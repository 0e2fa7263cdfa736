"""Noise of single channels: the part of the fine structure of a channel that the other two do not share.

Texture changes all channels together: colours of a small patch mostly lie on a line in R, G, B (I. Omer, M. Werman,
"Color lines: image specific color representation", CVPR 2004). Read noise and shot noise are independent in each. Of
the covariance C of a fine-scale response, the part of channel k that no linear combination of the others explains has
the variance 1 / (C^-1)_kk.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.samples import WHITE_NOISE_GAIN

Float64 = NDArray[np.float64]

PATCH_PX: Final = 18
"""Side of a patch: 256 responses estimate a variance to 9%, and few patches have several textures."""

_PATCHES: Final = 8
"""Patches along each axis of a frame, at most: their median has an error of about 1%."""


def spread_patches(image: NDArray[Any]) -> NDArray[Any]:
    """Return patches (n, s, s, c) that are spread evenly over an image (h, w, c); none where it is smaller than one."""
    height, width, count = image.shape
    if min(height, width) < PATCH_PX:
        return np.empty((0, PATCH_PX, PATCH_PX, count), image.dtype)
    tops, lefts = (
        np.unique(np.linspace(0, size - PATCH_PX, min(_PATCHES, size // PATCH_PX)).astype(int))
        for size in (height, width)
    )
    return np.array([image[top : top + PATCH_PX, left : left + PATCH_PX] for top in tops for left in lefts])


def channel_noise_variances(patches: Float64) -> Float64:
    """Return an upper bound of the variances of white noise that is independent in each channel of an image.

    The response is the difference of two discrete Laplacians, which is zero for any image that bends along one axis
    only. The variance that its other channels do not explain is estimated in each patch; the median over patches leaves
    out those in which several colours meet.

    Parameters
    ----------
    patches
        (n, s, s, c), of any unit.

    Returns
    -------
    ndarray of float64
        (c,) in the square of that unit; 0 without patches.
    """
    count = patches.shape[-1]
    if not len(patches):
        return np.zeros(count)
    bends = patches
    for axis in (1, 2):  # second differences along both axes: 1, -2, 1 and its transpose
        bends = np.diff(bends, n=2, axis=axis)
    responses = bends.reshape(len(patches), -1, count)
    covariances = np.swapaxes(responses, 1, 2) @ responses / responses.shape[1]
    # Of an image without noise C is singular; rounding of float64 is far below any noise.
    ridge = 1e-12 * (1.0 + np.trace(covariances, axis1=1, axis2=2))
    inverses = np.linalg.inv(covariances + ridge[:, np.newaxis, np.newaxis] * np.eye(count))
    unshared = 1.0 / np.diagonal(inverses, axis1=1, axis2=2)
    return np.asarray(np.median(unshared, axis=0) / WHITE_NOISE_GAIN)
