"""The ground of the racetrack, painted as one picture that repeats along the straight, and once with the start."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_generator.mesh.places.ground import LAWN_TILE_M, MapArea, edge, lawn, lay, tiled
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, between, bounded, flakes, fractal, speckled

_WHITE: Final[Rgb] = (0.80, 0.80, 0.77)
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
    lay(picture[rows], _WHITE, np.asarray(line * worn, dtype=np.float32))
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
    lay(picture, _WHITE, worn * (line & odd))
    for number, center_x in enumerate(ground.grid_x_m):
        across_m = y_m - (ground.grid_y_m if number % 2 else -ground.grid_y_m)
        front = (np.abs(x_m - center_x) < 0.08) & (np.abs(across_m) < 1.0)
        sides = (np.abs(np.abs(across_m) - 0.93) < 0.07) & (np.abs(x_m - center_x + 0.5) < 0.5)
        lay(picture, _WHITE, worn * (front | sides))
    return bounded(picture)


def paint_asphalt(rng: np.random.Generator, shape: Shape) -> Image:
    """Paint stones in tar with lighter and darker patches."""
    tile = (384, 384)
    bed = between(fractal(rng, tile, 1.0, 128.0), (0.13, 0.13, 0.14), (0.27, 0.27, 0.28))
    stones = speckled(rng, flakes(rng, bed, 14000, 2.8, 2.2, _STONES), 0.08)
    patches = fractal(rng, shape, 1.2, 600.0, shortest_px=24.0, stretch=(1.0, 2.0))
    return np.asarray(tiled(stones, shape) * np.exp(0.16 * patches)[..., None], dtype=np.float32)
