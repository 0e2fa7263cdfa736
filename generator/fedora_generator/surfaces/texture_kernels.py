"""Averages of textures over a parallelogram of the surface, in closed form.

A texture is ``s(u, v) = 0.5 + sum a_i cos(2 pi (k_i.uv + phase_i)) + sum b_j q_j(u, v)``, u and v in metres, k in
cycles a metre, q square waves between -1 and 1. Over the parallelogram with sides a and b around (u, v):

* a cosine is its centre value times sinc(k.a) sinc(k.b), sinc(x) = sin(pi x) / (pi x): exact;
* a square wave along one direction is a second difference of its second antiderivative: exact, however many
  periods the footprint spans;
* a product of two square waves (checker, dashes) is the product of their averages. That is exact unless edges of
  both lie in the footprint; then it is taken over 4 x 4 parts, which leaves at most 1/4 of a part wrong wherever a
  corner lies: under 1/64 of the pattern's range for one corner.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

STRIPES: Final = 0
CHECKER: Final = 1
DASHES: Final = 2

CORNER_PARTS: Final = 4
NARROWEST: Final = 1e-5
"""Least footprint of a square wave, in periods: below it the second difference would lose digits."""

# sin(2 pi y) / y as a polynomial of y^2, highest power first: Taylor, error below 3e-16 for |y| <= 1/4.
_SINE: Final = tuple((-1.0) ** k * (2 * math.pi) ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(9, -1, -1))
# sin(pi x) / (pi x) as a polynomial of x^2, highest power first, for |x| <= 1/2.
_SINC: Final = tuple((-1.0) ** k * math.pi ** (2 * k) / math.factorial(2 * k + 1) for k in range(9, -1, -1))


class TextureTable(NamedTuple):
    """Terms of all textures; texture i owns the rows from ``ranges[i]`` to ``ranges[i + 1]`` of each table.

    ``waves`` (n, 4): amplitude, k_u, k_v, phase. ``steps`` (m, 10): rule, amplitude, then k_u, k_v, phase, duty of
    the first and of the second square wave. Phases are in turns.
    """

    wave_ranges: NDArray[np.int64]
    waves: NDArray[np.float64]
    step_ranges: NDArray[np.int64]
    steps: NDArray[np.float64]


@njit(cache=True)
def cosine(turns: float) -> float:
    """cos(2 pi turns), folded to a quarter turn around the zero of the sine."""
    y = 0.25 - abs(turns - math.floor(turns + 0.5))
    square = y * y
    total = 0.0
    for coefficient in _SINE:
        total = total * square + coefficient
    return total * y


@njit(cache=True)
def sinc(x: float) -> float:
    """sin(pi x) / (pi x): the average of a cosine over x of its periods."""
    whole = math.floor(x + 0.5)
    rest = x - whole
    square = rest * rest
    total = 0.0
    for coefficient in _SINC:
        total = total * square + coefficient
    if whole == 0.0:
        return total
    odd = whole - 2.0 * math.floor(0.5 * whole)
    return (1.0 - 2.0 * odd) * total * rest / x


@njit(cache=True)
def _second_antiderivative(turns: float, duty: float) -> float:
    """Second antiderivative of the square wave (1 on [0, duty), else 0) less its mean; periodic."""
    f = turns - math.floor(turns)
    drift = 0.5 * duty * (1.0 - duty) * f
    if f < duty:
        return 0.5 * (1.0 - duty) * f * f - drift
    return duty * (f - 0.5 * duty - 0.5 * f * f) - drift


@njit(cache=True)
def square_average(turns: float, width_a: float, width_b: float, duty: float) -> float:
    """Average of a 0/1 square wave of period 1 over two uniform spreads of the given widths (turns)."""
    width_a = max(abs(width_a), NARROWEST)
    width_b = max(abs(width_b), NARROWEST)
    outer = 0.5 * (width_a + width_b)
    f = turns - math.floor(turns)
    if outer <= f and f + outer <= duty:
        return 1.0
    if duty + outer <= f and f + outer <= 1.0:
        return 0.0
    inner = 0.5 * (width_a - width_b)
    difference = _second_antiderivative(turns + outer, duty) + _second_antiderivative(turns - outer, duty)
    difference -= _second_antiderivative(turns + inner, duty) + _second_antiderivative(turns - inner, duty)
    return duty + difference / (width_a * width_b)


@njit(cache=True)
def _along(
    steps: NDArray[np.float64], row: int, first: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    k_u, k_v = steps[row, first], steps[row, first + 1]
    turns = k_u * u + k_v * v + steps[row, first + 2]
    return square_average(turns, k_u * au + k_v * av, k_u * bu + k_v * bv, steps[row, first + 3])


@njit(cache=True)
def _combine(rule: float, one: float, two: float) -> float:
    if rule == CHECKER:
        return (2.0 * one - 1.0) * (2.0 * two - 1.0)
    return 2.0 * one * two - 1.0


@njit(cache=True)
def step_average(
    steps: NDArray[np.float64], row: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    """Average, between -1 and 1, of one step-edge term over the parallelogram of sides a and b around (u, v)."""
    rule = steps[row, 0]
    one = _along(steps, row, 2, u, v, au, av, bu, bv)
    if rule == STRIPES:
        return 2.0 * one - 1.0
    two = _along(steps, row, 6, u, v, au, av, bu, bv)
    if one in (0.0, 1.0) or two in (0.0, 1.0):
        return _combine(rule, one, two)
    part = 1.0 / CORNER_PARTS
    total = 0.0
    for i in range(CORNER_PARTS):
        for j in range(CORNER_PARTS):
            p, q = (i + 0.5) * part - 0.5, (j + 0.5) * part - 0.5
            ui, vi = u + p * au + q * bu, v + p * av + q * bv
            one = _along(steps, row, 2, ui, vi, part * au, part * av, part * bu, part * bv)
            two = _along(steps, row, 6, ui, vi, part * au, part * av, part * bu, part * bv)
            total += _combine(rule, one, two)
    return total * part * part


@njit(cache=True)
def waves_average(
    textures: TextureTable, texture: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    """Average of the cosines of a texture over the parallelogram of sides a and b (metres) around (u, v)."""
    total = 0.0
    waves = textures.waves
    for row in range(textures.wave_ranges[texture], textures.wave_ranges[texture + 1]):
        k_u, k_v = waves[row, 1], waves[row, 2]
        gain = waves[row, 0] * sinc(k_u * au + k_v * av) * sinc(k_u * bu + k_v * bv)
        total += gain * cosine(k_u * u + k_v * v + waves[row, 3])
    return total


@njit(cache=True)
def steps_average(
    textures: TextureTable, texture: int, u: float, v: float, au: float, av: float, bu: float, bv: float
) -> float:
    """Average of the step-edge terms of a texture over the parallelogram of sides a and b (metres) around (u, v)."""
    total = 0.0
    for row in range(textures.step_ranges[texture], textures.step_ranges[texture + 1]):
        total += textures.steps[row, 1] * step_average(textures.steps, row, u, v, au, av, bu, bv)
    return total
