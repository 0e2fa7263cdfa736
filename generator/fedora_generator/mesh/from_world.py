"""The exact world as textured triangles: so that both renderers can draw the same scene.

Each face is cut into cells, small near the path of the camera and large far from it. Each cell has an image of the
face's procedural texture, averaged over every texel in closed form.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.mesh.model import MeshModel, TexturedMesh
from fedora_generator.surfaces.faces import Faces, faces_of
from fedora_generator.surfaces.texture_kernels import TextureTable, steps_average, waves_average
from fedora_generator.surfaces.textures import texture_table
from fedora_generator.surfaces.world import World
from fedora_generator.threads import fill_in_threads

Floats = NDArray[np.float64]

FINEST_TEXEL_RAD: Final = 2e-3
"""Least size of a texel over its distance from the path: an event pixel of 640 is 1.8e-3 wide, and longer on the
ground ahead. Halving it takes four times the memory: the park has 30 million texels."""

FINEST_TEXEL_M: Final = 0.002

CELL_TEXELS: Final = 512
MARGIN_TEXELS: Final = 8
"""Texels around a cell that show its neighbours, so that filters do not reach beyond its image; a power of two above
the factor by which mipmaps reduce near the camera."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A part of face ``face``: its lowest and highest u and v (2,), metres from the face's centre, and its texels."""

    face: int
    low_m: Floats
    high_m: Floats
    texel_m: float


def model_of_world(world: World, path_world_m: Floats, *, texel_rad: float = FINEST_TEXEL_RAD) -> MeshModel:
    """Triangles of a world, with textures as fine as a camera on a path can resolve.

    Parameters
    ----------
    world
        Rectangles and boxes.
    path_world_m
        (n, 3) positions of the camera.
    texel_rad
        Size of a texel over its distance from the path.
    """
    faces, textures = faces_of(world), texture_table(list(world.textures.values()))
    colours = [np.array([texture.dark_rgb, texture.light_rgb]) for texture in world.textures.values()]
    meshes = [
        _mesh_of_cell(cell, faces, textures, colours[faces.textures[cell.face]])
        for face in range(len(faces.textures))
        for cell in _cells_of_face(face, faces, path_world_m, texel_rad)
    ]
    return MeshModel(name=world.name, meshes=tuple(meshes), lamps=world.lamps, solids=world.boxes)


@njit(cache=True, error_model="numpy", nogil=True)
def average_over_texels(
    textures: TextureTable,
    texture: int,
    first_uv_m: tuple[float, float],
    texel_m: tuple[float, float],
    wave_offset_m: tuple[float, float],
    s: NDArray[np.float64],
    first_row: int,
    stop_row: int,
) -> None:
    """Average a texture over the texels of some rows of an image.

    Parameters
    ----------
    textures, texture
        Table of all textures, and the index of one of them.
    first_uv_m
        Centre of the first texel on the face.
    wave_offset_m
        Added to (u, v) for the waves.
    s
        (rows along v, columns along u) is filled with the texture's value, 0 to 1.
    """
    columns = s.shape[1]
    du, dv = texel_m
    for row in range(first_row, stop_row):
        terms = np.empty(textures.waves.shape[1])
        v = first_uv_m[1] + row * dv
        for column in range(columns):
            u = first_uv_m[0] + column * du
            waves = waves_average(
                textures, texture, u + wave_offset_m[0], v + wave_offset_m[1], du, 0.0, 0.0, dv, terms
            )
            s[row, column] = 0.5 + waves + steps_average(textures, texture, u, v, du, 0.0, 0.0, dv)


def _cells_of_face(face: int, faces: Faces, path_world_m: Floats, texel_rad: float) -> list[Cell]:
    """Cut a face into cells, none with more than ``CELL_TEXELS`` along a side."""
    offsets_m = path_world_m - faces.centers_m[face]
    axes = np.stack([faces.u_axes[face], faces.v_axes[face], faces.normals[face]])
    path_face_m = offsets_m @ axes.T
    cells = []
    queue = [(-faces.half_sizes_m[face], faces.half_sizes_m[face])]
    while queue:
        low_m, high_m = queue.pop()
        # Distance from the rectangle to the nearest point of the path: along u, v and the normal.
        beside_m = np.maximum(0.0, np.maximum(low_m - path_face_m[:, :2], path_face_m[:, :2] - high_m))
        distance_m = float(np.sqrt((beside_m**2).sum(axis=-1) + path_face_m[:, 2] ** 2).min())
        texel_m = max(FINEST_TEXEL_M, texel_rad * distance_m)
        longest = int(np.argmax(high_m - low_m))
        if (high_m - low_m)[longest] <= CELL_TEXELS * texel_m:
            cells.append(Cell(face, low_m, high_m, texel_m))
        else:
            below_m, above_m = high_m.copy(), low_m.copy()
            below_m[longest] = above_m[longest] = 0.5 * (low_m + high_m)[longest]
            queue += [(low_m, below_m), (above_m, high_m)]
    return cells


def _mesh_of_cell(cell: Cell, faces: Faces, textures: TextureTable, dark_and_light_rgb: Floats) -> TexturedMesh:
    """Two triangles and their image."""
    size_m = cell.high_m - cell.low_m
    # Sides in multiples of 16 texels, so that the first four mipmaps halve them without remainder.
    sides = 16 * np.ceil((size_m / cell.texel_m + 2 * MARGIN_TEXELS) / 16).astype(np.int64)
    texel_m = size_m / (sides - 2 * MARGIN_TEXELS)
    first_m = cell.low_m + (0.5 - MARGIN_TEXELS) * texel_m
    s = np.empty((sides[1], sides[0]))
    texture = int(faces.textures[cell.face])
    wave_offset_m = tuple(faces.wave_offsets_m[cell.face])
    grid = (tuple(first_m), tuple(texel_m), wave_offset_m)
    fill_in_threads(average_over_texels, len(s), textures, texture, *grid, s)
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
