"""A park in a town: its objects, and its ground painted as one picture.

World frame (ENU), metres and degrees: the walk begins at the origin and leads along x, y is to its left, the ground is
at z = 0. Yaw is counter-clockwise. The front of a bench, of a building or of a colonnade looks to -y at a yaw of 0.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from fedora_generator.mesh.places.buildings import colonnade, house, tower_block
from fedora_generator.mesh.places.description import PlaceDescription, assembly, objects
from fedora_generator.mesh.places.furniture import (
    bench,
    block,
    fountain,
    lamp_post,
    litter_bin,
    picket_fence,
    round_table,
)
from fedora_generator.mesh.places.ground import (
    LAWN_TILE_M,
    MapArea,
    boulder_ring,
    edge,
    ellipse,
    hills,
    lawn,
    lay,
    map_sheet,
    paved_round,
    plain,
    shade,
    tiled,
)
from fedora_generator.mesh.places.materials import Material
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, between, bounded, flakes, flat, fractal, speckled
from fedora_generator.mesh.places.trees import (
    AUTUMN,
    DEEP,
    GREEN,
    Tree,
    avenue,
    bush,
    flower_bed,
    grove,
    hedge,
    wood_line,
)

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


TREES: Final = (
    Tree(x_m=6.0, y_m=5.4, height_m=7.4, crown_radius_m=2.3, foliage=GREEN),
    Tree(x_m=4.6, y_m=-5.6, height_m=8.2, crown_radius_m=2.6, foliage=DEEP),
    Tree(x_m=12.6, y_m=-4.6, height_m=6.8, crown_radius_m=2.1, foliage=AUTUMN),
    Tree(x_m=13.2, y_m=7.0, height_m=8.8, crown_radius_m=2.9, foliage=GREEN),
    Tree(x_m=19.4, y_m=4.6, height_m=6.4, crown_radius_m=1.9, foliage=GREEN),
    Tree(x_m=24.6, y_m=-5.4, height_m=8.0, crown_radius_m=2.5, foliage=GREEN),
    Tree(x_m=29.8, y_m=6.2, height_m=7.6, crown_radius_m=2.4, foliage=AUTUMN),
    Tree(x_m=29.0, y_m=-6.4, height_m=9.0, crown_radius_m=2.9, foliage=DEEP),
    Tree(x_m=35.4, y_m=-5.0, height_m=7.2, crown_radius_m=2.2, foliage=GREEN),
    Tree(x_m=36.6, y_m=6.0, height_m=8.6, crown_radius_m=2.7, foliage=DEEP),
    Tree(x_m=41.6, y_m=-6.4, height_m=7.6, crown_radius_m=2.5, foliage=AUTUMN),
    Tree(x_m=42.0, y_m=6.8, height_m=8.2, crown_radius_m=2.6, foliage=GREEN),
)

BACK_TREES_M: Final = (
    *((9, 12.5), (27, 13.5), (33, 12.0), (38.5, 14.0), (49, 15.0)),
    *((29, -14.5), (33, -13.0), (41, -13.5), (3, -13.0), (50, -16.0)),
)

# What is painted on the map of the ground: walks of gravel, the water of the pond, shade and fallen leaves below trees.
GROUND: Final = ParkGround(
    area=MapArea(x_m=(-4.8, 43.2), y_m=(-9.6, 9.6), texel_m=0.0125),
    walk_amplitudes_m=(0.75, 0.3),
    walk_half_width_m=1.25,
    lane_x_m=15.6,
    lane_bend_m=3.4,
    lane_half_width_m=0.85,
    lane_end_y_m=-8.6,
    forecourt=Ellipse(center_m=(19.0, -8.0), radii_m=(4.6, 1.3)),
    pond=Ellipse(center_m=(24.2, 6.3), radii_m=(3.3, 2.05)),
    trees=TREES,
)

CAFE: Final = assembly(
    partial(
        house,
        size_m=(11.0, 6.5, 3.6),
        storeys=1,
        wall="plaster",
        roof="slates",
        roof_rise_m=2.0,
        window_m=(1.5, 1.6),
        spacing_m=2.3,
    ),
    partial(block, material="white paint", size_m=(3.2, 0.12, 0.5), foot_m=(0.0, -3.27, 2.85)),  # a sign
    objects(round_table, at_m=((-3.4, -5.0), (-1.6, -5.0), (1.8, -5.0), (3.6, -5.0))),
    objects(partial(lamp_post, strength=5.0), at_m=((-5.4, -4.2), (5.4, -4.2))),
)

MUSEUM: Final = assembly(
    partial(
        house,
        size_m=(30.0, 12.0, 9.0),
        storeys=2,
        wall="sandstone",
        roof_rise_m=0.0,
        window_m=(1.3, 2.2),
        spacing_m=3.2,
    ),
    objects(partial(colonnade, length_m=18.0, columns=8, height_m=7.0), at_m=((0.0, -8.2),)),
)

BRICK_HOUSE: Final = partial(house, size_m=(11.0, 8.0, 6.2), wall="brick")
PLASTER_HOUSE: Final = partial(house, size_m=(9.0, 8.0, 8.4), storeys=3, wall="plaster", roof="slates", roof_rise_m=2.8)
SANDSTONE_HOUSE: Final = partial(house, size_m=(12.0, 9.0, 6.0), wall="sandstone", roof_rise_m=3.0)

PARK: Final = PlaceDescription(
    materials={
        "park map": Material(partial(paint_park_map, ground=GROUND), GROUND.area.size_m, GROUND.area.texel_m),
        "water": Material(paint_water, size_m=(3.2, 3.2), texel_m=0.0125),
    },
    objects=(
        # The ground as far as the hills.
        partial(map_sheet, area=GROUND.area, material="park map"),
        partial(plain, material="lawn", hole_x_m=GROUND.area.x_m, hole_y_m=GROUND.area.y_m, reach_m=700.0),
        partial(hills, material="far hills", radius_m=(330.0, 650.0), height_m=70.0),
        partial(wood_line, count=110, radius_m=(95.0, 150.0), height_m=(9.0, 16.0)),
        # Trees beside the walk, and a grove behind them.
        partial(avenue, trees=TREES),
        partial(grove, spots_m=BACK_TREES_M),
        # Along the walk.
        objects(lamp_post, at_m=((4, 2.9), (11, -2.0), (18, 2.7), (25, -2.9), (32, 2.0), (39, -2.9))),
        objects(bench, at_m=((8.2, 3.4), (15.2, 3.3), (34.5, 2.2))),
        objects(bench, at_m=((7.2, -1.9), (22.5, -2.9), (29.5, -3.2)), yaw_deg=180.0),
        objects(litter_bin, at_m=((9.8, 3.3), (20.8, -2.7), (36.2, 2.2))),
        objects(partial(hedge, length_m=16.0), at_m=((4.5, 10.4),)),
        objects(partial(hedge, length_m=14.0), at_m=((34.0, 10.4),)),
        objects(partial(hedge, length_m=10.0), at_m=((4.0, -10.3),)),
        objects(partial(picket_fence, length_m=16.0), at_m=((34.0, -10.3),)),
        objects(partial(picket_fence, length_m=6.0), at_m=((18.0, 10.5),)),
        objects(partial(flower_bed, length_m=3.0, width_m=0.9), at_m=((11.5, 3.6), (31.0, -3.6), (38.0, 2.6))),
        objects(partial(bush, radius_m=0.55, foliage=GREEN), at_m=((3.2, -3.6),)),
        objects(partial(bush, radius_m=0.55, foliage=DEEP), at_m=((9.6, -3.6), (15.8, 7.8))),
        objects(partial(bush, radius_m=0.55, foliage=GREEN), at_m=((33.2, 5.6),)),
        objects(partial(bush, radius_m=0.55, foliage=AUTUMN), at_m=((26.6, -6.4),)),
        objects(partial(bush, radius_m=0.55, foliage=DEEP), at_m=((37.6, -5.2),)),
        # Boulders on the shore of the pond.
        partial(boulder_ring, center_m=GROUND.pond.center_m, radii_m=(3.5, 2.25), count=16, size_m=(0.18, 0.42)),
        objects(CAFE, at_m=((19.0, -13.8),), yaw_deg=180.0),
        # A paved round at the end of the walk with the museum behind it.
        objects(partial(paved_round, radius_m=9.0, height_m=0.08), at_m=((52.0, 0.0),)),
        objects(partial(fountain, radius_m=2.4), at_m=((52.0, 0.0),), z_m=0.08),
        objects(partial(lamp_post, strength=9.0), at_m=((53.0, -6.4), (53.0, 6.4)), z_m=0.08),
        objects(MUSEUM, at_m=((78.0, 0.0),), yaw_deg=-90.0),
        objects(partial(flower_bed, length_m=4.0, width_m=1.2), at_m=((48.0, -5.6),), z_m=0.06, yaw_deg=-55.0),
        objects(partial(flower_bed, length_m=4.0, width_m=1.2), at_m=((48.0, 5.6),), z_m=0.06, yaw_deg=55.0),
        # The town: houses on both sides of the park, and tower blocks over the trees.
        objects(BRICK_HOUSE, at_m=((-2.0, 24.0),)),
        objects(PLASTER_HOUSE, at_m=((12.0, 25.0),)),
        objects(SANDSTONE_HOUSE, at_m=((26.0, 24.0),)),
        objects(BRICK_HOUSE, at_m=((41.0, 25.0),)),
        objects(PLASTER_HOUSE, at_m=((55.0, 24.0),)),
        objects(PLASTER_HOUSE, at_m=((4.0, -27.0),), yaw_deg=180.0),
        objects(SANDSTONE_HOUSE, at_m=((33.0, -28.0),), yaw_deg=180.0),
        objects(BRICK_HOUSE, at_m=((48.0, -27.0),), yaw_deg=180.0),
        objects(partial(tower_block, size_m=(18.0, 14.0, 52.0)), at_m=((170.0, 55.0),), yaw_deg=-81.75),
        objects(partial(tower_block, size_m=(16.0, 14.0, 38.0)), at_m=((190.0, 22.0),), yaw_deg=-86.7),
        objects(partial(tower_block, size_m=(22.0, 14.0, 44.0)), at_m=((165.0, -70.0),), yaw_deg=-100.5),
        objects(partial(tower_block, size_m=(15.0, 14.0, 60.0)), at_m=((200.0, -30.0),), yaw_deg=-94.5),
    ),
)
