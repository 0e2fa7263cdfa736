"""A park in a town: a winding walk under trees, a pond, a cafe, and a fountain in front of a museum."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fedora_generator.mesh.places.buildings import House, colonnade, house, tower_block
from fedora_generator.mesh.places.furniture import bench, fountain, lamp_post, litter_bin, picket_fence
from fedora_generator.mesh.places.ground import LAWN_TILE_M, hills, lawn, plain
from fedora_generator.mesh.places.group import Group, painted, solid, together
from fedora_generator.mesh.places.materials import Material
from fedora_generator.mesh.places.park_map import PARK_AREA, PLAZA, TREES, paint_park_map, paint_water
from fedora_generator.mesh.places.shapes import boulder, standing_box, turned
from fedora_generator.mesh.places.trees import (
    AUTUMN,
    DEEP,
    GREEN,
    broadleaf,
    bush,
    flower_bed,
    grove,
    hedge,
    wood_line,
)

PARK_MATERIALS: Final[Mapping[str, Material]] = {
    "park map": Material(paint_park_map, PARK_AREA.size_m, PARK_AREA.texel_m),
    "lawn": Material(lambda _, shape: lawn(shape), (LAWN_TILE_M, LAWN_TILE_M), PARK_AREA.texel_m),
    "water": Material(paint_water, (3.2, 3.2), 0.0125),
}

_BACK_TREES_M: Final = (
    *((9, 12.5), (27, 13.5), (33, 12.0), (38.5, 14.0), (49, 15.0)),
    *((29, -14.5), (33, -13.0), (41, -13.5), (3, -13.0), (50, -16.0)),
)
_BUSHES: Final = (
    *((3.2, -3.6, GREEN), (9.6, -3.6, DEEP), (15.8, 7.8, DEEP)),
    *((33.2, 5.6, GREEN), (26.6, -6.4, AUTUMN), (37.6, -5.2, DEEP)),
)
_FOLIAGES: Final = {"green": GREEN, "deep": DEEP, "autumn": AUTUMN}


def park(rng: np.random.Generator) -> Group:
    """Build the whole park. The walk begins at the origin and leads along x."""
    ground = (
        PARK_AREA.surface("park map")
        + plain("lawn", PARK_AREA.x_m, PARK_AREA.y_m, 700.0)
        + hills(rng, "far hills", (330.0, 650.0), 70.0)
        + wood_line(rng, 110, (95.0, 150.0), (9.0, 16.0))
        + solid("ground", (1400.0, 1400.0, 1.0), (0.0, 0.0, -0.5))
    )

    # Trees beside the walk, and a grove behind them.
    trees = [
        broadleaf(rng, tree.height_m, tree.crown_m, _FOLIAGES[tree.foliage], clusters=12).at(tree.x_m, tree.y_m)
        for tree in TREES
    ]
    trees.append(grove(rng, _BACK_TREES_M))

    # Lamps, benches, bins, hedges and flowers along the walk.
    along_walk = [lamp_post().at(x, y) for x, y in ((4, 2.9), (11, -2.0), (18, 2.7), (25, -2.9), (32, 2.0), (39, -2.9))]
    along_walk += [bench().at(x, y) for x, y in ((8.2, 3.4), (15.2, 3.3), (34.5, 2.2))]
    along_walk += [bench().at(x, y, yaw_deg=180.0) for x, y in ((7.2, -1.9), (22.5, -2.9), (29.5, -3.2))]
    along_walk += [litter_bin().at(x, y) for x, y in ((9.8, 3.3), (20.8, -2.7), (36.2, 2.2))]
    along_walk += [
        hedge(rng, length).at(x, y) for x, y, length in ((4.5, 10.4, 16.0), (34.0, 10.4, 14.0), (4.0, -10.3, 10.0))
    ]
    along_walk += [picket_fence(16.0).at(34.0, -10.3), picket_fence(6.0).at(18.0, 10.5)]
    along_walk += [flower_bed(rng, 3.0, 0.9).at(x, y) for x, y in ((11.5, 3.6), (31.0, -3.6), (38.0, 2.6))]
    along_walk += [bush(rng, 0.55, foliage).at(x, y) for x, y, foliage in _BUSHES]

    # Boulders around the pond; its water is painted on the map.
    stones = []
    for bearing in np.linspace(0, 2 * np.pi, 17)[:-1]:
        x, y = 24.2 + 3.5 * np.cos(bearing), 6.3 + 2.25 * np.sin(bearing)
        size = rng.uniform(0.18, 0.42)
        stones.append(painted("stone", boulder((size, size, 0.7 * size), rng, 0.3, cells=5)).at(x, y, 0.2 * size))

    return together([ground, *trees, *along_walk, *stones, _cafe(rng), _plaza(rng), _town(rng)])


def _cafe(rng: np.random.Generator) -> Group:
    """Build a cafe with a sign, round tables, and lamps at its door."""
    options = House(
        size_m=(11.0, 6.5, 3.6),
        storeys=1,
        wall="plaster",
        roof="slates",
        roof_rise_m=2.0,
        window_m=(1.5, 1.6),
        spacing_m=2.3,
    )
    sign = painted("white paint", standing_box((3.2, 0.12, 0.5), y_m=-3.27, z_m=2.85))
    top = turned([(0, 0.7), (0.45, 0.7), (0.45, 0.76), (0, 0.76)])
    foot = turned([(0, -0.02), (0.28, -0.02), (0.28, 0.05), (0.06, 0.09), (0.06, 0.72), (0, 0.72)])
    table = painted("wood", top) + painted("metal", foot)
    tables = [table.at(x, -5.0) for x in (-3.4, -1.6, 1.8, 3.6)]
    lamps = [lamp_post(5.0).at(x, -4.2) for x in (-5.4, 5.4)]
    return together([house(rng, options), sign, *tables, *lamps]).at(19.0, -13.8, yaw_deg=180.0)


def _plaza(rng: np.random.Generator) -> Group:
    """Build a paved round with a fountain, and the museum behind it."""
    x_m, radius_m = PLAZA
    slab = painted("paving", turned([(radius_m, -0.2), (radius_m, 0.08), (0.0, 0.08)], sides=56)).at(x_m, 0)
    museum = house(
        rng,
        House(
            size_m=(30.0, 12.0, 9.0), storeys=2, wall="sandstone", roof_rise_m=0.0, window_m=(1.3, 2.2), spacing_m=3.2
        ),
    )
    front = colonnade(18.0, 8, 7.0).at(0, -8.2)
    lamps = [lamp_post(9.0).at(x_m + 1.0, y, 0.08) for y in (-6.4, 6.4)]
    beds = [flower_bed(rng, 4.0, 1.2).at(x_m - 4.0, y, 0.06, yaw) for y, yaw in ((-5.6, -55.0), (5.6, 55.0))]
    return together(
        [slab, fountain().at(x_m, 0, 0.08), *lamps, *beds, (museum + front).at(x_m + 26.0, 0.0, yaw_deg=-90.0)]
    )


def _town(rng: np.random.Generator) -> Group:
    """Houses on both sides of the park, and tower blocks over the trees."""
    kinds = (
        House(size_m=(11.0, 8.0, 6.2), wall="brick"),
        House(size_m=(9.0, 8.0, 8.4), storeys=3, wall="plaster", roof="slates", roof_rise_m=2.8),
        House(size_m=(12.0, 9.0, 6.0), wall="sandstone", roof_rise_m=3.0),
    )
    row = [house(rng, kinds[i % 3]).at(x, 24.0 + i % 2) for i, x in enumerate((-2.0, 12.0, 26.0, 41.0, 55.0))]
    row += [house(rng, kinds[(i + 1) % 3]).at(x, -27.0 - i % 2, yaw_deg=180.0) for i, x in enumerate((4.0, 33.0, 48.0))]
    sites = (
        (170.0, 55.0, 18.0, 52.0),
        (190.0, 22.0, 16.0, 38.0),
        (165.0, -70.0, 22.0, 44.0),
        (200.0, -30.0, 15.0, 60.0),
    )
    towers = [tower_block(rng, (wide, 14.0, tall)).at(x, y, yaw_deg=-90.0 + 0.15 * y) for x, y, wide, tall in sites]
    return together(row + towers)
