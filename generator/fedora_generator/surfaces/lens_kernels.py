"""The loops over tiles and pixels of a distorted camera.

Each pixel is rendered as that of a pinhole whose image is the affine map of ``lens.pixel_maps``: its footprint is the
parallelogram that the distortion makes of its square, to first order, and its centre is exact.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.projection_kernels import LINES_PER_FACE
from fedora_generator.surfaces.render_kernels import TILE, TileScratch, render_pixel, tile_origin, tile_scratch
from fedora_generator.surfaces.shading_kernels import Surfaces, View
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.visibility_kernels import W, nearest_face, possible_faces, value
from fedora_generator.uncounted import UNCOUNTED


class LensScratch(NamedTuple):
    """Scratch space of a thread: that of any image, and its faces as the affine image of a pixel shows them."""

    tile: TileScratch
    given: NDArray[np.int64]
    front: NDArray[np.int64]
    lines: NDArray[np.float64]
    rays: NDArray[np.float64]


def lens_scratch(faces: int, waves: int) -> LensScratch:
    """Return scratch space for images of so many faces, whose textures have so many waves."""
    lists = (np.empty(faces, np.int64), np.empty(faces, np.int64))
    return LensScratch(tile_scratch(faces, waves), *lists, np.empty((faces, LINES_PER_FACE, 3)), np.empty((3, 3)))


@njit(cache=True, error_model="numpy")
def _faces_of_tile(
    view: View, maps: NDArray[np.float64], column: int, row: int, faces: NDArray[np.int64]
) -> tuple[int, bool]:
    """Faces that a tile can show: those in a square of the pinhole's image about its pixels."""
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for y in range(row, min(row + TILE, len(maps))):
        for x in range(column, min(column + TILE, maps.shape[1])):
            pixel = maps[y, x]
            x_there = pixel[0, 0] * x + pixel[0, 1] * y + pixel[0, 2]
            y_there = pixel[1, 0] * x + pixel[1, 1] * y + pixel[1, 2]
            # Half of the pixel's parallelogram reaches so far along each axis.
            reach_x, reach_y = 0.5 * (abs(pixel[0, 0]) + abs(pixel[0, 1])), 0.5 * (abs(pixel[1, 0]) + abs(pixel[1, 1]))
            left, right = min(left, x_there - reach_x), max(right, x_there + reach_x)
            top, bottom = min(top, y_there - reach_y), max(bottom, y_there + reach_y)
    half = 0.5 * max(right - left, bottom - top)
    for index in range(len(view.lines)):
        faces[index] = index
    # The list is shortened in place: a face moves to the front of itself.
    return possible_faces(view.lines, faces, len(view.lines), 0.5 * (left + right), 0.5 * (top + bottom), half, faces)


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def render_radiance_through_lens(
    view: View,
    scratch: LensScratch,
    textures: TextureTable,
    surfaces: Surfaces,
    maps: NDArray[np.float64],
    radiance_dn: NDArray[np.float64],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Render tiles of an image of linear radiance.

    Parameters
    ----------
    view
        Faces as the camera pose projects them to the pinhole's image.
    scratch
        Scratch space of the thread.
    textures, surfaces
        Textures and light of the faces.
    maps
        (height, width, 3, 3) of ``lens.pixel_maps``.
    radiance_dn
        (height, width, channels) is filled with DN averaged over each pixel.
    first_tile, stop_tile
        The tiles, in raster order.
    """
    width = radiance_dn.shape[1]
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        _render_tile(view, scratch, textures, surfaces, maps, column, row, radiance_dn)


@njit(cache=True, error_model="numpy", inline="always", **UNCOUNTED)
def _render_tile(
    view: View,
    scratch: LensScratch,
    textures: TextureTable,
    surfaces: Surfaces,
    maps: NDArray[np.float64],
    column: int,
    row: int,
    radiance_dn: NDArray[np.float64],
) -> None:
    """Render the pixels of a tile, each with the lines of the tile's faces in the affine image of that pixel."""
    height, width = radiance_dn.shape[:2]
    in_tile, in_pixel, pieces, terms = scratch.tile
    count, uniform = _faces_of_tile(view, maps, column, row, in_tile)
    local = View(scratch.front[:count], scratch.lines[:count], scratch.rays)
    for i in range(count):
        local.front[i] = view.front[in_tile[i]]
        scratch.given[i] = i
    for y in range(row, min(row + TILE, height)):
        for x in range(column, min(column + TILE, width)):
            _multiply(view.rays, maps[y, x], local.rays)
            for i in range(count):
                _multiply(view.lines[in_tile[i]], maps[y, x], local.lines[i])
            pixel_dn = radiance_dn[y, x]
            render_pixel(
                textures, surfaces, local, scratch.given, count, uniform, x, y, in_pixel, pieces, terms, pixel_dn
            )


@njit(cache=True, error_model="numpy")
def _multiply(rows: NDArray[np.float64], matrix: NDArray[np.float64], product: NDArray[np.float64]) -> None:
    """Fill the product (n, 3) of rows (n, 3) and a matrix (3, 3)."""
    for i in range(len(rows)):
        for j in range(3):
            product[i, j] = rows[i, 0] * matrix[0, j] + rows[i, 1] * matrix[1, j] + rows[i, 2] * matrix[2, j]


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def render_centres_through_lens(
    view: View,
    scratch: LensScratch,
    maps: NDArray[np.float64],
    body_of_face: NDArray[np.int64],
    inverse_depth: NDArray[np.float64],
    bodies: NDArray[np.int64],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Render inverse depth and the body at each pixel centre of tiles.

    Parameters
    ----------
    view, scratch, maps
        As in ``render_radiance_through_lens``.
    body_of_face
        (n,) body of each face.
    inverse_depth
        (height, width) is filled with 1 / z, 1/m; 0 for the sky.
    bodies
        (height, width) is filled with the body; 0 for faces at rest and the sky.
    first_tile, stop_tile
        The tiles, in raster order.
    """
    height, width = inverse_depth.shape
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        in_tile = scratch.tile.in_tile
        count, _ = _faces_of_tile(view, maps, column, row, in_tile)
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                pixel = maps[y, x]
                x_there = pixel[0, 0] * x + pixel[0, 1] * y + pixel[0, 2]
                y_there = pixel[1, 0] * x + pixel[1, 1] * y + pixel[1, 2]
                face = nearest_face(view.lines, in_tile, count, x_there, y_there)
                inverse_depth[y, x] = value(view.lines, face, W, x_there, y_there) if face >= 0 else 0.0
                bodies[y, x] = body_of_face[view.front[face]] if face >= 0 else 0
