"""Transfer curves: the linear value of a stored code."""

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
    """Return the linear values of codes.

    The curve is the identity, that of IEC 61966-2-1 (sRGB), or code^2.2 with white fixed.

    Parameters
    ----------
    codes
        Of any shape, 0 to 255; values beyond are clipped.
    transfer
        One of ``TRANSFERS``.

    Returns
    -------
    ndarray of float64
        DN, 0 to 255.

    Raises
    ------
    ValueError
        The transfer is unknown.
    """
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
    """Return the codes of linear values, not rounded: the inverse of `to_linear`.

    Parameters
    ----------
    linear_dn
        Of any shape, DN, 0 to 255; values beyond are clipped.
    transfer
        One of ``TRANSFERS``.

    Returns
    -------
    ndarray of float64
        Codes, 0 to 255.

    Raises
    ------
    ValueError
        The transfer is unknown.
    """
    value = np.clip(np.asarray(linear_dn, dtype=np.float64) / WHITE_DN, 0.0, 1.0)
    if transfer == "srgb":
        # Inverse of the curve of IEC 61966-2-1 in `to_linear`.
        value = np.where(value <= _SRGB_TOE / 12.92, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    elif transfer == "gamma2.2":
        value = value ** (1 / _GAMMA)
    elif transfer != "linear":
        raise ValueError(f"Expected a transfer of {', '.join(TRANSFERS)}, got {transfer!r}")
    return WHITE_DN * value
