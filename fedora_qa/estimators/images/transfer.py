"""Transfer curves: what linear value a stored code stands for."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

TRANSFERS: Final = ("linear", "srgb", "gamma2.2")
"""The curves that a file can declare."""

WHITE_DN: Final = 255.0

_GAMMA: Final = 2.2
_SRGB_TOE: Final = 0.04045


def to_linear(codes: Float64, transfer: str) -> Float64:
    """Return linear values, in DN, of codes in 0..255: as they are, by IEC 61966-2-1 (sRGB), or code^2.2."""
    code = np.clip(np.asarray(codes, dtype=np.float64) / WHITE_DN, 0.0, 1.0)
    if transfer == "srgb":
        # IEC 61966-2-1: a linear toe up to 0.04045, then a power of 2.4 with an offset.
        code = np.where(code <= _SRGB_TOE, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    elif transfer == "gamma2.2":
        code = code**_GAMMA
    elif transfer != "linear":
        raise ValueError(f"Expected a transfer of {', '.join(TRANSFERS)}, got {transfer!r}")
    return WHITE_DN * code


def to_code(linear_dn: Float64, transfer: str) -> Float64:
    """Return the codes, 0..255 and not rounded, of linear values in DN: the inverse of `to_linear`."""
    value = np.clip(np.asarray(linear_dn, dtype=np.float64) / WHITE_DN, 0.0, 1.0)
    if transfer == "srgb":
        value = np.where(value <= _SRGB_TOE / 12.92, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    elif transfer == "gamma2.2":
        value = value ** (1 / _GAMMA)
    elif transfer != "linear":
        raise ValueError(f"Expected a transfer of {', '.join(TRANSFERS)}, got {transfer!r}")
    return WHITE_DN * value
