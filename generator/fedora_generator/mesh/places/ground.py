"""The ground: a large picture around the flight, painted as a map, and plain ground as far as the hills."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fedora_generator.mesh.places.group import Group, painted, together
from fedora_generator.mesh.places.paint import Image, Shape, colour, flakes, flat, fractal, speckled
from fedora_generator.mesh.places.shapes import height_field, plate

Floats32 = NDArray[np.float32]
Span = tuple[float, float]

LAWN_TILE_M = 4.8
"""The maps begin and end at multiples of it, so that their grass continues in the plain ground around them."""

_LAWN_SEED = 5
_BLADES = ((0.07, 0.11, 0.03), (0.15, 0.24, 0.06), (0.22, 0.36, 0.09), (0.32, 0.47, 0.14), (0.46, 0.56, 0.24))


@dataclass(frozen=True, slots=True)
class MapArea:
    """The rectangle of a map. Row 0 of its picture is the border at the largest y."""

    x_m: Span
    y_m: Span
    texel_m: float

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along x and height along y."""
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

    def surface(self, material: str) -> Group:
        """Build the map itself, level at 0."""
        sheet = plate(self.x_m, self.y_m)
        return painted(material, replace(sheet, uv_m=sheet.uv_m - (self.x_m[0], -self.y_m[1])))


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
    area
        Of the map.
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


def plain(material: str, hole_x_m: Span, hole_y_m: Span, reach_m: float) -> Group:
    """Build level ground around a rectangular hole, in eight parts that share their corners.

    Parameters
    ----------
    material
        Its name.
    hole_x_m, hole_y_m
        Borders of the hole.
    reach_m
        The ground extends to +/- this in x and y.
    """
    xs, ys = (-reach_m, *hole_x_m, reach_m), (-reach_m, *hole_y_m, reach_m)
    parts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    return together(painted(material, plate((xs[i], xs[i + 1]), (ys[j], ys[j + 1]))) for i, j in parts)


def hills(rng: np.random.Generator, material: str, radius_m: Span, height_m: float) -> Group:
    """Build a ring of hills that rises from the ground and closes the horizon.

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
