"""Which faces a square of the image can show, by the signs of linear functions.

``lines`` is (faces, 7, 3) as ``projection.project_faces`` makes it. A square of half side h around (x, y) is a tile,
a pixel (h = 1/2) or a point (h = 0): a linear function varies on it by h (|l_x| + |l_y|) around its centre value.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

U: Final = 0
V: Final = 1
W: Final = 2
FIRST_BORDER: Final = 3
STOP_BORDER: Final = 7

OUTSIDE: Final = 0
PARTLY: Final = 1
COVERING: Final = 2

SLIVER: Final = 1e-9
"""Distance from a border, px, within which a point is on it. Faces that meet have the same border up to rounding."""


@njit(cache=True, error_model="numpy")
def value(lines: NDArray[np.float64], face: int, line: int, x: float, y: float) -> float:
    """Value of a linear function at a point of the image.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    face, line
        Row and line: U, V, W or a border.
    x, y
        Point, px.
    """
    return float(lines[face, line, 0] * x + lines[face, line, 1] * y + lines[face, line, 2])


@njit(cache=True, error_model="numpy")
def spread(lines: NDArray[np.float64], face: int, line: int, half: float) -> float:
    """Largest difference of a linear function from its centre value on a square of half side ``half``."""
    return half * float(abs(lines[face, line, 0]) + abs(lines[face, line, 1]))


@njit(cache=True, error_model="numpy")
def coverage(lines: NDArray[np.float64], face: int, x: float, y: float, half: float) -> int:
    """Whether a face misses, shares or fills a square, other faces aside.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    face
        Row of ``lines``.
    x, y, half
        Centre and half side of the square, px.

    Returns
    -------
    state
        OUTSIDE, PARTLY or COVERING. PARTLY may be wrong near a corner of the face; the other two are exact.
    """
    state = COVERING
    for border in range(FIRST_BORDER, STOP_BORDER):
        inside = value(lines, face, border, x, y)
        margin = spread(lines, face, border, half)
        if inside + margin < 0.0:
            return OUTSIDE
        if inside - margin < 0.0:
            state = PARTLY
    return state


@njit(cache=True, error_model="numpy")
def possible_faces(
    lines: NDArray[np.float64],
    given: NDArray[np.int64],
    count: int,
    x: float,
    y: float,
    half: float,
    faces: NDArray[np.int64],
) -> tuple[int, bool]:
    """Faces that can be visible in a square.

    Faces that are hidden everywhere behind one that fills the square are left out.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    given
        Rows of ``lines``; the first ``count`` are considered.
    x, y, half
        Centre and half side of the square, px.
    faces
        Is filled with the rows of the visible faces.

    Returns
    -------
    number
        Of visible faces.
    filled
        Whether there is exactly one, and it fills the square.
    """
    candidates = 0
    nearest_filling = 0.0  # as inverse depth: the farthest point of the nearest face that fills the square
    for i in range(count):
        face = given[i]
        state = coverage(lines, face, x, y, half)
        if state != OUTSIDE:
            faces[candidates] = face
            candidates += 1
        if state == COVERING:
            nearest_filling = max(nearest_filling, value(lines, face, W, x, y) - spread(lines, face, W, half))
    number = 0
    for i in range(candidates):
        face = faces[i]
        if value(lines, face, W, x, y) + spread(lines, face, W, half) >= nearest_filling:
            faces[number] = face
            number += 1
    return number, number == 1 and nearest_filling > 0.0


@njit(cache=True, error_model="numpy")
def nearest_face(lines: NDArray[np.float64], given: NDArray[np.int64], count: int, x: float, y: float) -> int:
    """Face that a ray meets first, -1 for the sky.

    A face includes its border, so that no ray passes between two faces.

    Parameters
    ----------
    lines
        (m, 7, 3) of ``project_faces``.
    given
        Rows of ``lines``; the first ``count`` are considered.
    x, y
        Point of the image, px.
    """
    nearest, inverse_depth = -1, 0.0
    for i in range(count):
        face = given[i]
        here = value(lines, face, W, x, y)
        if here > inverse_depth and coverage(lines, face, x, y, SLIVER) != OUTSIDE:
            nearest, inverse_depth = face, here
    return nearest
