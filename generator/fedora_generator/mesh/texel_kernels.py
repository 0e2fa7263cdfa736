"""Averages of a procedural texture over the texels of an image."""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fedora_generator.surfaces.texture_kernels import TextureTable, steps_average, waves_average


@njit(parallel=True, cache=True, error_model="numpy")
def average_over_texels(
    textures: TextureTable,
    texture: int,
    first_uv_m: tuple[float, float],
    texel_m: tuple[float, float],
    wave_offset_m: tuple[float, float],
    s: NDArray[np.float64],
) -> None:
    """Fill ``s`` (rows along v, columns along u) with the texture's value, 0 to 1, averaged over each texel.

    ``first_uv_m`` is the centre of the first texel on the face; ``wave_offset_m`` is added for the waves.
    """
    rows, columns = s.shape
    du, dv = texel_m
    for row in prange(rows):
        terms = np.empty(textures.waves.shape[1])
        v = first_uv_m[1] + row * dv
        for column in range(columns):
            u = first_uv_m[0] + column * du
            waves = waves_average(
                textures, texture, u + wave_offset_m[0], v + wave_offset_m[1], du, 0.0, 0.0, dv, terms
            )
            s[row, column] = 0.5 + waves + steps_average(textures, texture, u, v, du, 0.0, 0.0, dv)
