"""Surfaces of triangles before painting, and groups of painted surfaces that are placed together."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fedora_generator.surfaces.world import Box, Lamp, Vector

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles in a frame of their own, metres, counter-clockwise as seen from the front.

    ``uv_m`` runs u to the right and v downwards on an upright surface, so that pictures stand upright.
    """

    vertices_m: Floats
    """(n, 3)"""
    normals: Floats
    """(n, 3), unit, to the front"""
    triangles: NDArray[np.int32]
    """(m, 3)"""
    uv_m: Floats
    """(n, 2)"""


def quads(corners_m: ArrayLike, uv_m: ArrayLike | None = None, normals: ArrayLike | None = None) -> Surface:
    """Build quadrilaterals.

    Parameters
    ----------
    corners_m
        (k, 4, 3) each from lower left to lower right, upper right and upper left, seen from the front.
    uv_m
        (k, 4, 2) texture coordinates; without them, each quadrilateral is a rectangle with its origin at its upper left
        corner.
    normals
        (k, 4, 3) unit; without them, each quadrilateral is flat.
    """
    corners = np.asarray(corners_m, dtype=np.float64)
    flat = unit(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))
    if uv_m is None:
        width = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1)
        height = np.linalg.norm(corners[:, 3] - corners[:, 0], axis=-1)
        zero = np.zeros_like(width)
        uv = np.moveaxis(np.array([[zero, height], [width, height], [width, zero], [zero, zero]]), -1, 0)
    else:
        uv = np.asarray(uv_m, dtype=np.float64)
    to_front = np.repeat(flat[:, None], 4, axis=1) if normals is None else np.asarray(normals, dtype=np.float64)
    first = 4 * np.arange(len(corners), dtype=np.int32)[:, None]
    triangles = np.concatenate([first + np.array(corner) for corner in ((0, 1, 2), (0, 2, 3))]).astype(np.int32)
    return Surface(corners.reshape(-1, 3), to_front.reshape(-1, 3), triangles, uv.reshape(-1, 2))


def fan(corners_m: ArrayLike) -> Surface:
    """Build a flat convex polygon (k, 3), counter-clockwise; u goes right and v down (level: x and -y)."""
    corners = np.asarray(corners_m, dtype=np.float64)
    normal = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    right = np.array([1.0, 0.0, 0.0]) if abs(normal[2]) > 0.99 else unit(np.cross([0.0, 0.0, 1.0], normal))
    uv = np.stack([corners @ right, -corners @ np.cross(normal, right)], axis=-1)
    inner = np.arange(1, len(corners) - 1, dtype=np.int32)
    triangles = np.stack([np.zeros_like(inner), inner, inner + 1], axis=-1)
    return Surface(corners, np.tile(normal, (len(corners), 1)), triangles, uv - uv.min(axis=0))


def joined(surfaces: Sequence[Surface]) -> Surface:
    """All surfaces as one."""
    starts = np.cumsum([0, *(len(surface.vertices_m) for surface in surfaces)])
    return Surface(
        np.concatenate([surface.vertices_m for surface in surfaces]),
        np.concatenate([surface.normals for surface in surfaces]),
        np.concatenate(
            [surface.triangles + np.int32(start) for surface, start in zip(surfaces, starts[:-1], strict=True)]
        ),
        np.concatenate([surface.uv_m for surface in surfaces]),
    )


def moved(surface: Surface, position_m: ArrayLike = (0.0, 0.0, 0.0), yaw_deg: float = 0.0) -> Surface:
    """Return the surface rotated about the vertical, then shifted.

    Parameters
    ----------
    position_m
        (3,) shift.
    yaw_deg
        Rotation, counter-clockwise.
    """
    R = yaw_matrix(yaw_deg)
    vertices_m = surface.vertices_m @ R.T + np.asarray(position_m, dtype=np.float64)
    return Surface(vertices_m, surface.normals @ R.T, surface.triangles, surface.uv_m)


def yaw_matrix(yaw_deg: float) -> Floats:
    """Rotation (3, 3) about the vertical."""
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def unit(vectors: ArrayLike) -> Floats:
    """Vectors (..., n) scaled to length 1."""
    values = np.asarray(vectors, dtype=np.float64)
    return np.asarray(values / np.linalg.norm(values, axis=-1, keepdims=True))


@dataclass(frozen=True, slots=True)
class Group:
    """Surfaces by the name of their material, with the lamps and solids that belong to them."""

    surfaces: tuple[tuple[str, Surface], ...] = ()
    lamps: tuple[Lamp, ...] = ()
    solids: tuple[Box, ...] = ()

    def __add__(self, other: "Group") -> "Group":
        return Group(self.surfaces + other.surfaces, self.lamps + other.lamps, self.solids + other.solids)

    def at(self, x_m: float, y_m: float, z_m: float = 0.0, yaw_deg: float = 0.0) -> "Group":
        """Return the group rotated about the vertical, then shifted."""
        shift_m = np.array([x_m, y_m, z_m])

        def place(position_m: Vector) -> Vector:
            x, y, z = (yaw_matrix(yaw_deg) @ position_m + shift_m).tolist()
            return x, y, z

        return Group(
            tuple((material, moved(surface, shift_m, yaw_deg)) for material, surface in self.surfaces),
            tuple(replace(lamp, position_m=place(lamp.position_m)) for lamp in self.lamps),
            tuple(
                replace(solid, center_m=place(solid.center_m), yaw_deg=solid.yaw_deg + yaw_deg) for solid in self.solids
            ),
        )


def painted(material: str, *surfaces: Surface) -> Group:
    """Surfaces of one material."""
    return Group(tuple((material, surface) for surface in surfaces))


def solid(name: str, size_m: Vector, center_m: Vector) -> Group:
    """Build an upright box that a camera must not enter; nothing is drawn.

    Parameters
    ----------
    name
        For the message of a collision.
    size_m
        Along the box's own x, y and z.
    """
    return Group(solids=(Box(name=name, center_m=center_m, size_m=size_m, texture=name),))


def together(groups: Iterable[Group]) -> Group:
    """All groups as one."""
    parts = list(groups)
    return Group(
        tuple(item for part in parts for item in part.surfaces),
        tuple(lamp for part in parts for lamp in part.lamps),
        tuple(box for part in parts for box in part.solids),
    )
