"""A racetrack: a straight with gates, and its ground painted as one picture.

World frame (ENU), metres and degrees: the straight leads along x, y is to its left, the ground is at z = 0; the start
lies ahead of the origin. Yaw is counter-clockwise. The front of boards, stands and masts looks to -y at a yaw of 0.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from fedora_generator.mesh.places.buildings import control_tower, grandstand, pits
from fedora_generator.mesh.places.description import PlaceDescription, objects
from fedora_generator.mesh.places.furniture import (
    arch,
    barrier,
    boards,
    cone,
    feather_flag,
    flag,
    flood_mast,
    gantry,
    gate,
    kerb,
    tyre_wall,
)
from fedora_generator.mesh.places.ground import (
    LAWN_TILE_M,
    MapArea,
    edge,
    hills,
    lawn,
    lay,
    level_sheet,
    map_sheet,
    plain,
    road_bend,
    tiled,
)
from fedora_generator.mesh.places.materials import Material, bands, board, checks, noisy
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, between, bounded, flakes, fractal, speckled
from fedora_generator.mesh.places.trees import grove, wood_line

_PAINT_WHITE: Final[Rgb] = (0.80, 0.80, 0.77)
_STONES: Final[tuple[Rgb, ...]] = ((0.12, 0.12, 0.13), (0.19, 0.19, 0.20), (0.25, 0.25, 0.25), (0.36, 0.355, 0.34))
_PAINT_SEED: Final = 17
"""The pictures with and without the start share all but its markings, so that they join."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackGround:
    """What lies on the ground of a period of the straight, metres in the world; the middle of the track is at y = 0.

    Attributes
    ----------
    area
        Rectangle of the map.
    half_width_m
        From the middle of the track to the border of its asphalt.
    verge_y_m
        Where the bare verge ends and the grass begins, on both sides.
    start_x_m
        Middle of the chequered line.
    grid_x_m, grid_y_m
        Front of each place of the grid, and the distance of its middle from y = 0: right and left in turn.
    """

    area: MapArea
    half_width_m: float
    verge_y_m: float
    start_x_m: float
    grid_x_m: tuple[float, ...]
    grid_y_m: float


def paint_straight(_: np.random.Generator, shape: Shape, ground: TrackGround) -> Image:
    """Paint track, verges and grass: one period of the straight, (h, w, 3) linear reflectance of ``shape``."""
    rng = np.random.default_rng(_PAINT_SEED)
    x_m, y_m = ground.area.coordinates_m(shape)
    texels = round(LAWN_TILE_M / ground.area.texel_m)
    picture = tiled(lawn((texels, texels)), shape)
    ragged_m = 0.05 * tiled(fractal(rng, (texels, texels), 1.0, texels / 6)[..., None], shape)[..., 0]
    lay(picture, (0.32, 0.26, 0.17), 0.8 * edge(ground.verge_y_m + 2 * ragged_m - np.abs(y_m) + 0 * x_m, 0.5))
    road = np.flatnonzero(np.abs(y_m[:, 0]) < ground.half_width_m + 0.3)
    rows = slice(road[0], road[-1] + 1)
    picture[rows] = paint_asphalt(rng, (len(road), shape[1]))
    road_shape, across_m = (len(road), shape[1]), y_m[rows]

    # Dark bands of rubber where the cars drive, and streaks of single tyres.
    streaks = fractal(rng, road_shape, 0.8, 500.0, shortest_px=6.0, stretch=(1.0, 24.0))
    lanes = np.exp(-(((np.abs(across_m + 0.2) - 1.0) / 0.55) ** 2))
    rubber = np.clip(0.20 * lanes + 0.16 * np.maximum(streaks - 0.6, 0) * (0.4 + lanes), 0, 0.7)
    picture[rows] *= (1 - rubber)[..., None]

    # White lines along both borders, worn.
    line = edge(0.085 - np.abs(np.abs(across_m) - (ground.half_width_m - 0.25)), 0.02)
    worn = np.clip(0.85 + 0.12 * fractal(rng, road_shape, 0.9, 120.0, shortest_px=3.0), 0, 1)
    lay(picture[rows], _PAINT_WHITE, np.asarray(line * worn, dtype=np.float32))
    return bounded(picture)


def paint_start(rng: np.random.Generator, shape: Shape, ground: TrackGround) -> Image:
    """Paint the same with a chequered line and the places of the grid before it."""
    picture = paint_straight(rng, shape, ground)
    x_m, y_m = ground.area.coordinates_m(shape)
    worn = 0.72 + 0.10 * fractal(np.random.default_rng(_PAINT_SEED + 1), shape, 1.0, 200.0)
    on_road = np.abs(y_m) < ground.half_width_m - 0.42
    line = on_road & (np.abs(x_m - ground.start_x_m) < 0.8)
    odd = (np.floor(x_m / 0.4) + np.floor(y_m / 0.4)) % 2 == 1
    lay(picture, (0.10, 0.10, 0.10), worn * line)
    lay(picture, _PAINT_WHITE, worn * (line & odd))
    for number, center_x in enumerate(ground.grid_x_m):
        across_m = y_m - (ground.grid_y_m if number % 2 else -ground.grid_y_m)
        front = (np.abs(x_m - center_x) < 0.08) & (np.abs(across_m) < 1.0)
        sides = (np.abs(np.abs(across_m) - 0.93) < 0.07) & (np.abs(x_m - center_x + 0.5) < 0.5)
        lay(picture, _PAINT_WHITE, worn * (front | sides))
    return bounded(picture)


def paint_asphalt(rng: np.random.Generator, shape: Shape) -> Image:
    """Paint stones in tar with lighter and darker patches."""
    tile = (384, 384)
    bed = between(fractal(rng, tile, 1.0, 128.0), (0.13, 0.13, 0.14), (0.27, 0.27, 0.28))
    stones = speckled(rng, flakes(rng, bed, 14000, 2.8, 2.2, _STONES), 0.08)
    patches = fractal(rng, shape, 1.2, 600.0, shortest_px=24.0, stretch=(1.0, 2.0))
    return np.asarray(tiled(stones, shape) * np.exp(0.16 * patches)[..., None], dtype=np.float32)


_RED: Final[Rgb] = (0.62, 0.08, 0.06)
_WHITE: Final[Rgb] = (0.82, 0.81, 0.78)
_BLUE: Final[Rgb] = (0.08, 0.18, 0.52)
_ORANGE: Final[Rgb] = (0.80, 0.30, 0.05)
_YELLOW: Final[Rgb] = (0.82, 0.66, 0.10)
_BLACK: Final[Rgb] = (0.06, 0.06, 0.07)

# What is painted on the map of the ground, one period of the straight: the track, its lines, the start and its grid.
GROUND: Final = TrackGround(
    area=MapArea(x_m=(-4.8, 19.2), y_m=(-9.6, 9.6), texel_m=0.0125),
    half_width_m=4.0,
    verge_y_m=5.1,
    start_x_m=16.0,
    grid_x_m=(13.4, 11.0, 8.6, 6.2, 3.8),
    grid_y_m=1.7,
)

BOARDS: Final = ("fedora board", "event board", "photon board", "flow board")

TREES_M: Final = (
    *((-2, 15), (4, 19), (9, 14.5), (-1, -13), (5, -17), (64, 17), (70, 21), (77, 16), (84, 20), (80, -16), (88, -18)),
    *((96, -14), (104, -16), (112, -12), (141, -8), (144, 2), (143, 12), (145, 22), (139, -16), (92, 22), (99, 26)),
)

RACETRACK: Final = PlaceDescription(
    materials={
        "straight": Material(partial(paint_straight, ground=GROUND), GROUND.area.size_m, GROUND.area.texel_m),
        "start": Material(partial(paint_start, ground=GROUND), GROUND.area.size_m, GROUND.area.texel_m),
        "asphalt": Material(paint_asphalt, (9.6, 9.6), 0.025),
        "kerb": Material(bands((_RED, _WHITE), vertical=True), (2.0, 1.0)),
        "orange panel": Material(checks(_ORANGE, _WHITE), (0.84, 0.84)),
        "blue panel": Material(checks(_BLUE, _WHITE), (0.84, 0.84)),
        "yellow panel": Material(checks(_YELLOW, _BLACK), (0.84, 0.84)),
        "orange light": Material(
            noisy((0.5, 0.4, 0.3), (0.8, 0.6, 0.4)), (0.64, 0.64), emission_rgb=(0.62, 0.24, 0.06)
        ),
        "blue light": Material(noisy((0.3, 0.4, 0.5), (0.4, 0.6, 0.8)), (0.64, 0.64), emission_rgb=(0.10, 0.34, 0.70)),
        "yellow light": Material(
            noisy((0.5, 0.5, 0.3), (0.8, 0.8, 0.4)), (0.64, 0.64), emission_rgb=(0.60, 0.50, 0.10)
        ),
        "red light": Material(
            noisy((0.3, 0.05, 0.04), (0.6, 0.1, 0.08)), (0.64, 0.64), emission_rgb=(0.60, 0.05, 0.03)
        ),
        "flood glass": Material(noisy((0.6, 0.6, 0.6), (0.9, 0.9, 0.9)), (0.64, 0.64), emission_rgb=(0.60, 0.60, 0.56)),
        "tyre": Material(noisy((0.04, 0.04, 0.045), (0.20, 0.20, 0.21), 0.8), (1.28, 1.28)),
        "white tyre": Material(noisy((0.48, 0.47, 0.45), (0.82, 0.81, 0.78), 0.8), (1.28, 1.28)),
        "red tyre": Material(noisy((0.34, 0.04, 0.03), (0.64, 0.12, 0.09), 0.8), (1.28, 1.28)),
        "start board": Material(board(_BLACK, "START   FINISH", _WHITE), (9.6, 1.2)),
        "pit sign": Material(board(_YELLOW, "PIT", _BLACK), (1.6, 0.56)),
        "roof edge": Material(board(_BLUE, "FEDORA CUP", _WHITE), (9.0, 0.9), 0.02),
        "fedora board": Material(board(_RED, "FEDORA", _WHITE), (3.96, 0.9)),
        "event board": Material(board(_WHITE, "EVENT CUP", _BLUE), (3.96, 0.9)),
        "photon board": Material(board(_BLUE, "PHOTON", _YELLOW), (3.96, 0.9)),
        "flow board": Material(board(_YELLOW, "FLOW x 50", _BLACK), (3.96, 0.9)),
        "arch cloth": Material(bands((_RED, _WHITE, _BLUE, _WHITE)), (4.0, 4.0), 0.02),
        "blue seat": Material(noisy((0.08, 0.16, 0.40), (0.18, 0.32, 0.66)), (1.28, 1.28), 0.02),
        "white seat": Material(noisy((0.52, 0.52, 0.50), (0.84, 0.83, 0.80)), (1.28, 1.28), 0.02),
        "red seat": Material(noisy((0.40, 0.06, 0.05), (0.68, 0.16, 0.12)), (1.28, 1.28), 0.02),
        "shutter": Material(bands(((0.42, 0.44, 0.46), (0.60, 0.62, 0.64), (0.52, 0.54, 0.56))), (0.9, 0.3)),
        "cone orange": Material(noisy((0.66, 0.20, 0.04), (0.90, 0.36, 0.10)), (0.64, 0.64)),
        "red cloth": Material(bands((_RED, _WHITE, _RED), vertical=True), (1.2, 1.2), two_sided=True),
        "blue cloth": Material(bands((_BLUE, _YELLOW), vertical=False), (1.2, 1.2), two_sided=True),
        "chequered cloth": Material(checks(_BLACK, _WHITE, 4), (1.2, 1.2), two_sided=True),
    },
    objects=(
        # The ground as far as the hills.
        partial(plain, material="lawn", hole_x_m=(-28.8, 91.2), hole_y_m=GROUND.area.y_m, reach_m=700.0),
        partial(hills, material="far hills", radius_m=(300.0, 650.0), height_m=60.0),
        partial(wood_line, count=120, radius_m=(150.0, 210.0), height_m=(10.0, 18.0)),
        # Five periods of the straight with their kerbs, the start among them, and the bend at the end.
        partial(map_sheet, area=GROUND.area, material="start"),
        objects(
            partial(map_sheet, area=GROUND.area, material="straight"),
            at_m=((-24.0, 0.0), (24.0, 0.0), (48.0, 0.0), (72.0, 0.0)),
        ),
        objects(partial(kerb, length_m=96.0), at_m=((43.2, 4.0),)),
        objects(partial(kerb, length_m=96.0), at_m=((43.2, -4.0),), yaw_deg=180.0),
        partial(
            road_bend,
            material="asphalt",
            center_m=(91.2, 34.0),
            radius_m=34.0,
            half_width_m=4.0,
            bearings_deg=(-90.0, 27.0),
            z_m=0.03,
        ),
        # Gates along the straight, shifted as the course winds, and what stands over the track.
        objects(partial(gate, colour="orange"), at_m=((7.5, 0.0),)),
        objects(partial(gate, colour="blue"), at_m=((20.5, 0.2),)),
        objects(partial(gate, colour="yellow"), at_m=((31.5, -0.2),)),
        objects(partial(gate, colour="orange"), at_m=((43.5, 0.2),)),
        objects(partial(gate, colour="blue"), at_m=((56.5, 0.0),)),
        objects(partial(gate, colour="yellow"), at_m=((70.0, 0.0),)),
        objects(partial(gantry, half_width_m=5.9, height_m=4.3), at_m=((GROUND.start_x_m, 0.0),)),
        objects(partial(arch, radius_m=6.2, thickness_m=0.55), at_m=((38.0, 0.0),)),
        # Walls, boards and cones beside the track.
        objects(partial(tyre_wall, length_m=31.0), at_m=((12.5, 6.7),)),
        objects(partial(tyre_wall, length_m=24.8), at_m=((58.0, 6.7),)),
        objects(partial(barrier, length_m=76.0), at_m=((40.0, -6.9),)),
        objects(partial(tyre_wall, length_m=9.3), at_m=((-1.0, -6.6),)),
        objects(partial(tyre_wall, length_m=12.4), at_m=((88.0, -6.2),)),
        objects(partial(boards, materials=BOARDS, count=18), at_m=((34.0, 8.3),)),
        objects(
            cone,
            at_m=(
                *((3.0, 5.3), (3.8, -5.4), (16.2, 5.2), (17.8, 5.3), (24.0, -5.3), (25.2, -5.2)),
                *((34.8, 5.3), (47.0, -5.3), (48.5, -5.3)),
            ),
        ),
        # Buildings, and the asphalt before the pits.
        objects(partial(grandstand, length_m=46.0, rows=9), at_m=((37.0, 10.6),)),
        objects(partial(pits, length_m=48.0, garages=10), at_m=((36.0, -15.6),), yaw_deg=180.0),
        objects(control_tower, at_m=((70.0, -14.5),), yaw_deg=180.0),
        partial(level_sheet, material="asphalt", x_m=(8.0, 84.0), y_m=(-11.2, -9.7), z_m=0.03),
        # A wall at the bend closes the view.
        objects(partial(tyre_wall, length_m=30.0, tyres=5), at_m=((131.5, 8.0),), yaw_deg=-84.0),
        objects(partial(boards, materials=BOARDS, count=9), at_m=((133.5, 6.0),), yaw_deg=-84.0),
        # Flags and floodlights.
        objects(partial(feather_flag, material="red cloth"), at_m=((5.0, 5.6),), yaw_deg=65.0),
        objects(partial(feather_flag, material="blue cloth"), at_m=((11.0, -5.9),), yaw_deg=-70.0),
        objects(partial(feather_flag, material="chequered cloth"), at_m=((18.5, -5.9),), yaw_deg=-70.0),
        objects(partial(feather_flag, material="red cloth"), at_m=((28.5, 5.7),), yaw_deg=65.0),
        objects(partial(feather_flag, material="blue cloth"), at_m=((45.0, -5.8),), yaw_deg=-70.0),
        objects(partial(flag, material="red cloth", height_m=9.5), at_m=((14.5, 19.6),), yaw_deg=-65.0),
        objects(partial(flag, material="blue cloth", height_m=9.5), at_m=((22.0, 19.6),), yaw_deg=-65.0),
        objects(partial(flag, material="chequered cloth", height_m=9.5), at_m=((37.0, 19.6),), yaw_deg=-65.0),
        objects(partial(flag, material="red cloth", height_m=9.5), at_m=((52.0, 19.6),), yaw_deg=-65.0),
        objects(partial(flag, material="blue cloth", height_m=9.5), at_m=((59.5, 19.6),), yaw_deg=-65.0),
        objects(partial(flood_mast, strength=55.0), at_m=((5.0, 9.4), (33.0, 9.4), (62.0, 9.4), (90.0, 9.4))),
        objects(partial(flood_mast, strength=55.0), at_m=((9.0, -8.6), (62.0, -8.6), (92.0, -8.6)), yaw_deg=180.0),
        partial(grove, spots_m=TREES_M),
    ),
)
