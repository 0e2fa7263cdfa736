"""Projection of all faces for a camera pose: seven lines of the image for each face."""

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.faces import Faces
from fedora_generator.surfaces.projection_kernels import LINES_PER_FACE, project_every_face

Floats = NDArray[np.float64]


def project_faces(faces: Faces, K: Floats, T_world_camera: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Lines of the faces that turn their front to the camera.

    With p = (column, row, 1) the z-depth is 1 / W.p and the surface coordinates are U.p / W.p and V.p / W.p, metres
    from the face's centre. A pixel shows the face where all four borders ``a W -/+ U``, ``b W -/+ V`` are >= 0; each
    pair sums to a positive multiple of W, so that nothing behind the camera passes.

    Parameters
    ----------
    faces
        n faces in the world frame.
    K
        (3, 3) camera matrix, px.
    T_world_camera
        (4, 4) pose of the camera.

    Returns
    -------
    front
        (m,) indices of the faces.
    lines
        (m, 7, 3) rows U, V, W, a W - U, a W + U, b W - V, b W + V.
    """
    lines = np.empty((len(faces.textures), LINES_PER_FACE, 3))
    rays = pixel_rays(K, T_world_camera)
    front = project_every_face(faces.frames, np.ascontiguousarray(T_world_camera[:3, 3]), rays, lines)
    return np.flatnonzero(front), lines[front]


def pixel_rays(K: Floats, T_world_camera: Floats) -> Floats:
    """Matrix (3, 3) from (column, row, 1) to the ray's direction in the world frame, of optical z = 1.

    Parameters
    ----------
    K
        (3, 3) camera matrix, px.
    T_world_camera
        (4, 4) pose of the camera.
    """
    return np.asarray(T_world_camera[:3, :3] @ np.linalg.inv(K))
