"""Projection of a face as lines of the image, and which faces a square of the image can show.

``lines`` is (faces, 7, 3) as ``faces.project_faces`` makes it. A square of half side h around (x, y) is a tile,
a pixel (h = 1/2) or a point (h = 0): a linear function varies on it by h (|l_x| + |l_y|) around its centre value.
"""

from typing import Final, NamedTuple

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


LINES_PER_FACE: Final = 7
"""Rows U, V, W of the homography, then the four borders."""


class FaceFrames(NamedTuple):
    """Positions and axes of n faces: arrays of ``Faces``, as compiled code takes them."""

    centers_m: NDArray[np.float64]
    u_axes: NDArray[np.float64]
    v_axes: NDArray[np.float64]
    normals: NDArray[np.float64]
    half_sizes_m: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def project_face(
    frames: FaceFrames,
    face: int,
    camera_m: NDArray[np.float64],
    rays: NDArray[np.float64],
    lines: NDArray[np.float64],
) -> bool:
    """Project a face. A point of a ray is camera + z rays p; it is in the plane where normal.(offset + z rays p) = 0.

    Parameters
    ----------
    frames, face
        The faces, and the index of one of them.
    camera_m
        (3,) position of the camera in the world.
    rays
        (3, 3) of ``pixel_rays``.
    lines
        (7, 3) is filled with rows U, V, W, a W - U, a W + U, b W - V, b W + V. The borders of a face that turns its
        back to the camera are negative everywhere.

    Returns
    -------
    front
        Whether the face turns its front to the camera.
    """
    height_m, offset_u_m, offset_v_m = 0.0, 0.0, 0.0
    for i in range(3):
        offset_m = camera_m[i] - frames.centers_m[face, i]
        height_m += frames.normals[face, i] * offset_m
        offset_u_m += frames.u_axes[face, i] * offset_m
        offset_v_m += frames.v_axes[face, i] * offset_m
    if not height_m > 0.0:
        lines[:FIRST_BORDER] = 0.0
        lines[FIRST_BORDER:] = 0.0
        lines[FIRST_BORDER:, 2] = -1.0
        return False
    half_u_m, half_v_m = frames.half_sizes_m[face]
    for j in range(3):
        along_n, along_u, along_v = 0.0, 0.0, 0.0
        for i in range(3):
            along_n += frames.normals[face, i] * rays[i, j]
            along_u += frames.u_axes[face, i] * rays[i, j]
            along_v += frames.v_axes[face, i] * rays[i, j]
        w = -along_n / height_m
        u, v = offset_u_m * w + along_u, offset_v_m * w + along_v
        lines[U, j], lines[V, j], lines[W, j] = u, v, w
        lines[FIRST_BORDER, j], lines[FIRST_BORDER + 1, j] = half_u_m * w - u, half_u_m * w + u
        lines[FIRST_BORDER + 2, j], lines[STOP_BORDER - 1, j] = half_v_m * w - v, half_v_m * w + v
    return True


@njit(cache=True, error_model="numpy")
def project_every_face(
    frames: FaceFrames, camera_m: NDArray[np.float64], rays: NDArray[np.float64], lines: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Project every face, and return (n,) whether each face turns its front to the camera.

    Parameters
    ----------
    frames, camera_m, rays
        As in ``project_face``.
    lines
        (n, 7, 3) is filled.
    """
    front = np.empty(len(lines), np.bool_)
    for face in range(len(lines)):
        front[face] = project_face(frames, face, camera_m, rays, lines[face])
    return front
