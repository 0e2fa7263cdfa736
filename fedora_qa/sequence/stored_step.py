"""The step in which the values of a dataset are stored, and the errors that rounding to it makes."""

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]

SINGLE_ROUNDOFF: Final = 2.0**-24
DOUBLE_ROUNDOFF: Final = 2.0**-53
HALF_ROUNDOFF: Final = 2.0**-11
"""Unit roundoff of float32, float64 and float16: the largest error of rounding, as a share of the value (IEEE 754)."""

_ALIKE: Final = 0.99
"""Least ratio of two steps that are taken for one: a step that is not known beforehand is estimated to 0.1%."""

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
    inverse
        Distance of neighbouring inverse values of a grid of equal steps of these (a disparity, a z-buffer), in one over
        the unit of the values; 0 where there is no such grid.
    typical
        Median absolute value of the values, in their unit; 0 where it is not known.
    components
        Grids of the components of vectors, of which this is the coarsest; empty where all are alike.
    is_identifiable
        Whether the values are enough, and different enough, to show a grid. Otherwise no grid is known.
    """

    size: float = 0.0
    roundoff: float = DOUBLE_ROUNDOFF
    inverse: float = 0.0
    typical: float = field(default=0.0, compare=False)
    components: tuple["StoredStep", ...] = ()
    is_identifiable: bool = field(default=True, compare=False)

    @property
    def is_coarse(self) -> bool:
        """Whether values are stored in a step, or in float16: coarser than the rounding of float32."""
        return self.size > 0 or self.inverse > 0 or self.roundoff > SINGLE_ROUNDOFF

    def component(self, index: int) -> "StoredStep":
        """Return the grid of a component of vectors."""
        return self.components[index] if self.components else self

    def error_bounds(self, values: ArrayLike) -> Float64:
        """Return the largest errors of values (...) by rounding, in their unit.

        A value lies on all grids, and was rounded to the coarsest one at its size: ``max(size / 2, roundoff |value|,
        inverse / 2 value^2)``, where ``d(1/v) = -dv / v^2``.
        """
        sizes = np.abs(np.asarray(values, dtype=np.float64))
        of_inverse = self.inverse / 2 * np.square(sizes)
        bounds: Float64 = np.maximum(np.maximum(self.size / 2, self.roundoff * sizes), of_inverse)
        return bounds

    def scaled(self, factor: float) -> "StoredStep":
        """Return the step of the values times a factor."""
        components = tuple(component.scaled(factor) for component in self.components)
        inverse, typical = self.inverse / abs(factor), abs(factor) * self.typical
        return StoredStep(abs(factor) * self.size, self.roundoff, inverse, typical, components, self.is_identifiable)

    def text(self, unit: str) -> str:
        """Return the step in words, as ``1 mm`` or ``float32``."""
        kind = _TYPES.get(self.roundoff, f"{self.roundoff:.2g} of the value")
        if self.components:
            return ", ".join(component.text(unit) for component in self.components)
        if self.inverse:
            return f"{self.inverse:.6g} / {unit}"
        return f"{self.size:.6g} {unit}".removesuffix(" 1") if self.size else kind


def coarsest(steps: list[StoredStep]) -> StoredStep:
    """Return the coarser of the steps of several components in either grid; as fine as float64 where there is none."""
    return StoredStep(
        max((step.size for step in steps), default=0.0),
        max((step.roundoff for step in steps), default=DOUBLE_ROUNDOFF),
        typical=max((step.typical for step in steps), default=0.0),
        is_identifiable=any(step.is_identifiable for step in steps),
    )


def of_components(steps: list[StoredStep]) -> StoredStep:
    """Return the step of vectors whose components have these steps; steps that differ by less than 1% are one."""
    common = coarsest(steps)
    alike = all(step.roundoff == common.roundoff and step.size >= _ALIKE * common.size for step in steps)
    return common if alike else replace(common, components=tuple(steps))
