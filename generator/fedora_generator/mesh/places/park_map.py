"""The ground of the park, painted as one picture: lawn, walks, the pond, and shade under the trees."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_generator.mesh.places.ground import LAWN_TILE_M, Floats32, MapArea, edge, ellipse, lawn, lay, shade, tiled
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, between, bounded, flakes, flat, fractal, speckled

PARK_AREA: Final = MapArea(x_m=(-4.8, 43.2), y_m=(-9.6, 9.6), texel_m=0.0125)
PLAZA: Final = (52.0, 9.0)
"""x of its centre and its radius, metres; y is 0. It begins where the map ends."""


@dataclass(frozen=True, slots=True)
class Tree:
    """Where a tree stands, how large it is, and its foliage."""

    x_m: float
    y_m: float
    height_m: float
    crown_m: float
    foliage: str


TREES: Final = (
    Tree(6.0, 5.4, 7.4, 2.3, "green"),
    Tree(4.6, -5.6, 8.2, 2.6, "deep"),
    Tree(12.6, -4.6, 6.8, 2.1, "autumn"),
    Tree(13.2, 7.0, 8.8, 2.9, "green"),
    Tree(19.4, 4.6, 6.4, 1.9, "green"),
    Tree(24.6, -5.4, 8.0, 2.5, "green"),
    Tree(29.8, 6.2, 7.6, 2.4, "autumn"),
    Tree(29.0, -6.4, 9.0, 2.9, "deep"),
    Tree(35.4, -5.0, 7.2, 2.2, "green"),
    Tree(36.6, 6.0, 8.6, 2.7, "deep"),
    Tree(41.6, -6.4, 7.6, 2.5, "autumn"),
    Tree(42.0, 6.8, 8.2, 2.6, "green"),
)

POND_M: Final = ((24.2, 6.3), (3.3, 2.05))
_LILY: Final[tuple[Rgb, ...]] = ((0.10, 0.22, 0.10), (0.22, 0.42, 0.16), (0.34, 0.54, 0.22))
_PEBBLES: Final[tuple[Rgb, ...]] = ((0.20, 0.17, 0.13), (0.42, 0.37, 0.29), (0.56, 0.50, 0.41), (0.70, 0.65, 0.56))
_LITTER: Final[tuple[Rgb, ...]] = ((0.30, 0.18, 0.07), (0.50, 0.32, 0.10), (0.62, 0.46, 0.16))


def walk_y_m(x_m: Floats32) -> Floats32:
    """Middle of the walk, metres; it meets itself where the map ends."""
    phase = 2 * np.pi * (x_m - PARK_AREA.x_m[0]) / PARK_AREA.size_m[0]
    return np.asarray(0.75 * np.sin(phase) + 0.3 * np.sin(2 * phase), dtype=np.float32)


def paint_park_map(rng: np.random.Generator, shape: Shape) -> Image:
    """Picture of the park's ground; at its border it is plain lawn, but for the walk at both ends."""
    x_m, y_m = PARK_AREA.coordinates_m(shape)
    texels = round(LAWN_TILE_M / PARK_AREA.texel_m)
    picture = tiled(lawn((texels, texels)), shape)
    ragged_m = 0.03 * tiled(fractal(rng, (texels, texels), 1.0, texels / 6)[..., None], shape)[..., 0]
    inside_map_m = PARK_AREA.inside_m(x_m, y_m)

    # Stripes of a mower along the walk, 1.6 m wide, fading towards the border.
    stripes = np.tanh(4 * np.sin(2 * np.pi * (y_m + 0.15 * x_m) / 3.2)).astype(np.float32)
    picture *= (1 + 0.10 * stripes * edge(inside_map_m - 1.0, 2.0))[..., None]

    # Distance inside the walks: the main walk, the side walk to the cafe, and the space before the cafe.
    walk_m = np.minimum(1.25 - np.abs(y_m - walk_y_m(x_m)), inside_map_m + 1.2)
    bend_m = 15.6 + 3.4 * np.clip(-y_m / 8.0, 0, 1) ** 0.5
    lane_m = np.minimum(0.85 - np.abs(x_m - bend_m), np.minimum(-y_m, y_m + 8.6))
    side_walk_m = np.maximum(lane_m, ellipse(x_m, y_m, (19.0, -8.0), (4.6, 1.3))).astype(np.float32)
    walks_m = np.maximum(walk_m, side_walk_m) + ragged_m

    # The walks are gravel between borders of bare earth.
    bed = between(fractal(rng, (texels, texels), 1.0, texels / 3), (0.30, 0.26, 0.20), (0.56, 0.50, 0.41))
    gravel = speckled(rng, flakes(rng, bed, 9000, 5.0, 3.8, _PEBBLES), 0.06)
    lay(picture, (0.20, 0.16, 0.10), 0.75 * edge(walks_m + 0.12, 0.16))
    lay(picture, tiled(gravel, (picture.shape[0], picture.shape[1])), edge(walks_m, 0.06))

    # The pond: water with lilies within a sandy shore.
    (center_x, center_y), (radius_x, radius_y) = POND_M
    columns = slice(*np.searchsorted(x_m[0], (center_x - radius_x - 1, center_x + radius_x + 1)))
    rows = slice(*np.searchsorted(-y_m[:, 0], (-center_y - radius_y - 1, -center_y + radius_y + 1)))
    part = picture[rows, columns]
    part_shape = (part.shape[0], part.shape[1])
    pond_m = ellipse(x_m[:, columns], y_m[rows], *POND_M) + 2.5 * ragged_m[rows, columns]
    water = paint_water(rng, part_shape)
    lilies = flakes(rng, flat(part_shape, (0.0, 0.0, 0.0)), 90, 30.0, 26.0, _LILY)
    water = np.where(lilies.max(axis=-1, keepdims=True) > 0.08, lilies, water)
    lay(part, (0.42, 0.36, 0.26), edge(pond_m + 0.22, 0.12))
    lay(part, water, edge(pond_m, 0.05))

    # Fallen leaves below the trees in autumn colours.
    for tree in TREES:
        if tree.foliage != "autumn":
            continue
        columns = slice(*np.searchsorted(x_m[0], (tree.x_m - tree.crown_m, tree.x_m + tree.crown_m)))
        rows = slice(*np.searchsorted(-y_m[:, 0], (-tree.y_m - tree.crown_m, -tree.y_m + tree.crown_m)))
        part = picture[rows, columns]
        litter = flakes(rng, flat((part.shape[0], part.shape[1]), (0.0, 0.0, 0.0)), 700, 9.0, 5.0, _LITTER)
        below_crown = edge(ellipse(x_m[:, columns], y_m[rows], (tree.x_m, tree.y_m), (tree.crown_m,) * 2), 1.2)
        lay(part, litter, below_crown * (litter.max(axis=-1) > 0.12))

    shade(picture, PARK_AREA, [(tree.x_m, tree.y_m, 0.75 * tree.crown_m, 0.45) for tree in TREES])
    shade(picture, PARK_AREA, [(tree.x_m, tree.y_m, 0.5, 0.5) for tree in TREES])
    return bounded(picture)


def paint_water(rng: np.random.Generator, shape: Shape) -> Image:
    """Still water: the sky in ripples, dark between them."""
    ripples = fractal(rng, shape, 0.9, shape[0] / 4, shortest_px=3.0, stretch=(1.0, 3.0))
    return speckled(rng, between(ripples, (0.06, 0.12, 0.13), (0.38, 0.50, 0.56)), 0.04)
