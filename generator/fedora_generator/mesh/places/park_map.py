"""The ground of the park, painted as one picture: lawn, walks, the pond, and shade under the trees."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_generator.mesh.places.ground import LAWN_TILE_M, MapArea, edge, ellipse, lawn, lay, shade, tiled
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, between, bounded, flakes, flat, fractal, speckled
from fedora_generator.mesh.places.trees import AUTUMN, Tree

_LILY: Final[tuple[Rgb, ...]] = ((0.10, 0.22, 0.10), (0.22, 0.42, 0.16), (0.34, 0.54, 0.22))
_PEBBLES: Final[tuple[Rgb, ...]] = ((0.20, 0.17, 0.13), (0.42, 0.37, 0.29), (0.56, 0.50, 0.41), (0.70, 0.65, 0.56))
_LITTER: Final[tuple[Rgb, ...]] = ((0.30, 0.18, 0.07), (0.50, 0.32, 0.10), (0.62, 0.46, 0.16))


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse:
    """An ellipse on the ground: centre and radii along x and y of the world, metres."""

    center_m: tuple[float, float]
    radii_m: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParkGround:
    """What lies on the ground of a park, metres in the world.

    Attributes
    ----------
    area
        Rectangle of the map.
    walk_amplitudes_m
        The middle of the walk is the sum of a sine of one period and a sine of two periods over the length of the map,
        so that the walk meets itself where the map ends.
    walk_half_width_m
        From the middle of the walk to its border.
    lane_x_m, lane_bend_m, lane_half_width_m
        A lane begins at y = 0 with its middle at ``lane_x_m`` and bends by ``lane_bend_m`` towards x, up to the middle
        of the forecourt.
    lane_end_y_m
        Where the lane ends.
    forecourt
        Gravel at the end of the lane.
    pond
        Its water.
    trees
        Their shade is on the ground, and leaves lie below those in autumn colours.
    """

    area: MapArea
    walk_amplitudes_m: tuple[float, float]
    walk_half_width_m: float
    lane_x_m: float
    lane_bend_m: float
    lane_half_width_m: float
    lane_end_y_m: float
    forecourt: Ellipse
    pond: Ellipse
    trees: tuple[Tree, ...]


def paint_park_map(rng: np.random.Generator, shape: Shape, ground: ParkGround) -> Image:
    """Paint the ground of a park; at the border of the map it is plain lawn, but for the walk at both ends.

    Parameters
    ----------
    rng
        Draws gravel, lilies, leaves and ragged borders.
    shape
        Rows and columns of the picture.
    ground
        What lies where.

    Returns
    -------
    Image
        (h, w, 3) linear reflectance.
    """
    area = ground.area
    x_m, y_m = area.coordinates_m(shape)
    texels = round(LAWN_TILE_M / area.texel_m)
    picture = tiled(lawn((texels, texels)), shape)
    ragged_m = 0.03 * tiled(fractal(rng, (texels, texels), 1.0, texels / 6)[..., None], shape)[..., 0]
    inside_map_m = area.inside_m(x_m, y_m)

    # Stripes of a mower along the walk, 1.6 m wide, fading towards the border.
    stripes = np.tanh(4 * np.sin(2 * np.pi * (y_m + 0.15 * x_m) / 3.2)).astype(np.float32)
    picture *= (1 + 0.10 * stripes * edge(inside_map_m - 1.0, 2.0))[..., None]

    # Distance inside the walks: the main walk, the lane, and the forecourt at its end.
    phase = 2 * np.pi * (x_m - area.x_m[0]) / area.size_m[0]
    once_m, twice_m = ground.walk_amplitudes_m
    middle_m = np.asarray(once_m * np.sin(phase) + twice_m * np.sin(2 * phase), dtype=np.float32)
    walk_m = np.minimum(ground.walk_half_width_m - np.abs(y_m - middle_m), inside_map_m + 1.2)
    court = ground.forecourt
    bend_m = ground.lane_x_m + ground.lane_bend_m * np.clip(y_m / court.center_m[1], 0, 1) ** 0.5
    lane_m = np.minimum(ground.lane_half_width_m - np.abs(x_m - bend_m), np.minimum(-y_m, y_m - ground.lane_end_y_m))
    side_walk_m = np.maximum(lane_m, ellipse(x_m, y_m, court.center_m, court.radii_m)).astype(np.float32)
    walks_m = np.maximum(walk_m, side_walk_m) + ragged_m

    # The walks are gravel between borders of bare earth.
    bed = between(fractal(rng, (texels, texels), 1.0, texels / 3), (0.30, 0.26, 0.20), (0.56, 0.50, 0.41))
    gravel = speckled(rng, flakes(rng, bed, 9000, 5.0, 3.8, _PEBBLES), 0.06)
    lay(picture, (0.20, 0.16, 0.10), 0.75 * edge(walks_m + 0.12, 0.16))
    lay(picture, tiled(gravel, (picture.shape[0], picture.shape[1])), edge(walks_m, 0.06))

    # The pond: water with lilies within a sandy shore.
    pond = ground.pond
    (center_x, center_y), (radius_x, radius_y) = pond.center_m, pond.radii_m
    columns = slice(*np.searchsorted(x_m[0], (center_x - radius_x - 1, center_x + radius_x + 1)))
    rows = slice(*np.searchsorted(-y_m[:, 0], (-center_y - radius_y - 1, -center_y + radius_y + 1)))
    part = picture[rows, columns]
    part_shape = (part.shape[0], part.shape[1])
    pond_m = ellipse(x_m[:, columns], y_m[rows], pond.center_m, pond.radii_m) + 2.5 * ragged_m[rows, columns]
    water = paint_water(rng, part_shape)
    lilies = flakes(rng, flat(part_shape, (0.0, 0.0, 0.0)), 90, 30.0, 26.0, _LILY)
    water = np.where(lilies.max(axis=-1, keepdims=True) > 0.08, lilies, water)
    lay(part, (0.42, 0.36, 0.26), edge(pond_m + 0.22, 0.12))
    lay(part, water, edge(pond_m, 0.05))

    # Fallen leaves below the trees in autumn colours.
    for tree in ground.trees:
        if tree.foliage != AUTUMN:
            continue
        radius_m = tree.crown_radius_m
        columns = slice(*np.searchsorted(x_m[0], (tree.x_m - radius_m, tree.x_m + radius_m)))
        rows = slice(*np.searchsorted(-y_m[:, 0], (-tree.y_m - radius_m, -tree.y_m + radius_m)))
        part = picture[rows, columns]
        litter = flakes(rng, flat((part.shape[0], part.shape[1]), (0.0, 0.0, 0.0)), 700, 9.0, 5.0, _LITTER)
        below_crown = edge(ellipse(x_m[:, columns], y_m[rows], (tree.x_m, tree.y_m), (radius_m, radius_m)), 1.2)
        lay(part, litter, below_crown * (litter.max(axis=-1) > 0.12))

    shade(picture, area, [(tree.x_m, tree.y_m, 0.75 * tree.crown_radius_m, 0.45) for tree in ground.trees])
    shade(picture, area, [(tree.x_m, tree.y_m, 0.5, 0.5) for tree in ground.trees])
    return bounded(picture)


def paint_water(rng: np.random.Generator, shape: Shape) -> Image:
    """Paint still water: the sky in ripples, dark between them."""
    ripples = fractal(rng, shape, 0.9, shape[0] / 4, shortest_px=3.0, stretch=(1.0, 3.0))
    return speckled(rng, between(ripples, (0.06, 0.12, 0.13), (0.38, 0.50, 0.56)), 0.04)
