"""What a camera pose makes of the faces: seven lines of the image each."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.faces import Faces

Floats = NDArray[np.float64]

LINES_PER_FACE: Final = 7
"""Rows U, V, W of the homography, then the four borders."""


def project_faces(faces: Faces, K: Floats, T_world_camera: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Lines of the faces that turn their front to the camera.

    With p = (column, row, 1) the z-depth is 1 / W.p and the surface coordinates are U.p / W.p and V.p / W.p, metres
    from the face's centre. A pixel sees the face where all four borders ``a W -/+ U``, ``b W -/+ V`` are >= 0; each
    pair sums to a positive multiple of W, so that nothing behind the camera passes.

    Returns
    -------
    front
        (m,) indices of the faces.
    lines
        (m, 7, 3) rows U, V, W, a W - U, a W + U, b W - V, b W + V.
    """
    camera_m = T_world_camera[:3, 3]
    heights_m = np.einsum("ni,ni->n", faces.normals, camera_m - faces.centers_m)
    front = np.flatnonzero(heights_m > 0)
    offsets_m = camera_m - faces.centers_m[front]
    rays = pixel_rays(K, T_world_camera)
    # A point of the ray is camera + z rays p. In the plane: normal.(offset + z rays p) = 0.
    W = -(faces.normals[front] @ rays) / heights_m[front, None]
    U = np.einsum("ni,ni->n", faces.u_axes[front], offsets_m)[:, None] * W + faces.u_axes[front] @ rays
    V = np.einsum("ni,ni->n", faces.v_axes[front], offsets_m)[:, None] * W + faces.v_axes[front] @ rays
    a, b = faces.half_sizes_m[front].T[:, :, None]
    return front, np.stack([U, V, W, a * W - U, a * W + U, b * W - V, b * W + V], axis=1)


def pixel_rays(K: Floats, T_world_camera: Floats) -> Floats:
    """Matrix (3, 3) that takes (column, row, 1) to the ray's direction in the world, of optical z = 1."""
    return np.asarray(T_world_camera[:3, :3] @ np.linalg.inv(K))
