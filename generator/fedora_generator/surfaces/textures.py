"""Textures as options, and the table of their terms that the kernels read.

A texture is a scalar between 0 and 1 on the surface; it mixes two linear albedos. It is a sum of cosines, which are
smooth, and square waves, which have edges; both are averaged over a pixel's footprint in closed form
(``texture_kernels``).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.texture_kernels import CHECKER, DASHES, LANES, STRIPES, TextureTable

Rgb = tuple[float, float, float]
StepKind = Literal["stripes", "checker", "dashes"]

RULES: Final = {"stripes": STRIPES, "checker": CHECKER, "dashes": DASHES}
GOLDEN_ANGLE_RAD: Final = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, slots=True, kw_only=True)
class WaveBand:
    """Cosines from the longest to the shortest wavelength, at equal ratios, in directions that never repeat.

    ``contrast`` is their share of the texture's range, 0 to 1: the amplitudes sum to half of it. An amplitude grows
    with its wavelength to the power ``slope``: 0 gives every scale the same contrast, 1 the same gradient.
    """

    longest_m: float
    shortest_m: float
    count: int
    contrast: float = 1.0
    slope: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.shortest_m <= self.longest_m:
            raise ValueError(f"Expected 0 < shortest_m <= longest_m, got {self.shortest_m} and {self.longest_m}")
        if self.count < 1:
            raise ValueError(f"Expected count >= 1, got {self.count}")
        _require_contrast(self.contrast)

    def rows(self) -> NDArray[np.float64]:
        """Terms (count, 4): amplitude, k_u, k_v (cycles a metre), phase (turns)."""
        wavelengths_m = np.geomspace(self.longest_m, self.shortest_m, self.count)
        amplitudes = wavelengths_m**self.slope
        amplitudes *= 0.5 * self.contrast / amplitudes.sum()
        first_rad, *phases = np.random.default_rng(self.seed).random(self.count + 1)
        directions_rad = 2 * math.pi * first_rad + GOLDEN_ANGLE_RAD * np.arange(self.count)
        k_u, k_v = np.cos(directions_rad) / wavelengths_m, np.sin(directions_rad) / wavelengths_m
        return np.stack([amplitudes, k_u, k_v, np.array(phases)], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepPattern:
    """A pattern with sharp edges.

    ``stripes`` alternate along the first direction, ``checker`` along both, ``dashes`` are light where both square
    waves are. ``period_m`` and ``duty`` (light share of a period) are given for the first direction, which lies at
    ``angle_deg`` from u, and for the second, at right angles to it.
    """

    kind: StepKind
    period_m: tuple[float, float]
    duty: tuple[float, float] = (0.5, 0.5)
    phase: tuple[float, float] = (0.0, 0.0)
    angle_deg: float = 0.0
    contrast: float = 1.0

    def __post_init__(self) -> None:
        if min(self.period_m) <= 0:
            raise ValueError(f"Expected period_m > 0, got {self.period_m}")
        if not all(0 < duty < 1 for duty in self.duty):
            raise ValueError(f"Expected duty between 0 and 1, got {self.duty}")
        _require_contrast(self.contrast)

    def row(self) -> tuple[float, ...]:
        """One row of ``TextureTable.steps``."""
        cos, sin = math.cos(math.radians(self.angle_deg)), math.sin(math.radians(self.angle_deg))
        first, second = self.period_m
        return (
            *(RULES[self.kind], 0.5 * self.contrast),
            *(cos / first, sin / first, self.phase[0], self.duty[0]),
            *(-sin / second, cos / second, self.phase[1], self.duty[1]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """Linear albedo ``dark_rgb + s (light_rgb - dark_rgb)`` with s the sum of waves and steps around 1/2."""

    dark_rgb: Rgb
    light_rgb: Rgb
    waves: tuple[WaveBand, ...] = ()
    steps: tuple[StepPattern, ...] = ()

    def __post_init__(self) -> None:
        if not all(0 < albedo <= 1 for albedo in (*self.dark_rgb, *self.light_rgb)):
            raise ValueError("Expected albedos above 0 and up to 1, as a black surface has no logarithm")
        total = math.fsum([wave.contrast for wave in self.waves] + [step.contrast for step in self.steps])
        if total > 1 + 1e-9:
            raise ValueError(f"Expected contrasts that sum to at most 1, got {total:g}; lower one of them")


def texture_table(textures: Sequence[Texture]) -> TextureTable:
    """Terms of all textures in order, as the kernels read them."""
    waves = []
    for texture in textures:
        rows = np.concatenate([np.empty((0, 4)), *(band.rows() for band in texture.waves)])
        # Waves of amplitude 0 make their number a multiple of the lanes.
        waves.append(np.pad(rows, ((0, -len(rows) % LANES), (0, 0))))
    steps = [np.array([step.row() for step in texture.steps]).reshape(-1, 10) for texture in textures]
    return TextureTable(
        wave_ranges=_starts(len(rows) for rows in waves),
        waves=np.ascontiguousarray(np.concatenate(waves).T),
        step_ranges=_starts(len(rows) for rows in steps),
        steps=np.concatenate(steps),
    )


def _starts(lengths: Iterable[int]) -> NDArray[np.int64]:
    return np.cumsum([0, *lengths], dtype=np.int64)


def _require_contrast(contrast: float) -> None:
    if not 0 <= contrast <= 1:
        raise ValueError(f"Expected contrast between 0 and 1, got {contrast}")
