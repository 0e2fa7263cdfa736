"""The loops over tiles and pixels. A tile writes its own pixels only, so that threads cannot change the result."""

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
from fedora_generator.surfaces.visibility_kernels import W, nearest_face, possible_faces, value
from fedora_generator.uncounted import UNCOUNTED

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
    x, y
        Column and row.
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
