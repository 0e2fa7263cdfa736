"""Cutting a pixel that several faces share into convex pieces, each of which shows one face or the sky.

Coordinates are relative to the pixel's centre, px. A piece is a convex polygon, counter-clockwise.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.visibility_kernels import FIRST_BORDER, SLIVER, STOP_BORDER, W, value

MAX_PIECES: Final = 64
"""Largest number of pieces of a pixel. Each cut adds one, and a line cuts a piece once: more than 64 lines need."""

MAX_CORNERS: Final = 24

CUT: Final = -2
BUFFER_FULL: Final = -3

COVERS: Final = -1
MISSES: Final = -2
IN_FRONT: Final = 1
BEHIND: Final = -1
THROUGH: Final = 0

SAME_PLANE: Final = 1e-12
"""Inverse depths that differ by less, relatively, are of one plane: two tops at one height, for example."""


class Pieces(NamedTuple):
    """Buffers for the pieces of a pixel.

    ``x`` and ``y`` (65, 24) are the corners, ``corners`` (64,) their number in each piece. The last row of ``x`` and of
    ``y`` holds the corners of a piece while it is cut. ``states`` (n,) is, for each face of the pixel, COVERS, MISSES
    or the border that crosses the piece.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    corners: NDArray[np.int64]
    states: NDArray[np.int64]


def empty_pieces(faces: int) -> Pieces:
    """Empty buffers for a pixel of at most ``faces`` faces."""
    return Pieces(
        np.empty((MAX_PIECES + 1, MAX_CORNERS)),
        np.empty((MAX_PIECES + 1, MAX_CORNERS)),
        np.zeros(MAX_PIECES, np.int64),
        np.empty(faces, np.int64),
    )


@njit(cache=True, error_model="numpy")
def start_pieces(pieces: Pieces) -> None:
    """Make the whole pixel the first piece."""
    for i, (corner_x, corner_y) in enumerate(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))):
        pieces.x[0, i], pieces.y[0, i] = corner_x, corner_y
    pieces.corners[0] = 4


@njit(cache=True, error_model="numpy")
def face_or_cut(
    lines: NDArray[np.float64], faces: NDArray[np.int64], count: int, x: float, y: float, pieces: Pieces, last: int
) -> int:
    """Face that the last piece of a pixel shows, or cut that piece in two.

    A piece is cut along the border of a face that shares it, or where a face pierces another, if that face may be
    visible there: a face that is hidden behind one that covers the piece cuts nothing.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    faces
        Rows of ``lines``; the first ``count`` may appear in the pixel.
    x, y
        Centre of the pixel.
    pieces
        Buffers of the pixel; ``states`` is overwritten.
    last
        Number of the last piece.

    Returns
    -------
    face
        Row of ``lines``; -1 for the sky. CUT: there is one more piece. BUFFER_FULL: the piece has to be cut, and the
        buffers have no space for it.
    """
    corners, xs, ys, states = pieces.corners[last], pieces.x[last], pieces.y[last], pieces.states
    hidden_from = 0.0  # as inverse depth: the farthest point of the nearest face that covers the piece
    for i in range(count):
        face = faces[i]
        states[i] = COVERS
        for border in range(FIRST_BORDER, STOP_BORDER):
            l_x, l_y = lines[face, border, 0], lines[face, border, 1]
            center = value(lines, face, border, x, y)
            lowest, highest = _range_over(xs, ys, corners, l_x, l_y, center)
            side = _side(lowest, highest, center, SLIVER * (abs(l_x) + abs(l_y)))
            if side == BEHIND:
                states[i] = MISSES
                break
            if side == THROUGH and states[i] == COVERS:
                states[i] = border
        if states[i] == COVERS:
            center = value(lines, face, W, x, y)
            lowest, _ = _range_over(xs, ys, corners, lines[face, W, 0], lines[face, W, 1], center)
            hidden_from = max(hidden_from, lowest)
    nearest = -1
    for i in range(count):
        face, border = faces[i], states[i]
        if border == MISSES:
            continue
        l_x, l_y, center = lines[face, W, 0], lines[face, W, 1], value(lines, face, W, x, y)
        _, highest = _range_over(xs, ys, corners, l_x, l_y, center)
        if highest < hidden_from:
            continue
        if border != COVERS:
            l_x, l_y, center = lines[face, border, 0], lines[face, border, 1], value(lines, face, border, x, y)
            return _cut_last(pieces, last, l_x, l_y, center)
        if nearest >= 0:
            rounding = SAME_PLANE * highest
            l_x, l_y = l_x - lines[nearest, W, 0], l_y - lines[nearest, W, 1]
            center -= value(lines, nearest, W, x, y)
            lowest, highest = _range_over(xs, ys, corners, l_x, l_y, center)
            side = _side(lowest, highest, center, max(SLIVER * (abs(l_x) + abs(l_y)), rounding))
            if side == THROUGH:
                return _cut_last(pieces, last, l_x, l_y, center)
            if side == BEHIND:
                continue
        nearest = face
    return nearest


@njit(cache=True, error_model="numpy", inline="always")
def _side(lowest: float, highest: float, center: float, sliver: float) -> int:
    """Whether a line has all of a piece IN_FRONT or BEHIND, but for a sliver, or passes THROUGH it."""
    if lowest < -sliver:
        return THROUGH if highest > sliver else BEHIND
    return IN_FRONT if highest > sliver or center >= 0.0 else BEHIND


@njit(cache=True, error_model="numpy", inline="always")
def _range_over(
    xs: NDArray[np.float64], ys: NDArray[np.float64], corners: int, l_x: float, l_y: float, center: float
) -> tuple[float, float]:
    """Least and greatest value of a linear function on a polygon."""
    lowest, highest = math.inf, -math.inf
    for i in range(corners):
        here = l_x * xs[i] + l_y * ys[i] + center
        lowest, highest = min(lowest, here), max(highest, here)
    return lowest, highest


@njit(cache=True, error_model="numpy")
def _cut_last(pieces: Pieces, last: int, l_x: float, l_y: float, center: float) -> int:
    """Cut the last piece along a line: its positive side stays, the other becomes the next piece."""
    corners = pieces.corners[last]
    if last + 1 == MAX_PIECES or corners + 2 > MAX_CORNERS:
        return BUFFER_FULL
    new = last + 1
    xs, ys = pieces.x[MAX_PIECES], pieces.y[MAX_PIECES]
    for i in range(corners):
        xs[i], ys[i] = pieces.x[last, i], pieces.y[last, i]
    kept, cut = 0, 0
    for i in range(corners):
        j = (i + 1) % corners
        here = l_x * xs[i] + l_y * ys[i] + center
        there = l_x * xs[j] + l_y * ys[j] + center
        if here >= 0.0:
            pieces.x[last, kept], pieces.y[last, kept] = xs[i], ys[i]
            kept += 1
        else:
            pieces.x[new, cut], pieces.y[new, cut] = xs[i], ys[i]
            cut += 1
        if (here >= 0.0) != (there >= 0.0):
            share = here / (here - there)
            x, y = xs[i] + share * (xs[j] - xs[i]), ys[i] + share * (ys[j] - ys[i])
            pieces.x[last, kept], pieces.y[last, kept] = x, y
            pieces.x[new, cut], pieces.y[new, cut] = x, y
            kept += 1
            cut += 1
    pieces.corners[last], pieces.corners[new] = kept, cut
    return CUT


@njit(cache=True, error_model="numpy")
def piece_footprint(pieces: Pieces, piece: int) -> tuple[float, float, float, float, float, float]:
    """Parallelogram with the area, centroid and second moments of a piece.

    A parallelogram of sides a and b has the covariance (a a^T + b b^T) / 12, so that a and b are the columns of a
    Cholesky factor of 12 times the piece's covariance. For a rectangle along the axes they are its own sides.

    Parameters
    ----------
    pieces, piece
        Buffers of the pixel, and the number of the piece.

    Returns
    -------
    area, x, y, a_x, a_y, b_y
        Area (px^2), centroid and sides a = (a_x, a_y), b = (0, b_y), px; all 0 for a sliver.
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
