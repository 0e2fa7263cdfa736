"""Units that can stand for each other, so that a stated limit can be compared with a planted size."""

from collections.abc import Mapping
from math import pi
from typing import Final

_DIMENSIONS: Final[tuple[Mapping[str, float], ...]] = (
    {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0},
    {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    {"deg": pi / 180, "rad": 1.0},
    {"deg/s": pi / 180, "rad/s": 1.0},
    {"mm/s^2": 1e-3, "m/s^2": 1.0},
    {"ppm": 1e-6, "percent": 1e-2, "%": 1e-2, "share": 1.0, "1": 1.0},
    {"samples": 1.0, "frames": 1.0},
)
"""Each unit's size, by dimension. Pure numbers are one dimension: a factor of 1.01 is a gain of one percent."""


def factor_between(unit: str, other: str) -> float | None:
    """Return how many of ``other`` one of ``unit`` is; None where they measure different things."""
    if unit == other:
        return 1.0
    for sizes in _DIMENSIONS:
        if unit in sizes and other in sizes:
            return sizes[unit] / sizes[other]
    return None
