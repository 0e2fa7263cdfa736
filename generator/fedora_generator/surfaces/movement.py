"""Movement of a box along straight lines and sines, in closed form. A box never turns, so its light stays constant."""

import math
from dataclasses import dataclass
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

Floats = NDArray[np.float64]
Axis = Literal["x", "y", "z"]

AXES: Final[tuple[Axis, ...]] = ("x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """``amplitude_m * sin(2 pi frequency_hz t + phase_deg)`` along one axis of the world."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    axis: Axis
    amplitude_m: float
    frequency_hz: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise ValueError(f"Expected axis to be one of {', '.join(AXES)}, got {self.axis!r}")
        if not all(map(math.isfinite, (self.amplitude_m, self.frequency_hz, self.phase_deg))):
            raise ValueError(f"Expected a finite amplitude_m, frequency_hz and phase_deg, got {self}")

    def along_m(self, times_s: Floats) -> Floats:
        """Displacement (n,) along the axis."""
        return self.amplitude_m * np.sin(2 * math.pi * self.frequency_hz * times_s + math.radians(self.phase_deg))


@dataclass(frozen=True, slots=True, kw_only=True)
class Movement:
    """Displacement of a box from its described position: ``velocity_m_s t`` and the sum of its sways."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sways: tuple[Sway, ...] = ()

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.velocity_m_s)):
            raise ValueError(f"Expected a finite velocity_m_s, got {self.velocity_m_s}")

    def displacement_m(self, times_s: Floats) -> Floats:
        """Displacement (n, 3) in the world at ``times_s`` (n,)."""
        displacement_m = np.array(self.velocity_m_s) * times_s[:, None]
        for sway in self.sways:
            displacement_m[:, AXES.index(sway.axis)] += sway.along_m(times_s)
        return displacement_m
