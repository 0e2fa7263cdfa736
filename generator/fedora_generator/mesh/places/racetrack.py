"""A racetrack: a straight with gates to fly through, between the grandstand and the pits."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from fedora_generator.mesh.places.ground import LAWN_TILE_M, hills, lawn, plain
from fedora_generator.mesh.places.group import Group, painted, solid, together
from fedora_generator.mesh.places.materials import Material, bands, board, checks, noisy
from fedora_generator.mesh.places.paint import Rgb
from fedora_generator.mesh.places.race_buildings import control_tower, grandstand, pits
from fedora_generator.mesh.places.race_furniture import (
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
from fedora_generator.mesh.places.shapes import height_field, plate
from fedora_generator.mesh.places.track_map import (
    HALF_WIDTH_M,
    START_X_M,
    TRACK_AREA,
    paint_asphalt,
    paint_start,
    paint_straight,
)
from fedora_generator.mesh.places.trees import grove, wood_line

_RED: Final[Rgb] = (0.62, 0.08, 0.06)
_WHITE: Final[Rgb] = (0.82, 0.81, 0.78)
_BLUE: Final[Rgb] = (0.08, 0.18, 0.52)
_ORANGE: Final[Rgb] = (0.80, 0.30, 0.05)
_YELLOW: Final[Rgb] = (0.82, 0.66, 0.10)
_BLACK: Final[Rgb] = (0.06, 0.06, 0.07)

BOARD_NAMES: Final = ("fedora board", "event board", "photon board", "flow board")

RACETRACK_MATERIALS: Final[Mapping[str, Material]] = {
    "straight": Material(paint_straight, TRACK_AREA.size_m, TRACK_AREA.texel_m),
    "start": Material(paint_start, TRACK_AREA.size_m, TRACK_AREA.texel_m),
    "asphalt": Material(paint_asphalt, (9.6, 9.6), 0.025),
    "lawn": Material(lambda _, shape: lawn(shape), (LAWN_TILE_M, LAWN_TILE_M), TRACK_AREA.texel_m),
    "kerb": Material(bands((_RED, _WHITE), vertical=True), (2.0, 1.0)),
    "orange panel": Material(checks(_ORANGE, _WHITE), (0.84, 0.84)),
    "blue panel": Material(checks(_BLUE, _WHITE), (0.84, 0.84)),
    "yellow panel": Material(checks(_YELLOW, _BLACK), (0.84, 0.84)),
    "orange light": Material(noisy((0.5, 0.4, 0.3), (0.8, 0.6, 0.4)), (0.64, 0.64), emission_rgb=(0.62, 0.24, 0.06)),
    "blue light": Material(noisy((0.3, 0.4, 0.5), (0.4, 0.6, 0.8)), (0.64, 0.64), emission_rgb=(0.10, 0.34, 0.70)),
    "yellow light": Material(noisy((0.5, 0.5, 0.3), (0.8, 0.8, 0.4)), (0.64, 0.64), emission_rgb=(0.60, 0.50, 0.10)),
    "red light": Material(noisy((0.3, 0.05, 0.04), (0.6, 0.1, 0.08)), (0.64, 0.64), emission_rgb=(0.60, 0.05, 0.03)),
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
}

STRAIGHT_END_M: Final = TRACK_AREA.x_m[1] + 3 * TRACK_AREA.size_m[0]
BEND_RADIUS_M: Final = 34.0

Spots = tuple[tuple[float, float], ...]
"""Where things stand: x and y, metres."""

_GATES_M: Final[Spots] = ((7.5, 0.0), (20.5, 0.2), (31.5, -0.2), (43.5, 0.2), (56.5, 0.0), (70.0, 0.0))
_CONES_M: Final[Spots] = (
    *((3.0, 5.3), (3.8, -5.4), (16.2, 5.2), (17.8, 5.3), (24.0, -5.3), (25.2, -5.2)),
    *((34.8, 5.3), (47.0, -5.3), (48.5, -5.3)),
)
_FEATHERS_M: Final[Spots] = ((5.0, 5.6), (11.0, -5.9), (18.5, -5.9), (28.5, 5.7), (45.0, -5.8))
_TREES_M: Final[Spots] = (
    *((-2, 15), (4, 19), (9, 14.5), (-1, -13), (5, -17), (64, 17), (70, 21), (77, 16), (84, 20), (80, -16), (88, -18)),
    *((96, -14), (104, -16), (112, -12), (141, -8), (144, 2), (143, 12), (145, 22), (139, -16), (92, 22), (99, 26)),
)


def racetrack(rng: np.random.Generator) -> Group:
    """Build the whole track. The straight leads along x; the start lies ahead of the origin."""
    width_m = TRACK_AREA.size_m[0]
    ground = (
        plain("lawn", (TRACK_AREA.x_m[0] - width_m, STRAIGHT_END_M), TRACK_AREA.y_m, 700.0)
        + hills(rng, "far hills", (300.0, 650.0), 60.0)
        + wood_line(rng, 120, (150.0, 210.0), (10.0, 18.0))
        + solid("ground", (1400.0, 1400.0, 1.0), (0.0, 0.0, -0.5))
    )

    # Periods of the straight with their kerbs, the start among them.
    start = TRACK_AREA.surface("start")
    ((_, sheet),) = start.surfaces
    straight = together(painted("straight", sheet).at(i * width_m, 0.0) for i in (-1, 1, 2, 3))
    long_m = STRAIGHT_END_M - TRACK_AREA.x_m[0]
    middle_m = 0.5 * (STRAIGHT_END_M + TRACK_AREA.x_m[0])
    kerbs = kerb(long_m).at(middle_m, HALF_WIDTH_M) + kerb(long_m).at(middle_m, -HALF_WIDTH_M, yaw_deg=180.0)

    # The bend at the end: an arc of 117 degrees to the left, 3 cm above the grass.
    angles = np.linspace(-0.5 * math.pi, 0.15 * math.pi, 33)
    radii = np.linspace(BEND_RADIUS_M + HALF_WIDTH_M, BEND_RADIUS_M - HALF_WIDTH_M, 3)[:, None]
    x = STRAIGHT_END_M + radii * np.cos(angles)
    y = BEND_RADIUS_M + radii * np.sin(angles)
    points = np.stack([x, y, np.full_like(x, 0.03)], axis=-1)
    bend = painted("asphalt", height_field(points, points[..., :2] * (1.0, -1.0)))

    # Gates along the straight, shifted as the course winds.
    colours = ("orange", "blue", "yellow")
    gates = [gate(f"{colours[i % 3]} panel", f"{colours[i % 3]} light").at(x, y) for i, (x, y) in enumerate(_GATES_M)]
    over_track = [*gates, gantry().at(START_X_M, 0.0), arch().at(38.0, 0.0)]

    walls_left = tyre_wall(31.0).at(12.5, 6.7) + tyre_wall(24.8).at(58.0, 6.7)
    walls_right = barrier(76.0).at(40.0, -6.9) + tyre_wall(9.3).at(-1.0, -6.6) + tyre_wall(12.4).at(88.0, -6.2)
    boards_left = boards(BOARD_NAMES, 18).at(34.0, 8.3)
    cones = [cone().at(x, y) for x, y in _CONES_M]
    stands = (
        grandstand(46.0).at(37.0, 10.6)
        + pits(48.0, 10).at(36.0, -15.6, yaw_deg=180.0)
        + control_tower(rng).at(70.0, -14.5, yaw_deg=180.0)
        + painted("asphalt", plate((8.0, 84.0), (-11.2, -9.7), 0.03))
    )
    # A wall at the bend closes the view.
    far_end = tyre_wall(30.0, 5).at(131.5, 8.0, yaw_deg=-84.0) + boards(BOARD_NAMES, 9).at(133.5, 6.0, yaw_deg=-84.0)

    cloths = ("red cloth", "blue cloth", "chequered cloth")
    flags = [
        feather_flag(cloths[i % 3]).at(x, y, yaw_deg=65.0 if y > 0 else -70.0) for i, (x, y) in enumerate(_FEATHERS_M)
    ]
    flags += [flag(cloths[i % 3], 9.5).at(x, 19.6, yaw_deg=-65.0) for i, x in enumerate((14.5, 22.0, 37.0, 52.0, 59.5))]
    masts = [flood_mast(55.0).at(x, 9.4) for x in (5.0, 33.0, 62.0, 90.0)]
    masts += [flood_mast(55.0).at(x, -8.6, yaw_deg=180.0) for x in (9.0, 62.0, 92.0)]

    return together(
        [
            *(ground, start, straight, kerbs, bend),
            *over_track,
            *(walls_left, walls_right, boards_left, *cones),
            *(stands, far_end, *flags, *masts),
            grove(rng, _TREES_M),
        ]
    )
