"""Averages of textures over parallelograms against numerical integration."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_generator.surfaces.texture_kernels import (
    cosine,
    sinc,
    square_average,
    step_average,
    waves_average,
)
from fedora_generator.surfaces.textures import StepKind, StepPattern, Texture, WaveBand, texture_table

Floats = NDArray[np.float64]

side = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
place = st.floats(-50, 50)
share = st.floats(0.05, 0.95)


def parallelogram(u: float, v: float, a: tuple[float, float], b: tuple[float, float], n: int) -> tuple[Floats, Floats]:
    """Midpoints of n x n equal parts."""
    p, q = np.meshgrid(*[(np.arange(n) + 0.5) / n - 0.5] * 2)
    return u + p * a[0] + q * b[0], v + p * a[1] + q * b[1]


@settings(deadline=None)
@given(st.floats(-1e6, 1e6))
def test_cosine_is_the_cosine(turns: float) -> None:
    """cos(2 pi x) to 5e-16, four units in the last place below 1, as numpy has it for the reduced argument."""
    assert cosine(turns) == pytest.approx(np.cos(2 * np.pi * (turns - np.round(turns))), abs=5e-16)


@settings(deadline=None)
@given(st.floats(-1e4, 1e4))
def test_sinc_is_the_sinc(x: float) -> None:
    """sin(pi x) / (pi x) to 1e-15, its limit at zero included; sin(pi x) reduced by whole turns for the oracle."""
    whole = np.round(x)
    expected = 1.0 if x == 0 else np.sin(np.pi * (x - whole)) * (-1) ** (whole % 2) / (np.pi * x)
    assert sinc(x) == pytest.approx(expected, abs=1e-15)
    assert sinc(0.0) == 1.0


@settings(deadline=None)
@given(place, place, side, side)
def test_the_average_of_waves_is_the_integral(
    u: float, v: float, a: tuple[float, float], b: tuple[float, float]
) -> None:
    """Gauss-Legendre quadrature of the cosines over the footprint agrees to 1e-9."""
    band = WaveBand(longest_m=5.0, shortest_m=0.6, count=6, seed=5)
    texture = Texture(dark_rgb=(0.1,) * 3, light_rgb=(0.9,) * 3, waves=(band,))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    p, q = np.meshgrid(nodes / 2, nodes / 2)
    uu, vv = u + p * a[0] + q * b[0], v + p * a[1] + q * b[1]
    values = sum(
        amplitude * np.cos(2 * np.pi * (k_u * uu + k_v * vv + phase)) for amplitude, k_u, k_v, phase in band.rows()
    )
    expected = weights @ values @ weights / 4
    assert waves_average(texture_table([texture]), 0, u, v, *a, *b, np.empty(8)) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None)
@given(place, st.floats(0, 4), st.floats(0, 4), share)
@example(2.3e-308, 2e-228, 2e-228, 0.5)
def test_the_average_of_a_square_wave_is_the_integral(
    turns: float, width_a: float, width_b: float, duty: float
) -> None:
    """The second difference agrees with the integral of the once averaged wave, for any widths."""
    n = 20_000
    spread = turns + width_b * ((np.arange(n) + 0.5) / n - 0.5)
    if width_a < 1e-6:
        expected = (spread % 1 < duty).mean()
    else:
        ends = [np.floor(w) * duty + np.minimum(w % 1, duty) for w in (spread + width_a / 2, spread - width_a / 2)]
        expected = ((ends[0] - ends[1]) / width_a).mean()
    # Below 1e-5 of a period the footprint is widened to it, and an edge inside may be anywhere.
    narrow = max(width_a, width_b) < 1e-4
    assert square_average(turns, width_a, width_b, duty) == pytest.approx(expected, abs=1.0 if narrow else 2e-3)


@pytest.mark.parametrize("position", [0.1, 0.25, 0.5, 0.75, 0.9])
def test_an_edge_across_a_narrow_footprint_counts_its_share(position: float) -> None:
    """A footprint of a thousandth of a period sees the share of it that lies on the light side."""
    width = 1e-3
    turns = 0.5 + width * (position - 0.5)  # the wave falls at 1/2
    assert square_average(turns, width, 0.0, 0.5) == pytest.approx(1 - position, abs=1e-5)


@pytest.mark.parametrize("kind", ["stripes", "checker", "dashes"])
@settings(deadline=None, max_examples=60)
@given(place, place, side, st.floats(0.1, 1.0), st.floats(0.3, 2.8), st.floats(0, 90), share, share)
def test_the_average_of_a_pattern_is_the_integral(
    kind: StepKind,
    u: float,
    v: float,
    a: tuple[float, float],
    ratio: float,
    between_rad: float,
    angle_deg: float,
    duty_one: float,
    duty_two: float,
) -> None:
    """Stripes, checkers and dashes in any direction, corners inside or not: as far as 250 x 250 points tell."""
    length, direction = max(np.hypot(*a), 0.05), np.arctan2(a[1], a[0])
    a = length * np.cos(direction), length * np.sin(direction)
    b = ratio * length * np.cos(direction + between_rad), ratio * length * np.sin(direction + between_rad)
    pattern = StepPattern(kind=kind, period_m=(1.3, 0.9), duty=(duty_one, duty_two), angle_deg=angle_deg)
    uu, vv = parallelogram(u, v, a, b, 250)
    angle = np.radians(angle_deg)
    one = (np.cos(angle) * uu + np.sin(angle) * vv) / 1.3 % 1 < duty_one
    two = (-np.sin(angle) * uu + np.cos(angle) * vv) / 0.9 % 1 < duty_two
    value = {"stripes": one, "checker": one == two, "dashes": one & two}[kind]
    exact = step_average(np.array([pattern.row()]), 0, u, v, *a, *b)
    # An edge along a side of the footprint moves a whole row of points at once: 2 / 250 an edge.
    assert exact == pytest.approx(2 * value.mean() - 1, abs=0.05)


def test_a_corner_of_a_checker_is_exact() -> None:
    """A square pixel turned by 45 degrees on the corner of a checker: two light and two dark quarters."""
    pattern = np.array([StepPattern(kind="checker", period_m=(1.0, 1.0)).row()])
    assert step_average(pattern, 0, 0.5, 0.5, 0.1, 0.1, -0.1, 0.1) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("t", [0.0, 0.02, 0.05, 0.09])
def test_a_moved_corner_of_a_checker_is_exact(t: float) -> None:
    """Moved along an edge, the diamond |x| + |y| <= h stays half light; along the diagonal 1/2 + (t / h)^2 is light.

    The latter while t <= h / 2: the dark quadrants are (h - t)^2 - (h - 2 t)^2 / 2 each, of 2 h^2.
    """
    pattern = np.array([StepPattern(kind="checker", period_m=(1.0, 1.0)).row()])
    h = 0.1
    assert step_average(pattern, 0, 0.5 + t, 0.5, h, h, -h, h) == pytest.approx(0.0, abs=1e-9)
    if t <= h / 2:
        light = 0.5 + (t / h) ** 2
        assert step_average(pattern, 0, 0.5 + t, 0.5 + t, h, h, -h, h) == pytest.approx(2 * light - 1, abs=1e-9)


def test_a_texture_cannot_leave_its_range() -> None:
    """Contrasts that sum to more than 1 are refused."""
    band = WaveBand(longest_m=1.0, shortest_m=0.1, count=3, contrast=0.7)
    with pytest.raises(ValueError, match="contrasts that sum to at most 1, got"):
        Texture(dark_rgb=(0.1,) * 3, light_rgb=(0.9,) * 3, waves=(band, band))


def test_the_amplitudes_of_a_band_share_its_contrast() -> None:
    """Amplitudes sum to half the contrast and fall from the longest to the shortest wave."""
    rows = WaveBand(longest_m=8.0, shortest_m=0.02, count=9, contrast=0.8, slope=0.5).rows()
    assert rows[:, 0].sum() == pytest.approx(0.4)
    assert (np.diff(rows[:, 0]) < 0).all()
    np.testing.assert_allclose(1 / np.hypot(rows[:, 1], rows[:, 2])[[0, -1]], [8.0, 0.02])
