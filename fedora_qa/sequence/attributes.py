"""Read one attribute of a file as a typed value, or say why it cannot be used."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import AttributeSpec
from fedora_qa.layout.stored_attribute import stored_attribute

POSITIVE: Final = frozenset({"width", "height", "threshold_on", "threshold_off", "gravity"})
"""Numbers that must exceed zero; every other number of the layout must not be negative, but for the seed."""


MOST_PIXELS_ALONG: Final = 1 << 16
"""Of a camera's columns or rows: events count theirs in 16 bits."""


LEAST_NUMBER: Final = 1e-30
LARGEST_NUMBER: Final = 1e12
"""Beyond these no unit of the layout has a meaning, and squares and nanoseconds leave float64 and int64."""

LARGEST_ENTRY: Final = 1e9
WORST_CONDITION: Final = 1e12
"""Of a matrix of a camera, in px or m. A focal length of 8000 px comes to 1e8, a camera a kilometre off to 1e6; beyond,
nothing is left of a float64 that goes through the matrix and back."""


class MalformedError(Exception):
    """An attribute is there and cannot be used; ``cause`` is an identifier of ``causes.py``."""

    def __init__(self, cause: str, message: str) -> None:
        super().__init__(message)
        self.cause = cause


def read_attribute(holder: h5py.Group | h5py.Dataset, spec: AttributeSpec) -> Any:
    """Return the value of an attribute in the type of its kind, or None where it is absent.

    Text is str, numbers are int and float, matrices float64, pixels a tuple of (column, row).

    Raises
    ------
    MalformedError
        Unreadable, of another type or shape, not finite, out of range, or not one of the choices.
    """
    try:
        stored = stored_attribute(holder, spec.name)
    except ValueError as error:
        raise MalformedError("unknown", f"Expected a readable value, got: {error}") from error
    return None if stored is None else _READERS[spec.kind](stored, spec)


def _text(stored: Any, spec: AttributeSpec) -> str:
    text = stored.decode("utf-8", "replace") if isinstance(stored, bytes) else stored
    if not isinstance(text, str):
        raise MalformedError("wrong_dtype", f"Expected text, got {_shown(stored)}")
    if spec.choices and text not in spec.choices:
        raise MalformedError("unknown", f"Expected {' or '.join(map(repr, spec.choices))}, got {_shown(text)}")
    return str(text)


def _int(stored: Any, spec: AttributeSpec) -> int:
    value = _scalar(stored)
    # bool is a subclass of int in Python.
    if not isinstance(value, int | np.integer) or isinstance(value, bool | np.bool_):
        raise MalformedError("wrong_dtype", f"Expected a whole number, got {_shown(stored)}")
    _require_range(int(value), spec)
    return int(value)


def _float(stored: Any, spec: AttributeSpec) -> float:
    value = _scalar(stored)
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        raise MalformedError("wrong_dtype", f"Expected a number, got {_shown(stored)}")
    if not np.isfinite(value):
        raise MalformedError("nan_in_stream", f"Expected a finite number, got {value}")
    _require_range(float(value), spec)
    return float(value)


def _matrix(size: int) -> Callable[[Any, AttributeSpec], NDArray[np.float64]]:
    def read(stored: Any, spec: AttributeSpec) -> NDArray[np.float64]:
        matrix = np.asarray(stored)
        if matrix.dtype.kind not in "iuf":
            raise MalformedError("wrong_dtype", f"Expected a matrix of numbers, got {_shown(stored)}")
        if matrix.shape != (size, size):
            raise MalformedError("wrong_shape", f"Expected a {size} x {size} matrix, got shape {matrix.shape}")
        if not np.all(np.isfinite(matrix)):
            raise MalformedError("nan_in_stream", "Expected finite entries, got NaN or infinity")
        matrix = matrix.astype(np.float64)
        # ``not cond < limit`` also refuses a condition number that is NaN.
        if np.abs(matrix).max() > LARGEST_ENTRY or not np.linalg.cond(matrix) < WORST_CONDITION:
            cause = "intrinsics_focal" if size == 3 else "unknown"
            raise MalformedError(cause, f"Expected a matrix that can be inverted, got {_shown(matrix.tolist())}")
        return matrix

    return read


def _pixels(stored: Any, spec: AttributeSpec) -> tuple[tuple[int, int], ...]:
    pixels = np.asarray(stored)
    # An empty list is stored as float64 by NumPy, and no hot pixel is a valid declaration.
    if pixels.size == 0:
        return ()
    if pixels.dtype.kind not in "iu":
        raise MalformedError("wrong_dtype", f"Expected whole columns and rows, got {_shown(stored)}")
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise MalformedError("wrong_shape", f"Expected (n, 2) columns and rows, got shape {pixels.shape}")
    return tuple((int(column), int(row)) for column, row in pixels)


def _scalar(stored: Any) -> Any:
    """Unwrap an array of one number, which MATLAB and others write for a scalar."""
    array = np.asarray(stored)
    return array.reshape(-1)[0] if array.size == 1 else stored


def _require_range(value: float, spec: AttributeSpec) -> None:
    if spec.name in POSITIVE and value <= 0:
        raise MalformedError("unknown", f"Expected a positive number, got {value}")
    if value < 0 and spec.name != "seed":
        raise MalformedError("unknown", f"Expected a number not below 0, got {value}")
    if spec.name != "seed" and (value > LARGEST_NUMBER or 0 < value < LEAST_NUMBER):
        raise MalformedError("unknown", f"Expected 0 or {LEAST_NUMBER:g} to {LARGEST_NUMBER:g}, got {value:g}")
    if spec.name in {"width", "height"} and value > MOST_PIXELS_ALONG:
        raise MalformedError("wrong_shape", f"Expected at most {MOST_PIXELS_ALONG} px, got {value}")


def _shown(stored: Any) -> str:
    return f"{type(stored).__name__} {str(stored)[:40]!r}"


_READERS: Final[Mapping[str, Callable[[Any, AttributeSpec], Any]]] = {
    "text": _text,
    "int": _int,
    "float": _float,
    "matrix3": _matrix(3),
    "matrix4": _matrix(4),
    "pixels": _pixels,
}
