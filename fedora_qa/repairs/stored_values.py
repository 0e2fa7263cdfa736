"""From canonical values back to stored ones: the inverse of ``layout.binding``, which refuses what it cannot invert."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US, POLARITY_BRIGHTER, POLARITY_DARKER
from fedora_qa.errors import NotRepairableError
from fedora_qa.layout.binding import POLARITY_CODES, Binding, canonical_values, selected_columns, timestamps_ns
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.conversions import MAP_DEFINITIONS

_RESOLUTION_NS: Final = NS_PER_US // 2
"""Rounding error of a timestamp that the format has itself: half of its microsecond."""


_EXACT_NS: Final = 1 << 53
"""Whole numbers below it are exact in float64."""


def replace_values(stored: NDArray[Any], binding: Binding, canonical: NDArray[Any], origin_ns: int) -> None:
    """Put canonical values into stored rows. Values that are already those keep their bits.

    Parameters
    ----------
    stored
        (n, ...) rows as stored, with all columns; altered in place.
    binding
        Which columns they are, and how they are converted.
    canonical
        (n, ...) what is to be read from them; timestamps as ns from ``origin_ns``.
    origin_ns
        On the clock of the file, ns.

    Raises
    ------
    NotRepairableError
        The stored type cannot hold the values: out of range, NaN as an integer, or rounded more than is allowed.
        Timestamps may be rounded to the microsecond of the format, floating-point values to their stored type.
    """
    current = selected_columns(stored, binding)
    same = _equal(canonical_values(current, binding, origin_ns), canonical)
    if np.all(same):
        return
    # Rows that were the same may hold what the conversion refuses, such as a damaged timestamp. A value that is
    # converted anyway takes their place.
    changed = canonical[~same]
    converted = current.copy()
    converted[~same] = _converted(changed, binding, origin_ns)
    if binding.columns is None:
        stored[...] = converted
    elif len(spec_of(binding.key).shape) == 1:
        stored[:, binding.columns[0]] = converted
    elif stored.ndim < len(spec_of(binding.key).shape):
        stored[...] = converted[..., 0]  # a grey image: one channel, read three times
    else:
        stored[..., list(binding.columns)] = converted
    # The proof of the inverse is that what is read is what was to be read.
    read = canonical_values(selected_columns(stored, binding), binding, origin_ns)[~same]
    if not np.all(_near(read, changed, binding)):
        raise _refused(binding, "more rounding than the repaired values allow, or columns that share one stored value")


def _converted(values: NDArray[Any], binding: Binding, origin_ns: int) -> NDArray[Any]:
    """Return canonical values (m,) in the stored unit and type."""
    dtype = binding.dtype
    # The definition of a map states the meaning of its entries and does not convert them.
    if binding.conversion is not None and binding.conversion.name not in MAP_DEFINITIONS:
        raise _refused(binding, "values that its dialect does not convert")
    if binding.ns_per_unit is not None:
        unit, origin = binding.ns_per_unit, origin_ns - binding.offset_ns
        if dtype.kind == "f":
            # Up to 2^53 ns one division is rounded once. Beyond, the fraction of a unit is rounded, finer than the
            # sum. Far from zero the rounding of the origin, which ``timestamps_ns`` subtracts, must cancel.
            total_ns = values + origin
            whole, rest_ns = np.divmod(total_ns, unit)
            is_exact = np.abs(total_ns) < _EXACT_NS
            nearest = np.where(is_exact, total_ns / unit, whole + rest_ns / unit).astype(dtype)
            anchored = np.asarray(origin / unit + values / unit).astype(dtype)
            return np.where(timestamps_ns(nearest, binding, origin_ns) == values, nearest, anchored)
        # t = units * unit + rest: the fraction of a unit alone is rounded, halves upwards, so that one offset moves all
        # timestamps by one number of units.
        units, rest = divmod(origin, unit)
        return _whole(units + (values + rest + unit // 2) // unit, binding)
    if binding.key == "path/events/p":
        brighter, darker = POLARITY_CODES[binding.polarity]
        if not np.all((values == POLARITY_BRIGHTER) | (values == POLARITY_DARKER)):
            raise _refused(binding, "polarities that the dialect does not define")
        return _whole(np.where(values == POLARITY_BRIGHTER, brighter, darker), binding)
    if np.dtype(spec_of(binding.key).dtype).kind in "iu":
        return _whole(values, binding)
    numbers = values.astype(np.float64) / binding.scale
    if dtype.kind == "f":
        with np.errstate(over="ignore"):  # what the type cannot hold becomes infinite, and is not read as wanted
            return numbers.astype(dtype)
    if not np.all(np.isfinite(numbers)):
        raise _refused(binding, "NaN or infinity")
    return _whole(np.rint(numbers), binding)


def _whole(values: NDArray[Any], binding: Binding) -> NDArray[Any]:
    if binding.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(binding.dtype)
    limits = (0, 1) if binding.dtype.kind == "b" else (np.iinfo(binding.dtype).min, np.iinfo(binding.dtype).max)
    lowest, highest = values.min(), values.max()
    if lowest < limits[0] or highest > limits[1]:
        raise _refused(binding, f"numbers from {lowest} to {highest}")
    return values.astype(binding.dtype)


def _near(read: NDArray[Any], wanted: NDArray[Any], binding: Binding) -> NDArray[np.bool_]:
    """Return which values (m,) are read as wanted, but for the rounding that is allowed."""
    equal = _equal(read, wanted)
    canonical = np.dtype(spec_of(binding.key).dtype)
    if binding.ns_per_unit is not None:
        return np.asarray(equal | (np.abs(read - wanted) <= _RESOLUTION_NS))
    if canonical.kind != "f":
        return equal
    coarser = max(
        (np.finfo(d) for d in (canonical, binding.dtype) if d.kind == "f"), key=lambda about: float(about.eps)
    )
    with np.errstate(invalid="ignore"):  # inf - inf; equal ones are near already
        # Two roundings of half a step each: to the stored type, and of the product with the scale.
        allowed = float(coarser.eps) * np.abs(wanted) + float(coarser.smallest_subnormal) * abs(binding.scale)
        return np.asarray(equal | (np.abs(read - wanted) <= allowed))


def _equal(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = np.equal(first, second)
    # NaN does not equal itself.
    return equal | np.asarray(np.isnan(first) & np.isnan(second)) if first.dtype.kind == "f" else equal


def _refused(binding: Binding, values: str) -> NotRepairableError:
    return NotRepairableError(f"Expected {binding.path} to hold the repaired values, got {binding.dtype} for {values}")
