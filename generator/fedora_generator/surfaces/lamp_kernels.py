"""Light of a lamp on a face, averaged over a parallelogram of it, in closed form.

A lamp gives weight / (r^2 + H^2)^(3/2) at distance r from the foot of its perpendicular, H its softened height. That is
the solid angle of a piece of the plane seen from height H, so that the mean over a triangle is its solid angle (van
Oosterom and Strackee 1983, eq. 8: tan(angle / 2) = |p.(q x r)| / D) over H and over its area. The triple product is H
times twice the area, without rounding of its own, which leaves the mean finite where the area vanishes.
"""

import math

from numba import njit


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
