"""Colour frames of a window: luma, and which frames are so large that a part of their pixels is enough.

A fault of a whole field affects all of its pixels. In frames that are larger than usual, checks of such faults use a
part of the pixels, spread over the whole image, unless the effort asks for all.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.warp import smooth
from fedora_qa.estimators.images.luma import LUMA_WEIGHTS, cut_off, luma_of, luma_of_linear, luma_table, to_linear
from fedora_qa.sequence.window import USUAL_PIXELS, Window

Bools = NDArray[np.bool_]

SATURATED_DN: Final = 250.0
"""Luma above this, DN, may have been clipped by a transfer curve near white."""

_GOLDEN: Final = (5**0.5 - 1) / 2
"""The fractional parts of its multiples are spread evenly, for any number of successive multiples (H. Weyl, 1916)."""

_BANDS: Final = 2
"""Bands of rows that are used in either half of an image."""


def luma_dn(window: Window, frame: int) -> NDArray[np.float32]:
    """Return the luma of linear R, G, B of a colour frame.

    A declared transfer curve is inverted first: luma is defined on linear values.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the colour frame.

    Returns
    -------
    ndarray of float32
        (H, W) DN, 0 to 255.
    """
    return window.derived_image(_luma_dn, frame)


def _luma_dn(window: Window, frame: int) -> NDArray[np.float32]:
    transfer = window.facts.declared.transfer
    if transfer == "linear":
        return luma_of_linear(window.rgb(frame), LUMA_WEIGHTS)
    # Linear values are rounded to single precision before they are weighted; views/warped_frames.py rounds after the
    # weighting only.
    return luma_of(window.rgb(frame), luma_table(to_linear(np.arange(256.0), transfer).astype(np.float32)))


def smoothed_luma_dn(window: Window, frame: int, sigma_px: float) -> NDArray[np.float32]:
    """Return the smoothed luma of a colour frame, from which ``read_between`` reads.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the colour frame.
    sigma_px
        Standard deviation of Gaussian and B-spline together, px.

    Returns
    -------
    ndarray of float32
        (H, W) DN.
    """
    return window.derived_image(_smoothed_luma_dn, frame, sigma_px)


def _smoothed_luma_dn(window: Window, frame: int, sigma_px: float) -> NDArray[np.float32]:
    return smooth(luma_dn(window, frame), sigma_px)


def clipped(window: Window, frame: int) -> NDArray[np.bool_]:
    """Return where a colour frame may be darker than the scene: any channel is at its end, or luma exceeds 250 DN.

    One channel is enough: a leaf in bright light has a clipped green and a luma of little more than 128 DN.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the colour frame.

    Returns
    -------
    ndarray of bool
        (H, W).
    """
    return window.derived_image(_clipped, frame)


def _clipped(window: Window, frame: int) -> NDArray[np.bool_]:
    return cut_off(window.rgb(frame), luma_dn(window, frame), SATURATED_DN)


def is_large(pixels: int, window: Window) -> bool:
    """Whether a part of the pixels of a frame is enough in a window.

    Parameters
    ----------
    pixels
        Number of pixels of the frame.
    window
        Its sampling may ask for all pixels.
    """
    return pixels > USUAL_PIXELS and window.sampling.tile_share < 1


def turn_of(number: int) -> float:
    """Return a number from 0 to 1 for the number of a field or frame; successive ones are spread evenly."""
    return number * _GOLDEN % 1.0


def bands(height: int, share: float, number: int) -> Bools:
    """Return which rows of a field are used.

    The selection is symmetric about the middle row. Its bands move from field to field, so that all rows are used in
    turn.

    Parameters
    ----------
    height
        Number of rows of the field.
    share
        Share of the rows that are used, 0 to 1.
    number
        Number of the field.

    Returns
    -------
    ndarray of bool
        (height,) True for the rows that are used.
    """
    # Distance from the middle row over half the height, 0 to 1: equal for a row and its mirror image.
    from_middle = np.abs(2 * np.arange(height) - (height - 1)) / height
    return np.asarray((_BANDS * from_middle + turn_of(number)) % 1.0 < share)


def near(rows: Bools, reach: int) -> Bools:
    """Return the rows that lie no farther than ``reach`` from a row that is used.

    Parameters
    ----------
    rows
        (height,) True for the rows that are used.
    reach
        Number of rows.

    Returns
    -------
    ndarray of bool
        (height,) True for the near rows.
    """
    counts = np.cumsum(np.pad(rows, (reach + 1, reach)))
    return np.asarray(counts[2 * reach + 1 :] > counts[: -2 * reach - 1])
