"""A view of a few faces at any instant of a camera's path."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.projection_kernels import FaceFrames, project_face
from fedora_generator.surfaces.shading_kernels import View

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def look(
    frames: FaceFrames,
    bodies: Integers,
    coefficients: Floats,
    share: float,
    view: View,
    cameras_m: Floats,
    sums: Floats,
) -> None:
    """Turn ``view``, in place, to how its faces (``front``) appear at a share (0 to 1) of the path.

    ``frames`` are the faces before anything has moved, ``bodies`` those they belong to; ``cameras_m`` (bodies, 3) and
    ``sums`` (2, entries of the path) are scratch space.
    """
    _pose_at(coefficients, share, view.rays, cameras_m, sums)
    for index in range(len(view.front)):
        face = view.front[index]
        project_face(frames, face, cameras_m[bodies[face]], view.rays, view.lines[index])


@njit(cache=True, error_model="numpy")
def _pose_at(coefficients: Floats, share: float, rays: Floats, cameras_m: Floats, sums: Floats) -> None:
    """Fill ``rays`` (3, 3) and ``cameras_m`` (bodies, 3): Chebyshev polynomials by Clenshaw's recurrence."""
    x = 2.0 * share - 1.0
    sums[:] = 0.0
    for term in range(len(coefficients) - 1, 0, -1):
        for entry in range(sums.shape[1]):
            value = coefficients[term, entry] + 2.0 * x * sums[0, entry] - sums[1, entry]
            sums[1, entry] = sums[0, entry]
            sums[0, entry] = value
    for entry in range(sums.shape[1]):
        row, column = divmod(entry, 3)
        value = coefficients[0, entry] + x * sums[0, entry] - sums[1, entry]
        if row < 3:
            rays[row, column] = value
        else:
            cameras_m[row - 3, column] = value
