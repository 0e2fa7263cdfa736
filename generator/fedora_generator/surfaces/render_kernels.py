"""The loops over tiles and pixels, for a pinhole and for a distorted camera.

Each pixel of a distorted camera is rendered as that of a pinhole whose image is the affine map of
``camera.pixel_maps``: its footprint is the parallelogram that the distortion makes of its square, to first order, and
its centre is exact.
"""

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.pixel_kernels import (
    BUFFER_FULL,
    CUT,
    Pieces,
    empty_pieces,
    face_or_cut,
    piece_footprint,
    start_pieces,
)
from fedora_generator.surfaces.shading_kernels import Surfaces, View, add_face, add_sky
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.visibility_kernels import LINES_PER_FACE, W, nearest_face, possible_faces, value
from fedora_generator.threads import UNCOUNTED

TILE: Final = 16


class TileScratch(NamedTuple):
    """Scratch space of a thread, for the faces of a tile and of a pixel, for pieces, and for the waves of a texture.

    Loops that count no references to arrays (``UNCOUNTED``), which costs more than their arithmetic, cannot make any.
    """

    in_tile: NDArray[np.int64]
    in_pixel: NDArray[np.int64]
    pieces: Pieces
    terms: NDArray[np.float64]


def tile_scratch(faces: int, waves: int) -> TileScratch:
    """Return scratch space for images of so many faces, whose textures have so many waves."""
    return TileScratch(np.empty(faces, np.int64), np.empty(faces, np.int64), empty_pieces(faces), np.empty(waves))


@njit(cache=True, error_model="numpy")
def tile_origin(tile: int, width: int) -> tuple[int, int]:
    """First column and row of a tile.

    Parameters
    ----------
    tile
        Number of the tile, in raster order.
    width
        Of the image, px.
    """
    across = (width + TILE - 1) // TILE
    return tile % across * TILE, tile // across * TILE


def tile_count(height: int, width: int) -> int:
    """Count the tiles of an image of ``height`` x ``width`` pixels."""
    return ((width + TILE - 1) // TILE) * ((height + TILE - 1) // TILE)


@njit(cache=True, error_model="numpy")
def faces_around_tile(
    lines: NDArray[np.float64], column: int, row: int, reach_px: float, faces: NDArray[np.int64]
) -> tuple[int, bool]:
    """Faces that a tile can show.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    column, row
        First pixel of the tile.
    reach_px
        Margin that is added on every side of the tile.
    faces
        (m,) is filled with rows of ``lines``.

    Returns
    -------
    count
        Number of faces.
    uniform
        Whether there is exactly one face, and it fills the tile.
    """
    half = 0.5 * TILE
    for index in range(len(lines)):
        faces[index] = index
    # The list is shortened in place: a face moves to the front of itself.
    return possible_faces(lines, faces, len(lines), column + half - 0.5, row + half - 0.5, half + reach_px, faces)


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def render_radiance(
    view: View,
    scratch: TileScratch,
    textures: TextureTable,
    surfaces: Surfaces,
    radiance_dn: NDArray[np.float64],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Render tiles of an image of linear radiance.

    Parameters
    ----------
    view
        Faces as the camera pose projects them.
    scratch
        Scratch space of the thread.
    textures, surfaces
        Textures and light of the faces.
    radiance_dn
        (height, width, channels) is filled with DN averaged over each pixel.
    first_tile, stop_tile
        The tiles, in raster order.
    """
    height, width = radiance_dn.shape[:2]
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        count, uniform = faces_around_tile(view.lines, column, row, 0.0, scratch.in_tile)
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                pixel_dn = radiance_dn[y, x]
                render_pixel(
                    textures,
                    surfaces,
                    view,
                    scratch.in_tile,
                    count,
                    uniform,
                    x,
                    y,
                    scratch.in_pixel,
                    scratch.pieces,
                    scratch.terms,
                    pixel_dn,
                )


@njit(cache=True, error_model="numpy", inline="always")
def render_pixel(
    textures: TextureTable,
    surfaces: Surfaces,
    view: View,
    given: NDArray[np.int64],
    count: int,
    uniform: bool,
    x: int,
    y: int,
    in_pixel: NDArray[np.int64],
    pieces: Pieces,
    terms: NDArray[np.float64],
    pixel_dn: NDArray[np.float64],
) -> None:
    """Render a pixel.

    Parameters
    ----------
    textures, surfaces, view
        As in ``render_radiance``.
    given
        Rows of ``view.lines``; the pixel shows none but the first ``count``.
    uniform
        Whether there is exactly one face, and it fills the pixel.
    in_pixel, pieces, terms
        Scratch space for faces, for pieces and for the waves of a texture.
    pixel_dn
        (channels,) is filled with linear DN averaged over the pixel.
    """
    pixel_dn[:] = 0.0
    number, filled = count, uniform
    if uniform:
        in_pixel[0] = given[0]
    else:
        number, filled = possible_faces(view.lines, given, count, x, y, 0.5, in_pixel)
    if filled:
        add_face(textures, surfaces, view, in_pixel[0], x, y, 1.0, 0.0, 0.0, 1.0, 1.0, terms, pixel_dn)
    elif number == 0:
        add_sky(surfaces, view, x, y, 1.0, pixel_dn)
    else:
        _add_pieces(textures, surfaces, view, in_pixel, number, x, y, pieces, terms, pixel_dn)


@njit(cache=True, error_model="numpy")
def _add_pieces(
    textures: TextureTable,
    surfaces: Surfaces,
    view: View,
    faces: NDArray[np.int64],
    count: int,
    x: int,
    y: int,
    pieces: Pieces,
    terms: NDArray[np.float64],
    pixel_dn: NDArray[np.float64],
) -> None:
    """Radiance of a pixel that several faces, or a face and the sky, share."""
    start_pieces(pieces)
    last = int(np.int64(0))  # a literal is a type of its own, for which Numba would compile the callees once more
    while last >= 0:
        face = face_or_cut(view.lines, faces, count, x, y, pieces, last)
        if face == CUT:
            last += 1
            continue
        area, dx, dy, a_x, a_y, b_y = piece_footprint(pieces, last)
        if face == BUFFER_FULL:
            face = nearest_face(view.lines, faces, count, x + dx, y + dy)
        if face < 0:
            add_sky(surfaces, view, x + dx, y + dy, area, pixel_dn)
        elif area > 0.0:
            add_face(textures, surfaces, view, face, x + dx, y + dy, a_x, a_y, 0.0, b_y, area, terms, pixel_dn)
        last -= 1


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def render_inverse_depth(
    view: View, scratch: TileScratch, inverse_depth: NDArray[np.float64], first_tile: int, stop_tile: int
) -> None:
    """Render inverse depth in tiles.

    Parameters
    ----------
    view
        Faces as the camera pose projects them.
    scratch
        Scratch space of the thread.
    inverse_depth
        (height, width) is filled with 1 / z at the pixel centres, 1/m; 0 for the sky.
    first_tile, stop_tile
        The tiles, in raster order.
    """
    height, width = inverse_depth.shape
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        count, uniform = faces_around_tile(view.lines, column, row, 0.0, scratch.in_tile)
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                face = scratch.in_tile[0] if uniform else nearest_face(view.lines, scratch.in_tile, count, x, y)
                inverse_depth[y, x] = value(view.lines, face, W, x, y) if face >= 0 else 0.0


@njit(cache=True, error_model="numpy", nogil=True, **UNCOUNTED)
def render_bodies(
    view: View,
    scratch: TileScratch,
    body_of_face: NDArray[np.int64],
    bodies: NDArray[np.int64],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Render the body at each pixel of tiles.

    Parameters
    ----------
    view
        Faces as the camera pose projects them.
    scratch
        Scratch space of the thread.
    body_of_face
        (n,) body of each face.
    bodies
        (height, width) is filled with the body at each pixel centre; 0 for faces at rest and the sky.
    first_tile, stop_tile
        The tiles, in raster order.
    """
    height, width = bodies.shape
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        count, uniform = faces_around_tile(view.lines, column, row, 0.0, scratch.in_tile)
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                face = scratch.in_tile[0] if uniform else nearest_face(view.lines, scratch.in_tile, count, x, y)
                bodies[y, x] = body_of_face[view.front[face]] if face >= 0 else 0


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
        (height, width, 3, 3) of ``camera.pixel_maps``.
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
