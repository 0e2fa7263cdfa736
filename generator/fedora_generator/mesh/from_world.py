"""The world of rectangles and boxes as textured triangles: the scene that both renderers can draw.

Each face is cut into cells, small near the path of the camera and large far from it, and each cell gets an image of
its procedural texture, averaged over every texel in closed form.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.mesh.model import MeshModel, TexturedMesh
from fedora_generator.mesh.texel_kernels import average_over_texels
from fedora_generator.surfaces.faces import Faces, faces_of
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.textures import texture_table
from fedora_generator.surfaces.world import World

Floats = NDArray[np.float64]

FINEST_TEXEL_RAD: Final = 2e-3
"""Least size of a texel over its distance from the path: an event pixel of 640 is 1.8e-3 wide, and longer on the
ground ahead. Halving it takes four times the memory: the park has 30 million texels."""

FINEST_TEXEL_M: Final = 0.002

CELL_TEXELS: Final = 512
MARGIN_TEXELS: Final = 8
"""Texels around a cell that show its neighbours, so that filters do not see its border; a power of two above the
factor by which mipmaps reduce near the camera."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A part of face ``face``: its lowest and highest u and v (2,), metres from the face's centre, and its texels."""

    face: int
    low_m: Floats
    high_m: Floats
    texel_m: float


def model_of_world(world: World, path_world_m: Floats, *, texel_rad: float = FINEST_TEXEL_RAD) -> MeshModel:
    """Triangles that show a world to a camera whose path is ``path_world_m`` (n, 3)."""
    faces, textures = faces_of(world), texture_table(list(world.textures.values()))
    colours = [np.array([texture.dark_rgb, texture.light_rgb]) for texture in world.textures.values()]
    meshes = [
        _mesh_of(cell, faces, textures, colours[faces.textures[cell.face]])
        for face in range(len(faces.textures))
        for cell in _cells_of(face, faces, path_world_m, texel_rad)
    ]
    return MeshModel(name=world.name, meshes=tuple(meshes), lamps=world.lamps, solids=world.boxes)


def _cells_of(face: int, faces: Faces, path_world_m: Floats, texel_rad: float) -> Iterator[Cell]:
    """Cells of a face, none with more than ``CELL_TEXELS`` along a side."""
    offsets_m = path_world_m - faces.centers_m[face]
    axes = np.stack([faces.u_axes[face], faces.v_axes[face], faces.normals[face]])
    path_face_m = offsets_m @ axes.T
    waiting = [(-faces.half_sizes_m[face], faces.half_sizes_m[face])]
    while waiting:
        low_m, high_m = waiting.pop()
        texel_m = max(FINEST_TEXEL_M, texel_rad * _distance_m(path_face_m, low_m, high_m))
        longest = int(np.argmax(high_m - low_m))
        if (high_m - low_m)[longest] <= CELL_TEXELS * texel_m:
            yield Cell(face, low_m, high_m, texel_m)
            continue
        below_m, above_m = high_m.copy(), low_m.copy()
        below_m[longest] = above_m[longest] = 0.5 * (low_m + high_m)[longest]
        waiting += [(low_m, below_m), (above_m, high_m)]


def _distance_m(path_face_m: Floats, low_m: Floats, high_m: Floats) -> float:
    """Distance from a rectangle of the plane to the nearest point (n, 3) of the path: along u, v and the normal."""
    beside_m = np.maximum(0.0, np.maximum(low_m - path_face_m[:, :2], path_face_m[:, :2] - high_m))
    return float(np.sqrt((beside_m**2).sum(axis=-1) + path_face_m[:, 2] ** 2).min())


def _mesh_of(cell: Cell, faces: Faces, textures: TextureTable, dark_and_light_rgb: Floats) -> TexturedMesh:
    """Two triangles and their image."""
    size_m = cell.high_m - cell.low_m
    # Sides in multiples of 16 texels, so that the first mipmaps halve them without a rest.
    sides = 16 * np.ceil((size_m / cell.texel_m + 2 * MARGIN_TEXELS) / 16).astype(np.int64)
    texel_m = size_m / (sides - 2 * MARGIN_TEXELS)
    first_m = cell.low_m + (0.5 - MARGIN_TEXELS) * texel_m
    s = np.empty((sides[1], sides[0]))
    texture = int(faces.textures[cell.face])
    wave_offset_m = tuple(faces.wave_offsets_m[cell.face])
    average_over_texels(textures, texture, tuple(first_m), tuple(texel_m), wave_offset_m, s)
    dark_rgb, light_rgb = dark_and_light_rgb
    margin = MARGIN_TEXELS / sides
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    corners_m = np.where(corners, cell.high_m, cell.low_m)
    return TexturedMesh(
        name=f"face {cell.face}",
        vertices_world_m=faces.centers_m[cell.face] + corners_m @ np.stack([faces.u_axes, faces.v_axes])[:, cell.face],
        normals_world=np.tile(faces.normals[cell.face], (4, 1)),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        uv=np.where(corners, 1 - margin, margin),
        reflectance_rgb=(dark_rgb + s[..., None] * (light_rgb - dark_rgb)).astype(np.float32),
        repeats=False,
    )
