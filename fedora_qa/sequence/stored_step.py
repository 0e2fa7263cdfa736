"""The step in which the values of a dataset are stored, and the errors that rounding to it makes."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]

SINGLE_ROUNDOFF: Final = 2.0**-24
DOUBLE_ROUNDOFF: Final = 2.0**-53
HALF_ROUNDOFF: Final = 2.0**-11
"""Unit roundoff of float32, float64 and float16: the largest error of rounding, as a share of the value (IEEE 754)."""

_TYPES: Final = {HALF_ROUNDOFF: "float16", SINGLE_ROUNDOFF: "float32", DOUBLE_ROUNDOFF: "float64"}


@dataclass(frozen=True, slots=True)
class StoredStep:
    """The grid of the stored values of a dataset.

    Attributes
    ----------
    size
        Distance of neighbouring values of a grid of equal steps, in the unit of the values; 0 where there is no such
        grid.
    roundoff
        Unit roundoff of the mantissa that the values need, without unit.
    """

    size: float = 0.0
    roundoff: float = DOUBLE_ROUNDOFF

    @property
    def is_coarse(self) -> bool:
        """Whether values are stored in a step, or in float16: coarser than the rounding of float32."""
        return self.size > 0 or self.roundoff > SINGLE_ROUNDOFF

    def error_bounds(self, values: ArrayLike) -> Float64:
        """Return the largest errors of values (...) by rounding, in their unit.

        A value lies on both grids, and was rounded to the coarser one at its size: ``max(size / 2, roundoff |value|)``.
        """
        return np.maximum(self.size / 2, self.roundoff * np.abs(np.asarray(values, dtype=np.float64)))

    def scaled(self, factor: float) -> "StoredStep":
        """Return the step of the values times a factor."""
        return StoredStep(abs(factor) * self.size, self.roundoff)

    def text(self, unit: str) -> str:
        """Return the step in words, as ``1 mm`` or ``float32``."""
        kind = _TYPES.get(self.roundoff, f"{self.roundoff:.2g} of the value")
        return f"{self.size:.6g} {unit}".removesuffix(" 1") if self.size else kind


def coarsest(steps: list[StoredStep]) -> StoredStep:
    """Return the coarser of the steps of several components in either grid; as fine as float64 where there is none."""
    return StoredStep(
        max((step.size for step in steps), default=0.0), max((step.roundoff for step in steps), default=DOUBLE_ROUNDOFF)
    )
