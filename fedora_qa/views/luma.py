"""Luma of the colour frames of a window, computed once and only when asked for."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.luma import LUMA_WEIGHTS, cut_off, luma_of, luma_of_linear, luma_table
from fedora_qa.estimators.images.transfer import to_linear
from fedora_qa.sequence.window import Window

SATURATED_DN: Final = 250.0
"""Luma above this, DN, may have been clipped by a transfer curve near white."""


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
