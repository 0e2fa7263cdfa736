"""Cutting a pixel that several faces share into convex pieces, each of which shows one face or the sky.

Coordinates are relative to the pixel's centre, px. A piece is a convex polygon, counter-clockwise.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.visibility_kernels import FIRST_BORDER, SLIVER, STOP_BORDER, W, spread, value

MAX_PIECES: Final = 64
MAX_CORNERS: Final = 24


class Pieces(NamedTuple):
    """Room for the pieces of one pixel: corners (64, 24) and how many each piece has (64,)."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    corners: NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def room_for_pieces() -> Pieces:
    """Empty buffers."""
    return Pieces(
        np.empty((MAX_PIECES, MAX_CORNERS)), np.empty((MAX_PIECES, MAX_CORNERS)), np.zeros(MAX_PIECES, np.int64)
    )


@njit(cache=True, error_model="numpy")
def cut_pixel(
    lines: NDArray[np.float64], faces: NDArray[np.int64], count: int, x: float, y: float, pieces: Pieces
) -> int:
    """Cut the pixel at (x, y) along the borders of the given faces and where two of them pierce each other.

    Returns the number of pieces. When the room is used up, the last pieces stay uncut.
    """
    for i, (corner_x, corner_y) in enumerate(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))):
        pieces.x[0, i], pieces.y[0, i] = corner_x, corner_y
    pieces.corners[0] = 4
    number = 1
    for i in range(count):
        face = faces[i]
        for border in range(FIRST_BORDER, STOP_BORDER):
            center = value(lines, face, border, x, y)
            if abs(center) < spread(lines, face, border, 0.5):
                number = _cut_all(pieces, number, lines[face, border, 0], lines[face, border, 1], center)
        for j in range(i):
            other = faces[j]
            l_x = lines[face, W, 0] - lines[other, W, 0]
            l_y = lines[face, W, 1] - lines[other, W, 1]
            center = value(lines, face, W, x, y) - value(lines, other, W, x, y)
            if abs(center) < 0.5 * (abs(l_x) + abs(l_y)):
                number = _cut_all(pieces, number, l_x, l_y, center)
    return number


@njit(cache=True, error_model="numpy")
def _cut_all(pieces: Pieces, number: int, l_x: float, l_y: float, center: float) -> int:
    """Cut every piece by the line ``l_x x + l_y y + center = 0``, but spare what would lose less than a sliver."""
    sliver = SLIVER * (abs(l_x) + abs(l_y))
    before = number
    for piece in range(before):
        if number == MAX_PIECES or pieces.corners[piece] + 2 > MAX_CORNERS:
            break
        lowest, highest = math.inf, -math.inf
        for i in range(pieces.corners[piece]):
            side = l_x * pieces.x[piece, i] + l_y * pieces.y[piece, i] + center
            lowest, highest = min(lowest, side), max(highest, side)
        if lowest < -sliver and highest > sliver:
            _cut(pieces, piece, number, l_x, l_y, center)
            number += 1
    return number


@njit(cache=True, error_model="numpy")
def _cut(pieces: Pieces, piece: int, new: int, l_x: float, l_y: float, center: float) -> None:
    """Leave the positive side of a convex polygon in ``piece``, put the other into ``new``."""
    corners = pieces.corners[piece]
    xs, ys = pieces.x[piece, :corners].copy(), pieces.y[piece, :corners].copy()
    kept, cut = 0, 0
    for i in range(corners):
        j = (i + 1) % corners
        here = l_x * xs[i] + l_y * ys[i] + center
        there = l_x * xs[j] + l_y * ys[j] + center
        if here >= 0.0:
            pieces.x[piece, kept], pieces.y[piece, kept] = xs[i], ys[i]
            kept += 1
        else:
            pieces.x[new, cut], pieces.y[new, cut] = xs[i], ys[i]
            cut += 1
        if (here >= 0.0) != (there >= 0.0):
            share = here / (here - there)
            x, y = xs[i] + share * (xs[j] - xs[i]), ys[i] + share * (ys[j] - ys[i])
            pieces.x[piece, kept], pieces.y[piece, kept] = x, y
            pieces.x[new, cut], pieces.y[new, cut] = x, y
            kept += 1
            cut += 1
    pieces.corners[piece], pieces.corners[new] = kept, cut


@njit(cache=True, error_model="numpy")
def piece_footprint(pieces: Pieces, piece: int) -> tuple[float, float, float, float, float, float]:
    """Area, centroid (x, y), and sides a = (a_x, a_y), b = (0, b_y) of a parallelogram with equal second moments.

    A parallelogram of sides a and b has the covariance (a a^T + b b^T) / 12, so that a and b are the columns of a
    Cholesky factor of 12 times the piece's covariance. For a rectangle along the axes they are its own sides.
    """
    area, m_x, m_y, m_xx, m_xy, m_yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    corners = pieces.corners[piece]
    for i in range(corners):
        j = (i + 1) % corners
        x, y, x_next, y_next = pieces.x[piece, i], pieces.y[piece, i], pieces.x[piece, j], pieces.y[piece, j]
        cross = x * y_next - x_next * y
        area += cross / 2
        m_x += cross * (x + x_next) / 6
        m_y += cross * (y + y_next) / 6
        m_xx += cross * (x * x + x * x_next + x_next * x_next) / 12
        m_yy += cross * (y * y + y * y_next + y_next * y_next) / 12
        m_xy += cross * (x * y_next + 2 * x * y + 2 * x_next * y_next + x_next * y) / 24
    if area <= SLIVER * SLIVER:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    m_x, m_y = m_x / area, m_y / area
    s_xx, s_xy, s_yy = m_xx / area - m_x * m_x, m_xy / area - m_x * m_y, m_yy / area - m_y * m_y
    a_x = math.sqrt(12.0 * max(s_xx, 0.0))
    a_y = 12.0 * s_xy / a_x if a_x > 0.0 else 0.0
    b_y = math.sqrt(max(12.0 * s_yy - a_y * a_y, 0.0))
    return area, m_x, m_y, a_x, a_y, b_y
