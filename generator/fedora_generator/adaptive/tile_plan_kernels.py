"""How far the image moves in each tile, and which faces a tile can show: loops over tiles."""

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fedora_generator.surfaces.render_kernels import TILE, faces_around_tile, tile_count, tile_origin
from fedora_generator.surfaces.visibility_kernels import W, nearest_face, value


@njit(parallel=True, cache=True, error_model="numpy")
def largest_motions(
    lines: NDArray[np.float64],
    bodies: NDArray[np.int64],
    H: NDArray[np.float64],
    ts: NDArray[np.float64],
    height: int,
    width: int,
    motions_px: NDArray[np.float64],
) -> None:
    """Raise ``motions_px`` (tiles,) to the largest displacement of any pixel of a tile to another pose.

    ``lines`` (n, 7, 3) are the faces from here, of ``bodies`` (n,); (column, row, 1) goes to H p + t / z, where t is
    the body's row of ``ts`` (bodies, 3). What passes behind the camera has no displacement.
    """
    for tile in prange(tile_count(height, width)):
        column, row = tile_origin(tile, width)
        in_tile = np.empty(len(lines), np.int64)
        count, uniform = faces_around_tile(lines, column, row, 0.0, in_tile)
        squared = motions_px[tile] ** 2
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                face = in_tile[0] if uniform else nearest_face(lines, in_tile, count, x, y)
                w = value(lines, face, W, x, y) if face >= 0 else 0.0
                t = ts[bodies[face] if face >= 0 else 0]
                ahead = H[2, 0] * x + H[2, 1] * y + H[2, 2] + w * t[2]
                if ahead > 0.0:
                    dx = (H[0, 0] * x + H[0, 1] * y + H[0, 2] + w * t[0]) / ahead - x
                    dy = (H[1, 0] * x + H[1, 1] * y + H[1, 2] + w * t[1]) / ahead - y
                    squared = max(squared, dx * dx + dy * dy)
        motions_px[tile] = math.sqrt(squared)


@njit(parallel=True, cache=True, error_model="numpy")
def mark_faces(
    lines: NDArray[np.float64],
    front: NDArray[np.int64],
    reach_px: NDArray[np.float64],
    height: int,
    width: int,
    marked: NDArray[np.bool_],
) -> None:
    """Mark in ``marked`` (tiles, faces) what each tile can show, taken larger by its reach (tiles,) on every side."""
    for tile in prange(tile_count(height, width)):
        column, row = tile_origin(tile, width)
        faces = np.empty(len(lines), np.int64)
        count, _ = faces_around_tile(lines, column, row, reach_px[tile], faces)
        for index in range(count):
            marked[tile, front[faces[index]]] = True
