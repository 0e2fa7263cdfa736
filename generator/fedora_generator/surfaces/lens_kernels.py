"""The loops over tiles and pixels of a distorted camera.

Each pixel is rendered as that of a pinhole whose image is the affine map of ``lens.pixel_maps``: its footprint is the
parallelogram that the distortion makes of its square, to first order, and its centre is exact.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fedora_generator.surfaces.pixel_kernels import empty_pieces
from fedora_generator.surfaces.render_kernels import TILE, render_pixel, tile_count, tile_origin
from fedora_generator.surfaces.shading_kernels import Surfaces, View
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.visibility_kernels import W, nearest_face, possible_faces, value


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
    every = np.arange(len(view.lines))
    return possible_faces(view.lines, every, len(every), 0.5 * (left + right), 0.5 * (top + bottom), half, faces)


@njit(parallel=True, cache=True, error_model="numpy")
def render_radiance_through_lens(
    textures: TextureTable,
    surfaces: Surfaces,
    view: View,
    maps: NDArray[np.float64],
    radiance_dn: NDArray[np.float64],
) -> None:
    """Render an image of linear radiance.

    Parameters
    ----------
    textures, surfaces
        Textures and light of the faces.
    view
        Faces as the camera pose projects them to the pinhole's image.
    maps
        (height, width, 3, 3) of ``lens.pixel_maps``.
    radiance_dn
        (height, width, channels) is filled with DN averaged over each pixel.
    """
    height, width = radiance_dn.shape[:2]
    for tile in prange(tile_count(height, width)):
        column, row = tile_origin(tile, width)
        _render_tile(textures, surfaces, view, maps, column, row, radiance_dn)


@njit(cache=True, error_model="numpy")
def _render_tile(
    textures: TextureTable,
    surfaces: Surfaces,
    view: View,
    maps: NDArray[np.float64],
    column: int,
    row: int,
    radiance_dn: NDArray[np.float64],
) -> None:
    """Render the pixels of a tile, each with the lines of the tile's faces in the affine image of that pixel."""
    height, width = radiance_dn.shape[:2]
    in_tile = np.empty(len(view.front), np.int64)
    count, uniform = _faces_of_tile(view, maps, column, row, in_tile)
    front, lines, rays = view.front[in_tile[:count]], np.empty((count, view.lines.shape[1], 3)), np.empty((3, 3))
    local = View(front, lines, rays)
    given, in_pixel, pieces = np.arange(count), np.empty(count + 1, np.int64), empty_pieces(count)
    terms = np.empty(textures.waves.shape[1])
    for y in range(row, min(row + TILE, height)):
        for x in range(column, min(column + TILE, width)):
            _multiply(view.rays, maps[y, x], rays)
            for i in range(count):
                _multiply(view.lines[in_tile[i]], maps[y, x], lines[i])
            pixel_dn = radiance_dn[y, x]
            render_pixel(textures, surfaces, local, given, count, uniform, x, y, in_pixel, pieces, terms, pixel_dn)


@njit(cache=True, error_model="numpy")
def _multiply(rows: NDArray[np.float64], matrix: NDArray[np.float64], product: NDArray[np.float64]) -> None:
    """Fill the product (n, 3) of rows (n, 3) and a matrix (3, 3)."""
    for i in range(len(rows)):
        for j in range(3):
            product[i, j] = rows[i, 0] * matrix[0, j] + rows[i, 1] * matrix[1, j] + rows[i, 2] * matrix[2, j]


@njit(parallel=True, cache=True, error_model="numpy")
def render_centres_through_lens(
    view: View,
    maps: NDArray[np.float64],
    body_of_face: NDArray[np.int64],
    inverse_depth: NDArray[np.float64],
    bodies: NDArray[np.int64],
) -> None:
    """Render inverse depth and the body at each pixel centre.

    Parameters
    ----------
    view, maps
        As in ``render_radiance_through_lens``.
    body_of_face
        (n,) body of each face.
    inverse_depth
        (height, width) is filled with 1 / z, 1/m; 0 for the sky.
    bodies
        (height, width) is filled with the body; 0 for faces at rest and the sky.
    """
    height, width = inverse_depth.shape
    for tile in prange(tile_count(height, width)):
        column, row = tile_origin(tile, width)
        in_tile = np.empty(len(view.front), np.int64)
        count, _ = _faces_of_tile(view, maps, column, row, in_tile)
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                pixel = maps[y, x]
                x_there = pixel[0, 0] * x + pixel[0, 1] * y + pixel[0, 2]
                y_there = pixel[1, 0] * x + pixel[1, 1] * y + pixel[1, 2]
                face = nearest_face(view.lines, in_tile, count, x_there, y_there)
                inverse_depth[y, x] = value(view.lines, face, W, x_there, y_there) if face >= 0 else 0.0
                bodies[y, x] = body_of_face[view.front[face]] if face >= 0 else 0
