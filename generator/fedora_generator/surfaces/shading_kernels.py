"""Radiance of a face or of the sky over a footprint, with the light of lamps in closed form.

The light of a lamp on a face is averaged over a parallelogram of it. A lamp gives weight / (r^2 + H^2)^(3/2) at
distance r from the foot of its perpendicular, H its softened height. That is the solid angle of a piece of the plane
seen from height H, so that the mean over a triangle is its solid angle (van Oosterom and Strackee 1983, eq. 8:
tan(angle / 2) = |p.(q x r)| / D) over H and over its area. The triple product is H times twice the area, without
rounding of its own, which leaves the mean finite where the area vanishes.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.surfaces.texture_kernels import TextureTable, steps_average, waves_average
from fedora_generator.surfaces.visibility_kernels import U, V, W, value


@njit(cache=True, error_model="numpy")
def lamp_average(u: float, v: float, squared_height: float, au: float, av: float, bu: float, bv: float) -> float:
    """Mean of (r^2 + H^2)^(-3/2), m^-3, over a parallelogram.

    Parameters
    ----------
    u, v
        Centre, m from the foot of the perpendicular.
    squared_height
        H^2, m^2, above 0.
    au, av, bu, bv
        Sides a and b along u and v, m.
    """
    p, q, r, s = (
        _corner(u - 0.5 * (au + bu), v - 0.5 * (av + bv), squared_height),
        _corner(u + 0.5 * (au - bu), v + 0.5 * (av - bv), squared_height),
        _corner(u + 0.5 * (au + bu), v + 0.5 * (av + bv), squared_height),
        _corner(u - 0.5 * (au - bu), v - 0.5 * (av - bv), squared_height),
    )
    triple = math.sqrt(squared_height) * abs(au * bv - av * bu)
    return _half(p, q, r, squared_height, triple) + _half(p, r, s, squared_height, triple)


@njit(cache=True, error_model="numpy", inline="always")
def _corner(u: float, v: float, squared_height: float) -> tuple[float, float, float]:
    return u, v, math.sqrt(u * u + v * v + squared_height)


@njit(cache=True, error_model="numpy", inline="always")
def _half(
    p: tuple[float, float, float],
    q: tuple[float, float, float],
    r: tuple[float, float, float],
    squared_height: float,
    triple: float,
) -> float:
    """Half the mean over a triangle: its solid angle over H times the parallelogram's area."""
    pq = p[0] * q[0] + p[1] * q[1] + squared_height
    qr = q[0] * r[0] + q[1] * r[1] + squared_height
    rp = r[0] * p[0] + r[1] * p[1] + squared_height
    denominator = p[2] * q[2] * r[2] + pq * r[2] + qr * p[2] + rp * q[2]
    tangent = triple / denominator
    if 0.0 <= tangent < 1e-4:
        return 2.0 * (1.0 - tangent * tangent / 3.0) / denominator
    return 2.0 * math.atan2(triple, denominator) / triple


class Surfaces(NamedTuple):
    """Appearance of the faces for c colour channels; one row per face, except where another shape is given.

    ``texture_of_face`` (n,) is the texture of a face, ``wave_offsets_m`` (n, 2) the offset of its waves;
    ``dark_dn`` and ``light_dn`` (textures, c) are the DN at s = 0 and 1 under irradiance 1. ``even_irradiance`` (n,)
    and ``lamps`` (n, lamps, 4) are the light of ``light.py``; ``sky_dn`` (2, c) is its horizon and zenith.
    """

    wave_offsets_m: NDArray[np.float64]
    texture_of_face: NDArray[np.int64]
    dark_dn: NDArray[np.float64]
    light_dn: NDArray[np.float64]
    even_irradiance: NDArray[np.float64]
    lamps: NDArray[np.float64]
    sky_dn: NDArray[np.float64]


class View(NamedTuple):
    """One camera pose: ``front`` (m,) and ``lines`` (m, 7, 3) of ``project_faces``, ``rays`` (3, 3) of ``pixel_rays``.

    Kernels number a face by its row here; ``front`` gives its row in ``Surfaces``.
    """

    front: NDArray[np.int64]
    lines: NDArray[np.float64]
    rays: NDArray[np.float64]


# These two are inlined: a call copies about a hundred machine words of array arguments for every pixel.
@njit(cache=True, error_model="numpy", inline="always")
def irradiance(surfaces: Surfaces, face: int, u: float, v: float, au: float, av: float, bu: float, bv: float) -> float:
    """Mean irradiance of a parallelogram of a face.

    Parameters
    ----------
    surfaces, face
        Light of the faces, and the row of one of them.
    u, v
        Centre, m.
    au, av, bu, bv
        Sides a and b along u and v, m.
    """
    total = float(surfaces.even_irradiance[face])
    lamps = surfaces.lamps
    for lamp in range(lamps.shape[1]):
        if lamps[face, lamp, 3] > 0.0:
            du, dv = u - lamps[face, lamp, 0], v - lamps[face, lamp, 1]
            total += lamps[face, lamp, 3] * lamp_average(du, dv, lamps[face, lamp, 2], au, av, bu, bv)
    return total


@njit(cache=True, error_model="numpy", inline="always")
def add_face(
    textures: TextureTable,
    surfaces: Surfaces,
    view: View,
    face: int,
    x: float,
    y: float,
    a_x: float,
    a_y: float,
    b_x: float,
    b_y: float,
    weight: float,
    terms: NDArray[np.float64],
    radiance_dn: NDArray[np.float64],
) -> None:
    """Add the weighted radiance of a face, averaged over a parallelogram of the image.

    Parameters
    ----------
    textures, surfaces, view
        Textures and light of the faces, and their projection.
    face
        Row of ``view.lines``.
    x, y
        Centre, px.
    a_x, a_y, b_x, b_y
        Sides a and b, px.
    weight
        Factor of the radiance: the area of the parallelogram, px^2.
    terms
        Scratch space for the waves of a texture.
    radiance_dn
        (channels,) to which the radiance is added, DN.
    """
    lines = view.lines
    z = 1.0 / value(lines, face, W, x, y)
    u, v = z * value(lines, face, U, x, y), z * value(lines, face, V, x, y)
    # Derivatives of the homography at (x, y): metres a pixel.
    u_x, u_y = z * (lines[face, U, 0] - u * lines[face, W, 0]), z * (lines[face, U, 1] - u * lines[face, W, 1])
    v_x, v_y = z * (lines[face, V, 0] - v * lines[face, W, 0]), z * (lines[face, V, 1] - v * lines[face, W, 1])
    row = view.front[face]
    texture = surfaces.texture_of_face[row]
    au, av = u_x * a_x + u_y * a_y, v_x * a_x + v_y * a_y
    bu, bv = u_x * b_x + u_y * b_y, v_x * b_x + v_y * b_y
    shift_u, shift_v = surfaces.wave_offsets_m[row, 0], surfaces.wave_offsets_m[row, 1]
    s = 0.5 + waves_average(textures, texture, u + shift_u, v + shift_v, au, av, bu, bv, terms)
    s += steps_average(textures, texture, u, v, au, av, bu, bv)
    light = weight * irradiance(surfaces, row, u, v, au, av, bu, bv)
    for channel in range(radiance_dn.shape[0]):
        dark = surfaces.dark_dn[texture, channel]
        radiance_dn[channel] += light * (dark + s * (surfaces.light_dn[texture, channel] - dark))


@njit(cache=True, error_model="numpy")
def add_sky(
    surfaces: Surfaces, view: View, x: float, y: float, weight: float, radiance_dn: NDArray[np.float64]
) -> None:
    """Add the weighted radiance of the sky, which goes from horizon to zenith with the sine of the elevation.

    Parameters
    ----------
    surfaces, view
        Colours of the sky, and the rays of the camera.
    x, y
        Point of the image, px.
    weight
        Factor of the radiance: area, px^2.
    radiance_dn
        (channels,) to which the radiance is added, DN.
    """
    rays = view.rays
    east = rays[0, 0] * x + rays[0, 1] * y + rays[0, 2]
    north = rays[1, 0] * x + rays[1, 1] * y + rays[1, 2]
    up = rays[2, 0] * x + rays[2, 1] * y + rays[2, 2]
    sine = max(up, 0.0) / math.sqrt(east * east + north * north + up * up)
    for channel in range(radiance_dn.shape[0]):
        horizon = surfaces.sky_dn[0, channel]
        radiance_dn[channel] += weight * (horizon + sine * (surfaces.sky_dn[1, channel] - horizon))
