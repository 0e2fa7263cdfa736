"""Averages of textures over parallelograms against clipped polygons and quadrature at 50 digits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.surfaces.texture_kernels import step_average
from fedora_generator.surfaces.textures import StepKind, StepPattern
from tests.generator.mpmath_world import EPS, MP, UNIT_SQUARE, area, pattern_average, phases, vector

place = st.floats(-50, 50)
share = st.floats(0.05, 0.95)


def rounding_of(pattern: StepPattern, u: float, v: float, a: list[float], b: list[float]) -> float:
    """Bound on what float64 can make of an average between -1 and 1.

    A phase of w turns is known to a few roundings of w; an edge that moves by d sweeps d / h of the footprint, h its
    height across the edge: its area over its extent along the edge. Each edge inside does so.
    """
    corners = [phases(pattern, u + p * a[0] + q * b[0], v + p * a[1] + q * b[1]) for p, q in UNIT_SQUARE]
    total = 0.0
    for axis in range(2):
        extent, along = (float(max(c[k] for c in corners) - min(c[k] for c in corners)) for k in (axis, 1 - axis))
        turns = max(float(abs(corner[axis])) for corner in corners)
        total += (2 * math.ceil(extent) + 2) * 8 * EPS * (1 + turns) * along / float(area(corners))
    return 2 * total


@pytest.mark.parametrize("kind", ["stripes", "checker", "dashes"])
@settings(deadline=None, max_examples=60)
@given(
    place=st.tuples(place, place),
    size=st.floats(-5, 0.7),
    ratio=st.floats(-1.5, 1.5),
    direction=st.floats(0, 360),
    between=st.floats(20, 160),
    angle_deg=st.floats(0, 90),
    duty=st.tuples(share, share),
    phase=st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
def test_the_average_of_a_pattern_is_exact(
    kind: StepKind,
    place: tuple[float, float],
    size: float,
    ratio: float,
    direction: float,
    between: float,
    angle_deg: float,
    duty: tuple[float, float],
    phase: tuple[float, float],
) -> None:
    """Footprints from 10 micrometres to 5 m, thirty times as long as wide or as wide as long, at any angle."""
    pattern = StepPattern(kind=kind, period_m=(1.3, 0.9), duty=duty, phase=phase, angle_deg=angle_deg)
    a = 10**size * np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction))])
    turned = math.radians(direction + between)
    b = 10 ** (size + min(ratio, 0.7 - size)) * np.array([math.cos(turned), math.sin(turned)])
    require_exact_average(pattern, *place, a.tolist(), b.tolist())


@pytest.mark.parametrize("kind", ["stripes", "checker", "dashes"])
@settings(deadline=None, max_examples=40)
@given(
    at=st.tuples(st.integers(-30, 30), st.integers(-30, 30)),
    off=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    size=st.floats(-5, -1),
    turned=st.sampled_from([0.0, 30.0, 45.0]),
)
def test_the_average_around_a_corner_of_a_pattern_is_exact(
    kind: StepKind, at: tuple[int, int], off: tuple[float, float], size: float, turned: float
) -> None:
    """Square footprints that hold a corner, or touch it; along the pattern's axes or turned against them."""
    pattern = StepPattern(kind=kind, period_m=(1.0, 0.5), duty=(0.5, 0.25))
    side = 10**size
    cos, sin = side * math.cos(math.radians(turned)), side * math.sin(math.radians(turned))
    require_exact_average(pattern, at[0] + side * off[0], 0.5 * at[1] + side * off[1], [cos, sin], [-sin, cos])


@pytest.mark.parametrize("kind", ["stripes", "checker", "dashes"])
@pytest.mark.parametrize("length_m", [1e-4, 0.3, 7.0])
@settings(deadline=None, max_examples=20)
@given(at=st.tuples(st.floats(-2, 2), st.floats(-2, 2)), width=st.floats(-7, -2))
def test_the_average_over_a_narrow_footprint_is_exact(
    kind: StepKind, length_m: float, at: tuple[float, float], width: float
) -> None:
    """Footprints along the pattern's axes, down to a ten millionth of a period wide: a grazing view down the road."""
    pattern = StepPattern(kind=kind, period_m=(1.0, 1.0))
    require_exact_average(pattern, *at, [length_m, 0.0], [0.0, length_m * 10**width])


@pytest.mark.parametrize("kind", ["checker", "dashes"])
def test_the_average_along_the_diagonal_of_a_far_pattern_is_exact(kind: StepKind) -> None:
    """A pixel that spans 24 periods along the diagonal and an eighth across: the two waves go up and down together.

    Taken as independent, they would be wrong by half of the contrast.
    """
    pattern = StepPattern(kind=kind, period_m=(1.0, 1.0), angle_deg=45.0)
    require_exact_average(pattern, 0.13, 0.02, [24.0, 0.0], [0.0, 0.125])


def require_exact_average(pattern: StepPattern, u: float, v: float, a: list[float], b: list[float]) -> None:
    exact = pattern_average(pattern, *vector([u, v]), vector(a), vector(b))
    found = step_average(np.array([pattern.row()]), 0, u, v, *a, *b)
    assert abs(found - exact) <= rounding_of(pattern, *vector([u, v]), vector(a), vector(b)) + 8 * EPS


def test_the_bound_of_rounding_is_small() -> None:
    """A pixel of a millimetre 10 m from the middle of a pattern: the bound of the tests above is below 1e-9."""
    pattern = StepPattern(kind="checker", period_m=(1.3, 0.9), angle_deg=25.0)
    at = vector([10.0, -7.0])
    assert 0 < rounding_of(pattern, *at, vector([1e-3, 0.0]), vector([0.0, 1e-3])) < 1e-9
    assert MP.dps == 50
