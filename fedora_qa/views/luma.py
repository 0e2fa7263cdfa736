"""What several checks want of a window, computed once and only when asked for."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.luma import cut_off, luma_of, luma_of_linear
from fedora_qa.sequence.window import Window

SATURATED_DN: Final = 250.0
"""Luma above this may have been lost to a curve near white."""


_WEIGHTS: Final = np.array(LUMA_WEIGHTS_RGB, dtype=np.float64)


def luma_dn(window: Window, frame: int) -> NDArray[np.float32]:
    """Return the luma of linear R, G, B of a colour frame, (H, W), in DN (0..255).

    A declared transfer curve is undone first: luma is defined on linear values.
    """
    return window.of_image("luma_dn", frame, lambda: _luma_of(window.rgb(frame), window.facts.declared.transfer))


def clipped(window: Window, frame: int) -> NDArray[np.bool_]:
    """Return where a colour frame may be darker than the scene, (H, W): any channel at its end, or luma close to it.

    One channel is enough: a leaf in bright light has a clipped green and a luma of little more than a half.
    """
    return window.of_image("clipped", frame, lambda: cut_off(window.rgb(frame), luma_dn(window, frame), SATURATED_DN))


def _luma_of(rgb: NDArray[np.uint8], transfer: str) -> NDArray[np.float32]:
    if transfer == "linear":
        return luma_of_linear(rgb, _WEIGHTS)
    of_codes = np.outer(LUMA_WEIGHTS_RGB, _linear_dn_table(transfer)).astype(np.float32)
    return luma_of(rgb, of_codes)


def _linear_dn_table(transfer: str) -> NDArray[np.float32]:
    """Return linear DN for each 8-bit code: identity, IEC 61966-2-1 (sRGB), or the power 2.2."""
    code = np.arange(256) / 255.0
    if transfer == "srgb":
        code = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    elif transfer == "gamma2.2":
        code = code**2.2
    return (255.0 * code).astype(np.float32)
