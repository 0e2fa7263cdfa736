"""Pictures made smaller by averaging or summing whole blocks of pixels, so that their values keep their unit."""

from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.evidence.picture_kernels import code_means, events_of_blocks, finite_means

Float32 = NDArray[np.float32]
UInt8 = NDArray[np.uint8]
UInt16 = NDArray[np.uint16]

_MOST_EVENTS: Final = np.iinfo(np.uint16).max


def block_px(width: int, picture_width_px: int) -> int:
    """Return the side of the least blocks that make an image no wider than a picture may be."""
    return max(1, -(-width // picture_width_px))


def picture_shape(height: int, width: int, block: int) -> tuple[int, int]:
    """Return rows and columns of a picture; pixels that fill no whole block are left out."""
    return max(height // block, 1), max(width // block, 1)


def mean_codes(image: UInt8, block: int) -> UInt8:
    """Return the mean of each block of an image of 8-bit codes (H, W, C), rounded to codes."""
    rows, columns = picture_shape(image.shape[0], image.shape[1], block)
    height, width = _side(image.shape[0], block), _side(image.shape[1], block)
    return code_means(_as_decoded(np.ascontiguousarray(image)), rows, columns, height, width)


def mean_values(image: NDArray[Any], block: int) -> Float32:
    """Return the mean of the finite values of each block of an image (H, W) or (H, W, C); NaN where there are none."""
    rows, columns = picture_shape(image.shape[0], image.shape[1], block)
    height, width = _side(image.shape[0], block), _side(image.shape[1], block)
    values = _as_decoded(np.ascontiguousarray(image, dtype=np.float32).reshape(*image.shape[:2], -1))
    means = finite_means(values, rows, columns, height, width)
    return means.reshape(rows, columns, *image.shape[2:])


def _as_decoded(values: NDArray[Any]) -> NDArray[Any]:
    """Return an image that cannot be written to, as decoded ones: kernels are compiled once."""
    view = values.view()
    view.flags.writeable = False
    return view


def events_of_pixels(x: NDArray[Any], y: NDArray[Any], p: NDArray[Any], size: tuple[int, int], block: int) -> UInt16:
    """Return how many events (n,) of each polarity lie in each block of a sensor's pixels, (2, h, w), at most 65535.

    ``size`` is its height and width: ``summed_counts`` of the events of each pixel.
    """
    counts = np.zeros((2, *picture_shape(*size, block)), np.uint16)
    events_of_blocks(_as_decoded(x), _as_decoded(y), _as_decoded(p), size, block, _MOST_EVENTS, counts)
    return counts


def summed_counts(counts: NDArray[np.integer[Any]], block: int) -> UInt16:
    """Return the sum of each block of counts (..., H, W), at most 65535."""
    *before, height, width = counts.shape
    rows, columns = picture_shape(height, width, block)
    high, wide = _side(height, block), _side(width, block)
    whole = counts[..., : rows * high, : columns * wide].reshape(*before, rows, high, columns, wide)
    totals = whole.sum(axis=(-3, -1), dtype=np.int64)
    return cast(UInt16, np.minimum(totals, _MOST_EVENTS).astype(np.uint16))


def _side(size: int, block: int) -> int:
    return min(size, block)
