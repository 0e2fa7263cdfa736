"""Ratios of units of length, by which lengths are wrong that were written in another unit."""

from typing import Final

DECIMAL_RATIOS: Final = (10.0, 100.0, 1000.0, 0.1, 0.01, 0.001)
"""Ratios of decimal units of length that occur."""

_RATIOS: Final = (
    *DECIMAL_RATIOS,
    *(ratio for unit in (0.3048, 0.9144, 1609.344, 1852.0) for ratio in (unit, 1 / unit)),
)
"""The same, with those of foot, yard and miles to the metre."""

_TOLERANCE: Final = 0.02
"""Largest relative difference of a fitted factor from that of a unit: units next to each other differ by more."""


def ratio_of_units(factor: float) -> float | None:
    """Return the ratio of two units of length that a fitted factor states; None where it states none."""
    return next((ratio for ratio in _RATIOS if abs(factor / ratio - 1) <= _TOLERANCE), None)


def is_length_unit(factor: float) -> bool:
    """Whether a factor is the ratio of two units of length, within the error of a fit."""
    return ratio_of_units(factor) is not None
