"""Read one attribute of the layout: the value in the type of its kind, or what is wrong with it."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.canonical import AttributeSpec
from fedora_qa.layout.hdf5_objects import stored_attribute

POSITIVE: Final = frozenset({"width", "height", "threshold_on", "threshold_off", "gravity"})
"""Numbers that must exceed zero; every other number of the layout must not be negative, but for the seed."""

_CAUSES_OF_NUMBERS: Final[Mapping[str, tuple[str, str]]] = {
    "width": ("wrong_shape", "metadata"),
    "height": ("wrong_shape", "metadata"),
    "threshold_on": ("threshold_misdeclared", "events"),
    "threshold_off": ("threshold_misdeclared", "events"),
    # The component of the vector that points down.
    "gravity": ("gravity_magnitude", "metadata"),
    "gyro_noise_density": ("noise_misdeclared", "imu"),
    "accel_noise_density": ("noise_misdeclared", "imu"),
    "gyro_bias_walk": ("noise_misdeclared", "imu"),
    "accel_bias_walk": ("noise_misdeclared", "imu"),
    "position_sigma": ("noise_misdeclared", "pose"),
    "rotation_sigma": ("noise_misdeclared", "pose"),
}
"""Cause and stream of a number that nothing can have: what is declared is not what the stream has."""

MOST_PIXELS_ALONG: Final = 1 << 16
"""Largest number of columns or rows of a camera: coordinates of events have 16 bits."""

LARGEST_THRESHOLD: Final = 255.0
"""Largest contrast threshold: the range of 8 bits, DN, and more in nat than any light varies by."""

LEAST_NUMBER: Final = 1e-30
LARGEST_NUMBER: Final = 1e12
"""Range of numbers: beyond it no unit of the layout has a meaning, and squares and nanoseconds overflow float64 and
int64."""

LARGEST_ENTRY: Final = 1e9
WORST_CONDITION: Final = 1e12
"""Largest condition number of a camera's matrix, in px or m. A focal length of 8000 px gives 1e8, a camera at 1 km
gives 1e6. Beyond it the inverse has no correct digit in float64."""

MOST_NUMBERS: Final = 16
"""Most numbers of a list: no model of a lens has more coefficients."""

_OTHER_NAMES_OF_PX: Final = frozenset({"pixel", "pixels"})


class MalformedError(Exception):
    """An attribute is there and cannot be used; ``cause`` is an identifier of ``causes.py``, of a ``stream``."""

    def __init__(self, cause: str, message: str, stream: str = "metadata") -> None:
        super().__init__(message)
        self.cause, self.stream = cause, stream


class ImpossibleError(MalformedError):
    """An attribute is a number that nothing can have."""


def read_attribute(holder: h5py.Group | h5py.Dataset, spec: AttributeSpec) -> Any:
    """Return the value of an attribute in the type of its kind.

    Parameters
    ----------
    holder
        Object that carries the attribute.
    spec
        Name, kind and choices of the attribute.

    Returns
    -------
    Any
        Text is str, numbers are int and float, matrices float64, pixels a tuple of (column, row); None where the
        attribute is absent.

    Raises
    ------
    MalformedError
        Unreadable, of another type or shape, not finite, out of range, or not one of the choices.
    """
    try:
        stored = stored_attribute(holder, spec.name)
    except ValueError as error:
        raise MalformedError("unknown", f"Expected a readable value, got: {error}") from error
    return None if stored is None else READERS[spec.kind](stored, spec)


def unusual_form(holder: h5py.Group | h5py.Dataset, spec: AttributeSpec, value: Any) -> str:
    """Return what is unusual in the form of an attribute that can be read; empty where nothing is.

    Parameters
    ----------
    holder
        Object that carries the attribute.
    spec
        Name, kind and choices of the attribute.
    value
        As ``read_attribute`` returns it.
    """
    stored = stored_attribute(holder, spec.name)
    text = stored.decode("utf-8", "replace") if isinstance(stored, bytes) else stored
    if spec.choices and text != value:
        return f"Expected {value!r}, got {short_repr(stored)}, which is read as that; write it as the layout does"
    if spec.kind == "int" and isinstance(_scalar(stored), float | np.floating):
        return f"Expected a whole number, got {short_repr(stored)}, which is read as {value}; write it as an integer"
    return ""


def _text(stored: Any, spec: AttributeSpec) -> str:
    text = stored.decode("utf-8", "replace") if isinstance(stored, bytes) else stored
    if not isinstance(text, str):
        raise MalformedError("wrong_dtype", f"Expected text, got {short_repr(stored)}")
    # Names in upper case mean the same.
    text = next((choice for choice in spec.choices if choice.lower() == text.strip().lower()), text)
    if text.replace(" ", "").lower() in spec.opposites:
        # Polarity has the only attribute whose values have an opposite.
        message = f"Expected {spec.choices[0]!r}, got {short_repr(text)}, which is the opposite"
        raise MalformedError("polarity_inverted", message, "events")
    if spec.choices and text not in spec.choices and not spec.is_open:
        of_flow = (spec.owner, spec.name) == ("metadata/flow", "unit")
        of_another_unit = of_flow and text.strip().lower() not in _OTHER_NAMES_OF_PX
        cause, stream = ("flow_unit", "flow") if of_another_unit else ("unknown", "metadata")
        raise MalformedError(cause, f"Expected {' or '.join(map(repr, spec.choices))}, got {short_repr(text)}", stream)
    return str(text)


def _int(stored: Any, spec: AttributeSpec) -> int:
    value = _scalar(stored)
    if isinstance(value, float | np.floating) and float(value).is_integer():
        value = int(value)
    # bool is a subclass of int in Python.
    if not isinstance(value, int | np.integer) or isinstance(value, bool | np.bool_):
        raise MalformedError("wrong_dtype", f"Expected a whole number, got {short_repr(stored)}")
    _require_range(int(value), spec)
    return int(value)


def _float(stored: Any, spec: AttributeSpec) -> float:
    value = _scalar(stored)
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        # A vector of gravity has a direction, which a magnitude has not.
        is_vector = spec.name == "gravity" and np.shape(stored) == (3,) and np.asarray(stored).dtype.kind in "iuf"
        cause = "gravity_magnitude" if is_vector else "wrong_dtype"
        raise MalformedError(cause, f"Expected a number, got {short_repr(stored)}")
    if not np.isfinite(value):
        raise ImpossibleError("nan_in_stream", f"Expected a finite number, got {value}")
    _require_range(float(value), spec)
    return float(value)


def _matrix(size: int) -> Callable[[Any, AttributeSpec], NDArray[np.float64]]:
    def read(stored: Any, spec: AttributeSpec) -> NDArray[np.float64]:
        matrix = np.asarray(stored)
        if matrix.dtype.kind not in "iuf":
            raise MalformedError("wrong_dtype", f"Expected a matrix of numbers, got {short_repr(stored)}")
        if matrix.shape != (size, size):
            raise MalformedError("wrong_shape", f"Expected a {size} x {size} matrix, got shape {matrix.shape}")
        if not np.all(np.isfinite(matrix)):
            raise MalformedError("nan_in_stream", "Expected finite entries, got NaN or infinity")
        matrix = matrix.astype(np.float64)
        # ``not cond < limit`` also refuses a condition number that is NaN.
        if np.abs(matrix).max() > LARGEST_ENTRY or not np.linalg.cond(matrix) < WORST_CONDITION:
            cause = "intrinsics_focal" if size == 3 else "unknown"
            raise MalformedError(cause, f"Expected a matrix that can be inverted, got {short_repr(matrix.tolist())}")
        return matrix

    return read


def _numbers(stored: Any, spec: AttributeSpec) -> tuple[float, ...]:
    numbers = np.asarray(stored)
    if numbers.size == 0:
        return ()
    if numbers.dtype.kind not in "iuf":
        raise MalformedError("wrong_dtype", f"Expected a list of numbers, got {short_repr(stored)}")
    # Some writers store a list as a column.
    if numbers.size != max(numbers.shape, default=1) or numbers.size > MOST_NUMBERS:
        raise MalformedError("wrong_shape", f"Expected a list of up to {MOST_NUMBERS}, got shape {numbers.shape}")
    if not np.all(np.isfinite(numbers)) or np.abs(numbers).max() > LARGEST_ENTRY:
        raise MalformedError(
            "nan_in_stream", f"Expected finite numbers up to {LARGEST_ENTRY:g}, got {short_repr(stored)}"
        )
    return tuple(numbers.astype(np.float64).reshape(-1).tolist())


def _pixels(stored: Any, spec: AttributeSpec) -> tuple[tuple[int, int], ...]:
    pixels = np.asarray(stored)
    # An empty list is stored as float64 by NumPy, and no hot pixel is a valid declaration.
    if pixels.size == 0:
        return ()
    if pixels.dtype.kind not in "iu":
        raise MalformedError("wrong_dtype", f"Expected whole columns and rows, got {short_repr(stored)}")
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise MalformedError("wrong_shape", f"Expected (n, 2) columns and rows, got shape {pixels.shape}")
    return tuple((int(column), int(row)) for column, row in pixels)


def _scalar(stored: Any) -> Any:
    """Unwrap an array of one number, which MATLAB and others write for a scalar."""
    array = np.asarray(stored)
    return array.reshape(-1)[0] if array.size == 1 else stored


def _require_range(value: float, spec: AttributeSpec) -> None:
    cause, stream = _CAUSES_OF_NUMBERS.get(spec.name, ("unknown", "metadata"))
    if spec.name in POSITIVE and value <= 0:
        raise ImpossibleError(cause, f"Expected a positive number, got {value}", stream)
    if value < 0 and spec.name != "seed":
        raise ImpossibleError(cause, f"Expected a number not below 0, got {value}", stream)
    if spec.name != "seed" and (value > LARGEST_NUMBER or 0 < value < LEAST_NUMBER):
        raise MalformedError("unknown", f"Expected 0 or {LEAST_NUMBER:g} to {LARGEST_NUMBER:g}, got {value:g}")
    if spec.name in {"threshold_on", "threshold_off"} and value > LARGEST_THRESHOLD:
        reached = f"at most {LARGEST_THRESHOLD:g}, as no change of light reaches more"
        raise ImpossibleError(cause, f"Expected {reached}, got {value:g}", stream)
    if spec.name in {"width", "height"} and value > MOST_PIXELS_ALONG:
        raise MalformedError("wrong_shape", f"Expected at most {MOST_PIXELS_ALONG} px, got {value}")


def short_repr(stored: Any) -> str:
    """Return type and value for a message, of a long value the beginning."""
    return f"{type(stored).__name__} {str(stored)[:40]!r}"


READERS: Final[Mapping[str, Callable[[Any, AttributeSpec], Any]]] = {
    "text": _text,
    "int": _int,
    "float": _float,
    "matrix3": _matrix(3),
    "matrix4": _matrix(4),
    "pixels": _pixels,
    "numbers": _numbers,
}
"""How a value of each kind is read; raises ``MalformedError``."""
