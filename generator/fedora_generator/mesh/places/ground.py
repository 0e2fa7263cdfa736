"""The ground in the world frame: sheets, a road, boulders and hills, and what the painters of maps share.

A map is a large picture of the ground around the flight; plain ground continues it as far as the hills. Metres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fedora_generator.mesh.model import GROUND
from fedora_generator.mesh.places.paint import Image, Rgb, Shape, colour, flakes, flat, fractal, speckled
from fedora_generator.mesh.places.shapes import boulder, height_field, plate, turned
from fedora_generator.mesh.places.surface import Group, painted, solid, together

Floats32 = NDArray[np.float32]
Span = tuple[float, float]

LAWN_TILE_M: Final = 4.8
"""The maps begin and end at multiples of it, so that their grass continues in the plain ground around them."""

_LAWN_SEED: Final = 5
_BLADES: Final[tuple[Rgb, ...]] = (
    (0.07, 0.11, 0.03),
    (0.15, 0.24, 0.06),
    (0.22, 0.36, 0.09),
    (0.32, 0.47, 0.14),
    (0.46, 0.56, 0.24),
)


@dataclass(frozen=True, slots=True)
class MapArea:
    """The rectangle of a map in the world, metres. Row 0 of its picture is the border at the largest y."""

    x_m: Span
    y_m: Span
    texel_m: float

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent along x and along y."""
        return self.x_m[1] - self.x_m[0], self.y_m[1] - self.y_m[0]

    def coordinates_m(self, shape: Shape) -> tuple[Floats32, Floats32]:
        """World x (1, w) and y (h, 1) of the texels of a picture."""
        x = self.x_m[0] + (np.arange(shape[1]) + 0.5) / shape[1] * self.size_m[0]
        y = self.y_m[1] - (np.arange(shape[0]) + 0.5) / shape[0] * self.size_m[1]
        return x[None, :].astype(np.float32), y[:, None].astype(np.float32)

    def inside_m(self, x_m: Floats32, y_m: Floats32) -> Floats32:
        """Distance (h, w) to the nearest border, metres."""
        along = np.minimum(x_m - self.x_m[0], self.x_m[1] - x_m)
        return np.asarray(np.minimum(along, np.minimum(y_m - self.y_m[0], self.y_m[1] - y_m)), dtype=np.float32)


def lawn(shape: Shape) -> Image:
    """Blades of grass in clumps, one tile of ``LAWN_TILE_M``: always the same, as maps and plain ground share it."""
    rng = np.random.default_rng(_LAWN_SEED)
    count = round(shape[0] * shape[1] / 9.0)
    blades = flakes(rng, flat(shape, _BLADES[0]), count, 9.0, 2.2, _BLADES)
    clumps = fractal(rng, shape, 1.0, shape[0] / 3, shortest_px=8.0)
    return speckled(rng, blades * np.exp(0.22 * clumps)[..., None], 0.08)


def tiled(tile: Image, shape: Shape) -> Image:
    """Repeat a tile (h, w, c) from the first row and column on until it covers a picture of ``shape``."""
    rows, columns = (-(-whole // part) for whole, part in zip(shape, tile.shape[:2], strict=True))
    return np.tile(tile, (rows, columns, 1))[: shape[0], : shape[1]]


def edge(distance_m: ArrayLike, softness_m: float) -> Floats32:
    """Cover of a shape with a soft border: 0 outside to 1 inside.

    Parameters
    ----------
    distance_m
        (h, w) distance inside the border; negative outside.
    softness_m
        Width of the border.
    """
    share = np.clip(np.asarray(distance_m, dtype=np.float32) / np.float32(softness_m) + np.float32(0.5), 0, 1)
    return np.asarray(share * share * (3 - 2 * share), dtype=np.float32)


def ellipse(x_m: Floats32, y_m: Floats32, center_m: Span, radii_m: Span) -> Floats32:
    """Distance (h, w) inside an ellipse, metres, to first order; negative outside.

    Parameters
    ----------
    x_m, y_m
        (1, w) and (h, 1) coordinates.
    center_m, radii_m
        Along x and y.
    """
    away = np.hypot((x_m - center_m[0]) / radii_m[0], (y_m - center_m[1]) / radii_m[1])
    return np.asarray((1 - away) * min(radii_m), dtype=np.float32)


def shade(picture: Image, area: MapArea, spots: Sequence[tuple[float, float, float, float]]) -> None:
    """Darken the ground in place where objects hide much of the sky.

    Parameters
    ----------
    picture
        (h, w, 3) of the map.
    spots
        x, y and radius (m), and depth (0 to 1), of each shade.
    """
    x_m, y_m = area.coordinates_m((picture.shape[0], picture.shape[1]))
    for center_x, center_y, radius_m, depth in spots:
        columns = np.flatnonzero(np.abs(x_m[0] - center_x) < 2 * radius_m)
        rows = np.flatnonzero(np.abs(y_m[:, 0] - center_y) < 2 * radius_m)
        if not len(columns) or not len(rows):
            continue
        window = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
        squared = ((x_m[:, window[1]] - center_x) ** 2 + (y_m[window[0]] - center_y) ** 2) / radius_m**2
        fade = np.clip(1 - squared / 4, 0, 1) ** 2
        picture[window] *= (1 - depth * fade * np.exp(-squared))[..., None]


def map_sheet(_: np.random.Generator, area: MapArea, material: str) -> Group:
    """Build the map itself, level at z = 0; its picture covers it once."""
    sheet = plate(area.x_m, area.y_m)
    return painted(material, replace(sheet, uv_m=sheet.uv_m - (area.x_m[0], -area.y_m[1])))


def level_sheet(_: np.random.Generator, material: str, x_m: Span, y_m: Span, z_m: float) -> Group:
    """Build a level rectangle between two x and two y at a height."""
    return painted(material, plate(x_m, y_m, z_m))


def plain(_: np.random.Generator, material: str, hole_x_m: Span, hole_y_m: Span, reach_m: float) -> Group:
    """Build level ground at z = 0 around a rectangular hole, in eight parts that share their corners.

    Below it, and below the hole, is a solid of 1 m that a camera must not enter.

    Parameters
    ----------
    hole_x_m, hole_y_m
        Borders of the hole.
    reach_m
        The ground extends to +/- this in x and y.
    """
    xs, ys = (-reach_m, *hole_x_m, reach_m), (-reach_m, *hole_y_m, reach_m)
    parts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    level = together(painted(material, plate((xs[i], xs[i + 1]), (ys[j], ys[j + 1]))) for i, j in parts)
    return level + solid(GROUND, (2 * reach_m, 2 * reach_m, 1.0), (0.0, 0.0, -0.5))


def road_bend(
    _: np.random.Generator,
    material: str,
    center_m: Span,
    radius_m: float,
    half_width_m: float,
    bearings_deg: Span,
    z_m: float,
) -> Group:
    """Build a level road along an arc.

    Parameters
    ----------
    center_m
        x and y of the middle of the arc.
    radius_m, half_width_m
        From the middle of the arc to the middle of the road, and from there to its border.
    bearings_deg
        First and last bearing as seen from the middle of the arc, counter-clockwise from x.
    z_m
        Height.
    """
    angles = np.linspace(math.radians(bearings_deg[0]), math.radians(bearings_deg[1]), 33)
    radii = np.linspace(radius_m + half_width_m, radius_m - half_width_m, 3)[:, None]
    x = center_m[0] + radii * np.cos(angles)
    y = center_m[1] + radii * np.sin(angles)
    points = np.stack([x, y, np.full_like(x, z_m)], axis=-1)
    return painted(material, height_field(points, points[..., :2] * (1.0, -1.0)))


def paved_round(_: np.random.Generator, radius_m: float, height_m: float) -> Group:
    """Build a paved disc about the origin whose top is at a height."""
    return painted("paving", turned([(radius_m, -0.2), (radius_m, height_m), (0.0, height_m)], sides=56))


def boulder_ring(rng: np.random.Generator, center_m: Span, radii_m: Span, count: int, size_m: Span) -> Group:
    """Build ``count`` boulders on an ellipse in the world.

    Parameters
    ----------
    rng
        Draws sizes and shapes.
    center_m, radii_m
        Of the ellipse, along x and y.
    count
        Number of boulders.
    size_m
        Least and largest half axis; the vertical one is 0.7 of it.
    """
    stones = []
    for bearing in np.linspace(0, 2 * np.pi, count + 1)[:-1]:
        x, y = center_m[0] + radii_m[0] * np.cos(bearing), center_m[1] + radii_m[1] * np.sin(bearing)
        size = rng.uniform(*size_m)
        stones.append(painted("stone", boulder((size, size, 0.7 * size), rng, 0.3, cells=5)).at(x, y, 0.2 * size))
    return together(stones)


def hills(rng: np.random.Generator, material: str, radius_m: Span, height_m: float) -> Group:
    """Build a ring of hills about the origin of the world that rises from the ground and closes the horizon.

    Parameters
    ----------
    rng
        Draws the crest.
    material
        Its name.
    radius_m
        Of the foot and of the crest.
    height_m
        Of the highest point.
    """
    bearings = np.linspace(0, 2 * math.pi, 145)
    orders = np.arange(2, 12)
    waves = np.cos(np.outer(bearings, orders) + rng.uniform(0, 2 * math.pi, len(orders))) @ (1 / orders)
    crest_m = height_m * (0.65 + 0.35 * waves / np.abs(waves).max())
    rise = np.linspace(0, 1, 9)
    away_m = radius_m[0] + (radius_m[1] - radius_m[0]) * rise[:, None] * np.ones_like(bearings)
    z_m = -1.0 + (crest_m + 1.0) * (rise**2 * (3 - 2 * rise))[:, None]
    # Columns go clockwise as seen from above, which is to the right as seen from the middle.
    points = np.stack([away_m * np.cos(-bearings), away_m * np.sin(-bearings), z_m], axis=-1)
    uv = np.stack([np.broadcast_to(bearings * radius_m[0], z_m.shape), -away_m], axis=-1)
    return painted(material, height_field(points, uv))


def lay(picture: Image, paint: ArrayLike, cover: Floats32) -> None:
    """Blend a colour or a picture over another, in place.

    Parameters
    ----------
    picture
        (h, w, 3) is changed.
    paint
        (3,) or (h, w, 3).
    cover
        (h, w) weight of the paint, 0 to 1.
    """
    rows, columns = (np.flatnonzero(cover.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return
    window = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    above = colour(paint)
    picture[window] += cover[window][..., None] * ((above if above.ndim == 1 else above[window]) - picture[window])
