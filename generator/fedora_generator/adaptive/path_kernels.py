"""A view of a few faces at any instant of a camera's path."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.projection_kernels import FaceFrames, project_face
from fedora_generator.surfaces.shading_kernels import View

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def look(frames: FaceFrames, coefficients: Floats, share: float, view: View, camera_m: Floats, sums: Floats) -> None:
    """Turn ``view``, in place, to how its faces (``front``) appear at a share (0 to 1) of the path.

    ``camera_m`` (3,) and ``sums`` (2, 12) are scratch space.
    """
    _pose_at(coefficients, share, view.rays, camera_m, sums)
    for index in range(len(view.front)):
        project_face(frames, view.front[index], camera_m, view.rays, view.lines[index])


@njit(cache=True, error_model="numpy")
def _pose_at(coefficients: Floats, share: float, rays: Floats, camera_m: Floats, sums: Floats) -> None:
    """Fill ``rays`` (3, 3) and ``camera_m`` (3,): Chebyshev polynomials by Clenshaw's recurrence."""
    x = 2.0 * share - 1.0
    sums[:] = 0.0
    for term in range(len(coefficients) - 1, 0, -1):
        for entry in range(sums.shape[1]):
            value = coefficients[term, entry] + 2.0 * x * sums[0, entry] - sums[1, entry]
            sums[1, entry] = sums[0, entry]
            sums[0, entry] = value
    for i in range(3):
        for j in range(3):
            rays[i, j] = coefficients[0, 3 * i + j] + x * sums[0, 3 * i + j] - sums[1, 3 * i + j]
        camera_m[i] = coefficients[0, 9 + i] + x * sums[0, 9 + i] - sums[1, 9 + i]
