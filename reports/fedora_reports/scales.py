"""Axes and their ticks. Positions are shares of the drawing's width or height, 0 to 1."""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.wording import number

_LEAST_SPAN: Final = 1e-300
"""An axis shorter than this has ticks at its ends only: a fifth of it may round to zero."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A labelled position on an axis."""

    share: float
    label: str


@dataclass(frozen=True, slots=True)
class Axis:
    """A scale from ``low`` to ``high`` in one unit, linear or logarithmic (then both are positive)."""

    low: float
    high: float
    logarithmic: bool = False

    def shares(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return the positions of values, 0 at ``low`` and 1 at ``high``, clipped; NaN stays NaN."""
        placed = self._place(np.asarray(values, dtype=np.float64))
        low, high = self._place(np.array([self.low, self.high])) / 2
        span = high - low  # of halves, because the difference of the largest floats overflows
        if not span > 0:
            return np.where(np.isnan(placed), np.nan, 0.5)
        return np.asarray((np.clip(placed / 2, low, high) - low) / span)

    def share(self, value: float) -> float:
        """Return the position of one finite value."""
        return float(self.shares(np.array([value]))[0])

    def ticks(self, wanted: int = 5) -> tuple[Tick, ...]:
        """Return about ``wanted`` ticks at round numbers, in order."""
        low, high = self.low, self.high
        span = high - low
        values: tuple[float, ...]
        if self.logarithmic:
            values = _log_values(low, high, wanted)
        elif not math.isfinite(span) or span <= max(1e-12 * max(abs(low), abs(high)), _LEAST_SPAN):
            values = (low, high) if high > low else (low,)
        else:
            # Multiples of 1, 2 or 5 times a power of ten; the step is the nearest in proportion.
            rough = span / wanted
            power = 10.0 ** math.floor(math.log10(rough))
            step = min((power, 2 * power, 5 * power, 10 * power), key=lambda step: abs(math.log(step / rough)))
            first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
            values = tuple(k * step for k in range(first, last + 1)) or (low, high)
        # As many decimals as distinguish neighbours; very large and very small values with an exponent.
        largest = max(abs(value) for value in values)
        if largest >= 1e6 or largest < 1e-3:
            labels = [number(value) for value in values]
        else:
            labels = [f"{round(value, 6) + 0.0:.6f}".rstrip("0").rstrip(".") for value in values]
        return tuple(Tick(self.share(value), label) for value, label in zip(values, labels, strict=True))

    def _place(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        if not self.logarithmic:
            return values
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(values))


def _log_values(low: float, high: float, wanted: int) -> tuple[float, ...]:
    """Return the powers of ten on the axis, with factors between where few powers lie on it."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for factors in ((1, 2, 3, 5, 7), (1, 2, 5), (1, 3), (1,)):
        values = [factor * 10.0**decade for decade in decades for factor in factors]
        inside = [value for value in values if low * (1 - 1e-9) <= value <= high * (1 + 1e-9)]
        if len(inside) <= wanted + 1:
            return tuple(inside) if len(inside) > 1 else (low, high)
    return tuple(inside[:: math.ceil(len(inside) / wanted)])
