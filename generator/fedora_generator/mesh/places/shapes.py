"""Shapes of the objects of places: boxes, prisms, turned profiles, tubes, boulders and loose leaves."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from fedora_generator.mesh.places.surface import Floats, Surface, fan, joined, quads, unit

Point = tuple[float, float, float]

# Axes (right, up) of the six faces of a cube as seen from outside; the outward normal is right x up.
_CUBE_FACES: Final = np.array(
    [
        [[0, 1, 0], [0, 0, 1]],  # +x
        [[0, -1, 0], [0, 0, 1]],  # -x
        [[-1, 0, 0], [0, 0, 1]],  # +y
        [[1, 0, 0], [0, 0, 1]],  # -y
        [[1, 0, 0], [0, 1, 0]],  # +z
        [[1, 0, 0], [0, -1, 0]],  # -z
    ],
    dtype=np.float64,
)
_SQUARE: Final = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)


def box(size_m: ArrayLike, center_m: ArrayLike = (0.0, 0.0, 0.0)) -> Surface:
    """Build a closed box, ``size_m`` along x, y and z."""
    half_m = 0.5 * np.asarray(size_m, dtype=np.float64)
    right, up = _CUBE_FACES[:, None, 0], _CUBE_FACES[:, None, 1]
    on_cube = np.cross(right, up) + _SQUARE[None, :, :1] * right + _SQUARE[None, :, 1:] * up
    return quads(on_cube * half_m + np.asarray(center_m, dtype=np.float64))


def standing_box(size_m: Point, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> Surface:
    """Build a box whose bottom is at ``z_m``."""
    return box(size_m, (x_m, y_m, z_m + 0.5 * size_m[2]))


def plate(x_m: tuple[float, float], y_m: tuple[float, float], z_m: float = 0.0) -> Surface:
    """Build a level rectangle that faces up; its texture lies fixed in the world: u along x, v against y."""
    (x0, x1), (y0, y1) = x_m, y_m
    corners = np.array([[[x0, y0, z_m], [x1, y0, z_m], [x1, y1, z_m], [x0, y1, z_m]]])
    return quads(corners, uv_m=corners[..., :2] * (1.0, -1.0))


def prism(outline_m: ArrayLike, length_m: float) -> Surface:
    """Extrude an outline along x, about the origin.

    Parameters
    ----------
    outline_m
        (k, 2) y and z of a convex outline, counter-clockwise as seen from +x.
    length_m
        Along x.
    """
    outline = np.asarray(outline_m, dtype=np.float64)
    front = np.insert(outline, 0, 0.5 * length_m, axis=1)
    back = front * (-1.0, 1.0, 1.0)
    here, following = np.arange(len(front)), np.roll(np.arange(len(front)), -1)
    # The outline runs counter-clockwise seen from +x, so a side seen from outside has +x at its left.
    sides = np.stack([front[here], back[here], back[following], front[following]], axis=1)
    return joined([quads(sides), fan(front), fan(back[::-1])])


def turned(profile_m: ArrayLike, sides: int = 12) -> Surface:
    """Turn a profile about the vertical: smooth around it, with edges between the parts of the profile.

    Parameters
    ----------
    profile_m
        (k, 2) radius and height; the outside is at the right of the way along it. The surface is closed if the profile
        starts and ends on the axis.
    sides
        Quadrilaterals around.
    """
    profile = np.asarray(profile_m, dtype=np.float64)
    around = 2 * math.pi * np.arange(sides + 1) / sides
    circle = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=-1)
    rings = profile[:, None, :1] * circle + profile[:, None, 1:] * [0.0, 0.0, 1.0]
    steps = np.diff(profile, axis=0)
    slopes = unit(np.stack([steps[:, 1], -steps[:, 0]], axis=-1))
    normals = slopes[:, None, :1] * circle + slopes[:, None, 1:] * [0.0, 0.0, 1.0]
    widest_m = 2 * math.pi * float(profile[:, 0].max())
    u = np.broadcast_to(widest_m * np.arange(sides + 1) / sides, rings.shape[:2])
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=-1))])
    v = np.broadcast_to((along_m[-1] - along_m)[:, None], rings.shape[:2])
    corners, uv = _patches(rings), _patches(np.stack([u, v], axis=-1))
    smooth = np.stack([normals[:, :-1], normals[:, 1:], normals[:, 1:], normals[:, :-1]], axis=2)
    surface = quads(corners.reshape(-1, 4, 3), uv.reshape(-1, 4, 2), smooth.reshape(-1, 4, 3))
    # Where the profile meets its axis, triangles shrink to a line: these are left out.
    points = surface.vertices_m[surface.triangles]
    areas = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=-1)
    return Surface(surface.vertices_m, surface.normals, surface.triangles[areas > 1e-12], surface.uv_m)


def cylinder(radius_m: float, height_m: float, sides: int = 12) -> Surface:
    """Build a closed upright cylinder that stands on the origin."""
    return turned([(0.0, 0.0), (radius_m, 0.0), (radius_m, height_m), (0.0, height_m)], sides)


def tube(points_m: Sequence[Point] | Floats, radii_m: Sequence[float] | Floats, sides: int = 8) -> Surface:
    """Build a tube that is open at both ends, which should lie inside other surfaces.

    Parameters
    ----------
    points_m
        (k, 3) along its axis.
    radii_m
        (k,) at each point.
    sides
        Quadrilaterals around.
    """
    points, radii = np.asarray(points_m, dtype=np.float64), np.asarray(radii_m, dtype=np.float64)
    tangents = unit(np.gradient(points, axis=0))
    aside = np.array([1.0, 0.0, 0.0]) if abs(tangents[0, 0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    first = unit(aside - (tangents @ aside)[:, None] * tangents)
    second = np.cross(tangents, first)
    around = 2 * math.pi * np.arange(sides + 1) / sides
    normals = np.cos(around)[:, None] * first[:, None] + np.sin(around)[:, None] * second[:, None]
    rings = points[:, None] + radii[:, None, None] * normals
    u = np.broadcast_to(2 * math.pi * radii.max() * np.arange(sides + 1) / sides, rings.shape[:2])
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1))])
    v = np.broadcast_to((along_m[-1] - along_m)[:, None], rings.shape[:2])
    return quads(
        _patches(rings).reshape(-1, 4, 3),
        _patches(np.stack([u, v], axis=-1)).reshape(-1, 4, 2),
        _patches(normals).reshape(-1, 4, 3),
    )


def boulder(radii_m: ArrayLike, rng: np.random.Generator, roughness: float = 0.15, cells: int = 6) -> Surface:
    """Build an uneven, closed ball: a stone, a bush, a part of a tree's crown.

    The radius in direction d is 1 + sum a cos(k.d + phase), with its exact normal.

    Parameters
    ----------
    radii_m
        (3,) half axes.
    rng
        Draws waves, phases and texture offsets.
    roughness
        Sum of the amplitudes a.
    cells
        Along each edge of the cube that is projected onto the ball: 12 cells^2 triangles.
    """
    waves = unit(rng.normal(size=(8, 3))) * np.geomspace(2.5, 11.0, 8)[:, None]
    phases, amplitudes = rng.uniform(0, 2 * math.pi, 8), np.full(8, roughness / 8)
    ticks = np.linspace(-1, 1, cells + 1)
    up_ticks, right_ticks = np.meshgrid(np.tan(ticks * math.pi / 4), np.tan(ticks * math.pi / 4), indexing="ij")
    right, up = _CUBE_FACES[:, None, None, 0], _CUBE_FACES[:, None, None, 1]
    directions = unit(np.cross(right, up) + right_ticks[..., None] * right + up_ticks[..., None] * up)
    radius = 1 + np.cos(directions @ waves.T + phases) @ amplitudes
    slope = -(np.sin(directions @ waves.T + phases) * amplitudes) @ waves
    slope -= np.sum(slope * directions, axis=-1, keepdims=True) * directions
    scale = np.asarray(radii_m, dtype=np.float64)
    points = radius[..., None] * directions * scale
    normals = unit((radius[..., None] * directions - slope) / scale)
    uv = np.stack(np.broadcast_arrays(right_ticks, -up_ticks), axis=-1) * scale.mean()
    uv_faces = np.broadcast_to(uv, (6, *uv.shape)) + rng.uniform(0, 4, (6, 1, 1, 2))
    corners = [np.stack([_patches(face) for face in faces]) for faces in (points, uv_faces, normals)]
    return quads(*(values.reshape(-1, 4, values.shape[-1]) for values in corners))


def leaves(points_m: Floats, normals: Floats, length_m: float, width_m: float, rng: np.random.Generator) -> Surface:
    """Build loose leaves, pointed and flat, with a random direction that is mostly along the surface.

    Parameters
    ----------
    points_m
        (n, 3) centre of each leaf.
    normals
        (n, 3) unit, of the surface at each point.
    length_m, width_m
        Mean size; each leaf is from 0.7 to 1.3 of it.
    rng
        Draws directions, sizes and texture offsets.
    """
    count = len(points_m)
    facing = unit(normals + 0.6 * rng.normal(size=(count, 3)))
    along = unit(np.cross(facing, rng.normal(size=(count, 3))))
    across = np.cross(facing, along)
    length = 0.5 * length_m * rng.uniform(0.7, 1.3, (count, 1))
    width = 0.5 * width_m * rng.uniform(0.7, 1.3, (count, 1))
    corners = np.stack([-length * along, width * across * -1, length * along, width * across], axis=1)
    uv = np.array([[0, 0.5], [0.5, 1], [1, 0.5], [0.5, 0]]) * (length_m, width_m)
    return quads(points_m[:, None] + corners, uv + rng.uniform(0, 2, (count, 1, 2)))


def roughened(surface: Surface, amplitude_m: float, wavelength_m: float, rng: np.random.Generator) -> Surface:
    """Shift every point of a surface by a smooth random field; the result is faceted. Equal points stay together.

    Parameters
    ----------
    surface
        To be shifted.
    amplitude_m
        Scale of the shift; its standard deviation along each axis is 0.7 of it.
    wavelength_m
        Of the field; its waves are from 1/1.6 to 1/0.6 of it.
    """
    waves = unit(rng.normal(size=(8, 3))) * (2 * math.pi / wavelength_m) * rng.uniform(0.6, 1.6, (8, 1))
    field = np.cos(surface.vertices_m @ waves.T + rng.uniform(0, 2 * math.pi, 8)) @ rng.normal(size=(8, 3))
    vertices_m = surface.vertices_m + amplitude_m * field / math.sqrt(8)
    corners = vertices_m[surface.triangles]
    flat = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    triangles = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    uv_m = surface.uv_m[surface.triangles].reshape(-1, 2)
    return Surface(corners.reshape(-1, 3), np.repeat(flat, 3, axis=0), triangles, uv_m)


def gridded_box(size_m: Point, cell_m: float) -> Surface:
    """Build a closed box that stands on the origin, cut into cells to be roughened."""
    half_m = 0.5 * np.asarray(size_m)
    faces = []
    for right, up in _CUBE_FACES:
        wide, high = (max(1, round(float(np.abs(axis) @ half_m) * 2 / cell_m)) for axis in (right, up))
        up_ticks, right_ticks = np.meshgrid(np.linspace(-1, 1, high + 1), np.linspace(-1, 1, wide + 1), indexing="ij")
        points = (np.cross(right, up) + right_ticks[..., None] * right + up_ticks[..., None] * up) * half_m
        uv = np.stack([points @ np.abs(right), -points @ np.abs(up)], axis=-1)
        faces.append(quads(_patches(points).reshape(-1, 4, 3), _patches(uv).reshape(-1, 4, 2)))
    whole = joined(faces)
    return Surface(whole.vertices_m + half_m * (0, 0, 1), whole.normals, whole.triangles, whole.uv_m)


def height_field(xyz_m: Floats, uv_m: Floats) -> Surface:
    """Build a faceted grid of points (rows, columns, 3); seen from the front, columns go right and rows up."""
    return quads(_patches(xyz_m).reshape(-1, 4, 3), _patches(uv_m).reshape(-1, 4, 2))


def _patches(grid: Floats) -> Floats:
    """Corners (rows - 1, columns - 1, 4, ...) of the cells of a grid whose rows go up and columns to the right."""
    return np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2)
