"""Averages of textures over a parallelogram of the surface, in closed form.

A texture is ``s(u, v) = 0.5 + sum a_i cos(2 pi (k_i.uv + phase_i)) + sum b_j q_j(u, v)``, u and v in metres, k in
cycles a metre, q square waves between -1 and 1. Over the parallelogram with sides a and b around (u, v):

* a cosine is its centre value times sinc(k.a) sinc(k.b), sinc(x) = sin(pi x) / (pi x): exact;
* a square wave along one direction is a second difference of its second antiderivative: exact, however many
  periods the footprint spans;
* a product of two square waves (checker, dashes) is the product of their averages unless edges of both lie in the
  footprint; then Green's theorem makes it an integral along the footprint's border: exact. Only where the footprint
  spans more than ``MOST_PERIODS`` is the covariance of the two neglected.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

STRIPES: Final = 0
CHECKER: Final = 1
DASHES: Final = 2

LANES: Final = 4
"""Waves that one vector instruction handles (AVX2, float64); the number of waves is a multiple."""

MOST_PERIODS: Final = 1024.0
"""Longest footprint, in periods, whose border is integrated from edge to edge of the pattern."""
WIDE: Final = 1e-2
"""Product of a footprint's two widths, in periods, from which the second difference keeps 14 digits."""
NARROWEST: Final = 1e-5
"""Least width, in periods, of a footprint longer than ``MOST_PERIODS``: to widen it changes the average by 1e-7."""
THREAD: Final = 1e-9
"""Area over length of a footprint, in periods, below which it is a thread whose two waves are taken as independent."""

# sin(2 pi y) / y as a polynomial of y^2, highest power first: Taylor, error below 3e-16 for |y| <= 1/4.
_SINE: Final = tuple((-1.0) ** k * (2 * math.pi) ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(9, -1, -1))
# sin(pi x) / (pi x) as a polynomial of x^2, highest power first, for |x| <= 1/2.
_SINC: Final = tuple((-1.0) ** k * math.pi ** (2 * k) / math.factorial(2 * k + 1) for k in range(9, -1, -1))


class TextureTable(NamedTuple):
    """Terms of all textures; texture i owns those from ``ranges[i]`` to ``ranges[i + 1]`` of each table.

    ``waves`` (4, n): rows of amplitudes, k_u, k_v and phases; each texture has a multiple of ``LANES``, filled up
    with waves of no amplitude. ``steps`` (m, 10): rule, amplitude, then k_u, k_v, phase, duty of the first and of
    the second square wave. Phases are in turns.
    """

    wave_ranges: NDArray[np.int64]
    waves: NDArray[np.float64]
    step_ranges: NDArray[np.int64]
    steps: NDArray[np.float64]


@njit(inline="always")
def _polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Horner's rule, written out: a loop here would keep the loop over waves from being vectorised."""
    c9, c8, c7, c6, c5, c4, c3, c2, c1, c0 = coefficients
    return ((((((((c9 * x + c8) * x + c7) * x + c6) * x + c5) * x + c4) * x + c3) * x + c2) * x + c1) * x + c0


@njit(cache=True, error_model="numpy", inline="always")
def cosine(turns: float) -> float:
    """cos(2 pi turns), folded to a quarter turn around the zero of the sine."""
    y = 0.25 - abs(turns - math.floor(turns + 0.5))
    return y * _polynomial(y * y, _SINE)


@njit(cache=True, error_model="numpy", inline="always")
def sinc(x: float) -> float:
    """sin(pi x) / (pi x): the average of a cosine over x of its periods."""
    whole = math.floor(x + 0.5)
    rest = x - whole
    odd = whole - 2.0 * math.floor(0.5 * whole)
    ratio = 1.0 if whole == 0.0 else rest / x
    return (1.0 - 2.0 * odd) * ratio * _polynomial(rest * rest, _SINC)


@njit(cache=True, error_model="numpy")
def _second_antiderivative(turns: float, duty: float) -> float:
    """Second antiderivative of the square wave (1 on [0, duty), else 0) less its mean; periodic."""
    f = turns - math.floor(turns)
    drift = 0.5 * duty * (1.0 - duty) * f
    if f < duty:
        return 0.5 * (1.0 - duty) * f * f - drift
    return duty * (f - 0.5 * duty - 0.5 * f * f) - drift


@njit(cache=True, error_model="numpy")
def _share_past(distance: float, long: float, short: float) -> float:
    """Share of a footprint that lies past an edge, its centre ``distance`` past it: the integral of a trapezoid.

    Two uniform spreads of widths ``long`` >= ``short`` add up to a trapezoid, as wide as both at its foot.
    """
    outer, inner = 0.5 * (long + short), 0.5 * (long - short)
    if distance <= -outer:
        return 0.0
    if distance >= outer:
        return 1.0
    if abs(distance) <= inner:
        return 0.5 + distance / long
    tip = outer - abs(distance)
    share = 0.5 * tip * tip / (long * short)
    return share if distance < 0.0 else 1.0 - share


@njit(cache=True, error_model="numpy")
def square_average(turns: float, width_a: float, width_b: float, duty: float) -> float:
    """Average of a 0/1 square wave of period 1 over two uniform spreads.

    For narrow footprints the shares past each edge are added up, as a difference would lose their digits. For wide ones
    it is the second difference of the second antiderivative, whatever the number of edges.

    Parameters
    ----------
    turns
        Phase at the centre.
    width_a, width_b
        Widths of the spreads, turns.
    duty
        Share of a period where the wave is 1.
    """
    width_a, width_b = abs(width_a), abs(width_b)
    long, short = max(width_a, width_b), min(width_a, width_b)
    if short < 1e-150:  # its square would be lost
        short = 0.0
    outer = 0.5 * (long + short)
    f = turns - math.floor(turns)
    if outer <= f and f + outer <= duty:
        return 1.0
    if duty + outer <= f and f + outer <= 1.0:
        return 0.0
    if long * short < WIDE and long < MOST_PERIODS:
        total = 0.0
        for k in range(math.floor(f - outer), math.floor(f + outer) + 1):
            total += _share_past(f - k, long, short) - _share_past(f - k - duty, long, short)
        return total
    short = max(short, NARROWEST)
    outer, inner = 0.5 * (long + short), 0.5 * (long - short)
    difference = _second_antiderivative(f + outer, duty) + _second_antiderivative(f - outer, duty)
    difference -= _second_antiderivative(f + inner, duty) + _second_antiderivative(f - inner, duty)
    return duty + difference / (long * short)


@njit(cache=True, error_model="numpy")
def _antiderivative(turns: float, duty: float) -> float:
    """Antiderivative of the square wave less its mean; periodic, and linear between the edges."""
    f = turns - math.floor(turns)
    return min(f, duty) - duty * f


@njit(cache=True, error_model="numpy")
def _next_edge(turns: float, rate: float, duty: float) -> int:
    """First edge on the way from a phase, by number: edge 2 k rises at k, edge 2 k + 1 falls at k + duty."""
    k = math.floor(turns)
    f = turns - k
    if rate >= 0.0:
        return 2 * k + (1 if f < duty else 2)
    return 2 * k + (1 if f > duty else (0 if f > 0.0 else -1))


@njit(cache=True, error_model="numpy")
def _share_to_edge(edge: int, turns: float, rate: float, duty: float) -> float:
    """Position of an edge along a line on which the phase starts at ``turns`` and changes by ``rate``, 0 to 1."""
    if rate == 0.0:
        return math.inf
    return ((edge >> 1) + (duty if edge & 1 else 0.0) - turns) / rate


@njit(cache=True, error_model="numpy")
def _border_integral(
    first: float, second: float, to_one: float, to_two: float, duty_one: float, duty_two: float, zero: float
) -> float:
    """Integral of f(w1) (G(w2) - zero) dw1 along a straight side from phases (first, second), by (to_one, to_two).

    f is the first square wave less its mean, G the antiderivative of the second. From edge to edge f is constant
    and G linear, so that the midpoint is exact. Edges are counted, not searched for: on which side of an edge a point
    lies never depends on rounding.
    """
    edge_one, edge_two = _next_edge(first, to_one, duty_one), _next_edge(second, to_two, duty_two)
    on_one, on_two = (1 if to_one >= 0.0 else -1), (1 if to_two >= 0.0 else -1)
    total, s = 0.0, 0.0
    while s < 1.0:
        at_one = _share_to_edge(edge_one, first, to_one, duty_one)
        at_two = _share_to_edge(edge_two, second, to_two, duty_two)
        stop = max(s, min(at_one, at_two, 1.0))
        high = (edge_one & 1) == (on_one > 0)  # up to a falling edge, or down to a rising one
        middle = second + 0.5 * (s + stop) * to_two
        total += (stop - s) * ((1.0 if high else 0.0) - duty_one) * (_antiderivative(middle, duty_two) - zero)
        s = stop
        if at_one <= at_two:
            edge_one += on_one
        else:
            edge_two += on_two
    return total * to_one


@njit(cache=True, error_model="numpy")
def _covariance(
    first: float, second: float, a: tuple[float, float], b: tuple[float, float], duty_one: float, duty_two: float
) -> float:
    """Average of the product of two square waves, less their means, over the parallelogram of sides a and b (phases).

    Green's theorem: the integral of f(w1) g(w2) over an area is the integral of -f(w1) G(w2) dw1 around it. A constant
    in G adds nothing; taking it off keeps the rounding of opposite sides as small as the footprint.
    """
    area = a[0] * b[1] - a[1] * b[0]
    length = abs(a[0]) + abs(a[1]) + abs(b[0]) + abs(b[1])
    if abs(area) < THREAD * length or length > MOST_PERIODS:
        return 0.0
    p, q = first - math.floor(first) - 0.5 * (a[0] + b[0]), second - math.floor(second) - 0.5 * (a[1] + b[1])
    zero = _antiderivative(second, duty_two)
    total = _border_integral(p, q, a[0], a[1], duty_one, duty_two, zero)
    total += _border_integral(p + a[0], q + a[1], b[0], b[1], duty_one, duty_two, zero)
    total -= _border_integral(p + b[0], q + b[1], a[0], a[1], duty_one, duty_two, zero)
    total -= _border_integral(p, q, b[0], b[1], duty_one, duty_two, zero)
    return -total / area


@njit(cache=True, error_model="numpy")
def step_average(
    steps: NDArray[np.float64], row: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    """Average, between -1 and 1, of a step-edge term over a parallelogram.

    Parameters
    ----------
    steps, row
        Table of ``TextureTable.steps``, and the row of the term.
    u, v
        Centre, m.
    au, av, bu, bv
        Sides a and b along u and v, m.
    """
    rule, _, k_u, k_v, phase, duty_one, l_u, l_v, phase_two, duty_two = steps[row]
    first, a_one, b_one = k_u * u + k_v * v + phase, k_u * au + k_v * av, k_u * bu + k_v * bv
    mean_one = square_average(first, a_one, b_one, duty_one)
    if rule == STRIPES:
        return 2.0 * mean_one - 1.0
    second, a_two, b_two = l_u * u + l_v * v + phase_two, l_u * au + l_v * av, l_u * bu + l_v * bv
    mean_two = square_average(second, a_two, b_two, duty_two)
    both = mean_one * mean_two
    if 0.0 < mean_one < 1.0 and 0.0 < mean_two < 1.0:
        both = duty_one * mean_two + duty_two * mean_one - duty_one * duty_two
        both += _covariance(first, second, (a_one, a_two), (b_one, b_two), duty_one, duty_two)
    if rule == CHECKER:
        return 4.0 * both - 2.0 * (mean_one + mean_two) + 1.0
    return 2.0 * both - 1.0


@njit(cache=True, error_model="numpy")
def waves_average(
    textures: TextureTable,
    texture: int,
    u: float,
    v: float,
    au: float,
    av: float,
    bu: float,
    bv: float,
    terms: NDArray[np.float64],
) -> float:
    """Average of the cosines of a texture over a parallelogram.

    The terms are computed first and then summed in order, which vectorises without a change of rounding.

    Parameters
    ----------
    textures, texture
        Table of all textures, and the index of one of them.
    u, v
        Centre, m.
    au, av, bu, bv
        Sides a and b along u and v, m.
    terms
        Scratch space for as many values as a texture has waves.
    """
    start, stop = textures.wave_ranges[texture], textures.wave_ranges[texture + 1]
    amplitudes, phases = textures.waves[0, start:stop], textures.waves[3, start:stop]
    ks_u, ks_v = textures.waves[1, start:stop], textures.waves[2, start:stop]
    for i in range(stop - start):
        k_u, k_v = ks_u[i], ks_v[i]
        gain = amplitudes[i] * sinc(k_u * au + k_v * av) * sinc(k_u * bu + k_v * bv)
        terms[i] = gain * cosine(k_u * u + k_v * v + phases[i])
    total = 0.0
    for i in range(stop - start):
        total += terms[i]
    return total


@njit(cache=True, error_model="numpy")
def steps_average(
    textures: TextureTable, texture: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    """Average of the step-edge terms of a texture over a parallelogram.

    Parameters
    ----------
    textures, texture
        Table of all textures, and the index of one of them.
    u, v
        Centre, m.
    au, av, bu, bv
        Sides a and b along u and v, m.
    """
    total = 0.0
    for row in range(textures.step_ranges[texture], textures.step_ranges[texture + 1]):
        total += textures.steps[row, 1] * step_average(textures.steps, row, u, v, au, av, bu, bv)
    return total
