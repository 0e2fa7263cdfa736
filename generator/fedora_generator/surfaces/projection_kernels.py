"""Projection of a face for a camera pose: seven lines of the image."""

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.visibility_kernels import FIRST_BORDER, STOP_BORDER, U, V, W

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
    """Project every face.

    Parameters
    ----------
    frames, camera_m, rays
        As in ``project_face``.
    lines
        (n, 7, 3) is filled.

    Returns
    -------
    front
        (n,) whether each face turns its front to the camera.
    """
    front = np.empty(len(lines), np.bool_)
    for face in range(len(lines)):
        front[face] = project_face(frames, face, camera_m, rays, lines[face])
    return front
