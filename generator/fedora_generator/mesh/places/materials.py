"""Materials of surfaces: a procedural picture, the metres that it covers, and emitted light."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_generator.mesh.places.ground import LAWN_TILE_M, lawn
from fedora_generator.mesh.places.paint import (
    Image,
    Rgb,
    Shape,
    between,
    colour,
    courses,
    flakes,
    flat,
    fractal,
    lettering,
    over,
    speckled,
)

Picture = Callable[[np.random.Generator, Shape], Image]


@dataclass(frozen=True, slots=True)
class Material:
    """A picture repeated every ``size_m`` (right, down), at about ``texel_m``. ``emission_rgb``: 1 is white."""

    picture: Picture
    size_m: tuple[float, float]
    texel_m: float = 0.01
    emission_rgb: Rgb = (0.0, 0.0, 0.0)
    two_sided: bool = False

    @property
    def shape(self) -> Shape:
        """Rows and columns of the picture."""
        width_m, height_m = self.size_m
        return max(8, round(height_m / self.texel_m)), max(8, round(width_m / self.texel_m))


def noisy(dark: Rgb, light: Rgb, slope: float = 1.0, stretch: tuple[float, float] = (1.0, 1.0)) -> Picture:
    """Plaster, concrete, bark, metal: noise between two colours."""

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        field = fractal(rng, shape, slope, longest_px=max(shape) / 2, stretch=stretch)
        return speckled(rng, between(field, dark, light), 0.06)

    return picture


def masonry(
    dark: Rgb,
    light: Rgb,
    joint: Rgb,
    rows: int,
    columns: int,
    *,
    joint_px: float = 1.5,
    staggered: bool = True,
    shade: float = 0.0,
) -> Picture:
    """Bricks, paving, roof tiles or planks.

    Parameters
    ----------
    dark, light, joint
        Colours of the stones, and of the joints.
    rows, columns
        Number of stones in the picture.
    joint_px
        Width of a joint.
    staggered
        Whether every second row is shifted by half a stone.
    shade
        Darkening of each stone towards its top, 0 to 1, as under the tile above.
    """

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        tones, joints, down = courses(rng, shape, rows, columns, joint_px, staggered=staggered)
        stones = between(0.7 * tones + 0.7 * fractal(rng, shape, 1.0, max(shape) / 4), dark, light)
        return speckled(rng, over(stones * (1 - shade * (1 - down))[..., None], joint, joints), 0.07)

    return picture


def foliage(colours: tuple[Rgb, ...], length_px: float = 10.0) -> Picture:
    """Layers of leaves, the lowest of the first colour, the darkest."""

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        count = round(6.0 * shape[0] * shape[1] / length_px**2)
        leaves = flakes(rng, flat(shape, colours[0]), count, length_px, 0.5 * length_px, colours)
        patches = fractal(rng, shape, 1.0, max(shape) / 2, shortest_px=2 * length_px)
        return speckled(rng, leaves * np.exp(0.16 * patches)[..., None], 0.05)

    return picture


def board(ground: Rgb, text: str, ink: Rgb) -> Picture:
    """Build a sign with a line of text."""

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        return speckled(rng, lettering(flat(shape, ground), text, ink), 0.04)

    return picture


def bands(colours: tuple[Rgb, ...], *, vertical: bool = False) -> Picture:
    """Equal bands of colour, one above the other or side by side."""

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        along = np.arange(shape[1])[None, :] / shape[1] if vertical else np.arange(shape[0])[:, None] / shape[0]
        number = np.broadcast_to((along * len(colours)).astype(int), shape)
        return speckled(rng, colour(colours)[number], 0.05)

    return picture


def checks(first: Rgb, second: Rgb, count: int = 2) -> Picture:
    """Squares in two colours, ``count`` each way."""

    def picture(rng: np.random.Generator, shape: Shape) -> Image:
        down, right = (np.arange(n) * count // n for n in shape)
        odd = (down[:, None] + right[None, :]) % 2
        return speckled(rng, colour([first, second])[odd], 0.05)

    return picture


_GREENS: Final = ((0.03, 0.06, 0.02), (0.10, 0.20, 0.05), (0.20, 0.36, 0.09), (0.33, 0.52, 0.15), (0.48, 0.66, 0.22))
_DEEP: Final = ((0.02, 0.05, 0.03), (0.06, 0.14, 0.07), (0.12, 0.26, 0.12), (0.20, 0.38, 0.17), (0.32, 0.50, 0.24))
_AUTUMN: Final = ((0.06, 0.04, 0.02), (0.26, 0.14, 0.04), (0.46, 0.27, 0.06), (0.64, 0.40, 0.09), (0.78, 0.56, 0.16))
_BLOOM: Final = ((0.05, 0.09, 0.03), (0.14, 0.26, 0.07), (0.25, 0.42, 0.12), (0.75, 0.22, 0.30), (0.92, 0.70, 0.75))

MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {
        "lawn": Material(lambda _, shape: lawn(shape), (LAWN_TILE_M, LAWN_TILE_M), 0.0125),
        "bark": Material(noisy((0.08, 0.06, 0.04), (0.46, 0.38, 0.29), 0.8, (5.0, 1.0)), (1.28, 2.56)),
        "leaves": Material(foliage(_GREENS), (2.56, 2.56)),
        "deep leaves": Material(foliage(_DEEP, 8.0), (2.56, 2.56)),
        "autumn leaves": Material(foliage(_AUTUMN), (2.56, 2.56)),
        "flowers": Material(foliage(_BLOOM, 9.0), (1.28, 1.28)),
        "leaf": Material(foliage(_GREENS[2:]), (1.28, 1.28), two_sided=True),
        "deep leaf": Material(foliage(_DEEP[2:]), (1.28, 1.28), two_sided=True),
        "autumn leaf": Material(foliage(_AUTUMN[2:]), (1.28, 1.28), two_sided=True),
        "far trees": Material(foliage(_DEEP, 16.0), (20.48, 20.48), 0.04),
        "far hills": Material(noisy((0.20, 0.28, 0.22), (0.44, 0.52, 0.42)), (160.0, 160.0), 0.32),
        "stone": Material(noisy((0.28, 0.27, 0.25), (0.66, 0.64, 0.60)), (2.56, 2.56)),
        "white stone": Material(noisy((0.60, 0.58, 0.53), (0.84, 0.82, 0.76)), (2.56, 2.56)),
        "concrete": Material(noisy((0.40, 0.40, 0.39), (0.60, 0.59, 0.57)), (2.56, 2.56)),
        "plaster": Material(noisy((0.58, 0.54, 0.45), (0.80, 0.76, 0.66)), (5.12, 5.12), 0.02),
        "white paint": Material(noisy((0.60, 0.60, 0.58), (0.90, 0.89, 0.86)), (1.28, 1.28)),
        "metal": Material(noisy((0.08, 0.09, 0.10), (0.30, 0.32, 0.33), 0.8), (1.28, 1.28)),
        "steel": Material(noisy((0.38, 0.40, 0.42), (0.66, 0.68, 0.70), 0.8, (1.0, 3.0)), (1.28, 1.28)),
        "glass": Material(noisy((0.06, 0.09, 0.12), (0.30, 0.38, 0.46), 1.3, (3.0, 1.0)), (2.56, 2.56), 0.02),
        "brick": Material(
            masonry((0.28, 0.10, 0.06), (0.58, 0.27, 0.17), (0.58, 0.55, 0.50), 32, 10, joint_px=1.2), (2.56, 2.56)
        ),
        "sandstone": Material(
            masonry((0.48, 0.40, 0.27), (0.74, 0.65, 0.48), (0.36, 0.32, 0.25), 8, 5, joint_px=1.5), (2.56, 2.56)
        ),
        "paving": Material(
            masonry((0.34, 0.32, 0.29), (0.62, 0.59, 0.54), (0.20, 0.19, 0.17), 8, 8, joint_px=1.6), (3.2, 3.2), 0.0125
        ),
        "roof tiles": Material(
            masonry((0.30, 0.11, 0.07), (0.58, 0.26, 0.16), (0.10, 0.05, 0.04), 8, 10, shade=0.5), (2.56, 2.56), 0.02
        ),
        "slates": Material(
            masonry((0.16, 0.18, 0.21), (0.36, 0.39, 0.43), (0.07, 0.08, 0.09), 10, 10, shade=0.4), (2.56, 2.56), 0.02
        ),
        "wood": Material(
            masonry((0.26, 0.15, 0.07), (0.56, 0.37, 0.20), (0.09, 0.05, 0.03), 8, 1, staggered=False), (2.56, 1.0)
        ),
        "lamp glass": Material(
            noisy((0.5, 0.48, 0.42), (0.8, 0.78, 0.7)), (0.64, 0.64), emission_rgb=(0.52, 0.46, 0.32)
        ),
        "lit window": Material(
            noisy((0.2, 0.15, 0.1), (0.6, 0.5, 0.4), 1.3), (2.56, 2.56), 0.02, emission_rgb=(0.36, 0.26, 0.12)
        ),
        "dim window": Material(
            noisy((0.1, 0.1, 0.1), (0.4, 0.36, 0.3), 1.3), (2.56, 2.56), 0.02, emission_rgb=(0.16, 0.11, 0.05)
        ),
    }
)
"""Materials that places share."""
