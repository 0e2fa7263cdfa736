import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from fedora_generator.flights.route import SmoothedLine

LINE = SmoothedLine(
    start=np.array([2.0]),
    times_s=np.array([0.5, 1.0, 1.0, 2.5]),
    steps=np.array([[0.0], [0.7], [0.0], [-1.5]]),
    bends=np.array([[3.0], [0.0], [-5.0], [2.0]]),
    sigma_s=0.2,
)


def line(t: mpmath.mpf) -> mpmath.mpf:
    """The line itself, corner by corner."""
    value = mpmath.mpf(2.0)
    for corner, step, bend in zip(LINE.times_s, LINE.steps[:, 0], LINE.bends[:, 0], strict=True):
        value += (step + bend * (t - corner)) if t > corner else 0
    return value


def gaussian_derivative(order: int, z: mpmath.mpf, sigma: mpmath.mpf) -> mpmath.mpf:
    """Derivative of the normal density of standard deviation sigma at sigma z, by Hermite's polynomial."""
    hermite = (1, -z, z**2 - 1, -(z**3) + 3 * z)[order]
    return hermite * mpmath.npdf(z) / sigma ** (order + 1)


@pytest.mark.parametrize("time_s", [0.5, 1.02, 2.2])
def test_it_is_the_convolution_with_a_gaussian(time_s: float) -> None:
    """Value and three derivatives are the integrals of the line with the Gaussian's derivatives, by mpmath."""
    found = LINE.at(np.array([time_s]))
    with mpmath.workdps(20):
        sigma, t = mpmath.mpf(LINE.sigma_s), mpmath.mpf(time_s)
        corners = sorted({t - 9 * sigma, t, t + 9 * sigma, *map(mpmath.mpf, LINE.times_s)})
        pieces = [corner for corner in corners if abs(corner - t) <= 9 * sigma]
        for order in range(4):

            def integrand(u: mpmath.mpf, order: int = order) -> mpmath.mpf:
                return line(u) * gaussian_derivative(order, (t - u) / sigma, sigma)

            assert found[order][0, 0] == pytest.approx(float(mpmath.quad(integrand, pieces)), rel=1e-11, abs=1e-11)


@given(
    st.lists(st.tuples(st.floats(0.01, 3), st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=8),
    st.floats(0.05, 1.0),
)
def test_it_overshoots_neither_in_value_nor_in_slope(corners: list[tuple[float, float, float]], sigma_s: float) -> None:
    """The curve stays within the range of the line's vertices, its slope within that of the line's slopes."""
    leg_times_s, *ends = np.array(corners).T
    vertices = np.vstack([np.zeros(2), np.column_stack(ends)])
    slopes = np.vstack([np.zeros(2), np.diff(vertices, axis=0) / leg_times_s[:, None], np.zeros(2)])
    times_s = np.concatenate([[0.0], np.cumsum(leg_times_s)])
    bends = np.diff(slopes, axis=0)
    curve = SmoothedLine(vertices[0], times_s, np.zeros_like(bends), bends, sigma_s)
    value, first, *_ = curve.at(np.linspace(-3, times_s[-1] + 3, 200))
    for quantity, bounds in ((value, vertices), (first, slopes)):
        slack = 1e-12 * (1 + np.abs(bounds).max())
        assert np.all(quantity >= bounds.min(axis=0) - slack)
        assert np.all(quantity <= bounds.max(axis=0) + slack)


def test_far_corners_are_added_without_being_evaluated() -> None:
    """With ten thousand corners the value and its derivatives are the plain sums over all, to rounding."""
    rng = np.random.default_rng(5)
    times_s = np.sort(rng.uniform(0, 3600, 10_000))
    bends, steps = rng.normal(size=(2, 10_000, 2))
    curve = SmoothedLine(np.zeros(2), times_s, steps, bends, 0.05)
    wanted_s = np.array([-1.0, 0.3, 1234.5, 3599.9, 4000.0])
    together = curve.at(wanted_s)
    for row, time_s in enumerate(wanted_s):
        tau_s = time_s - times_s
        z = tau_s / 0.05
        share, density = norm.cdf(z), norm.pdf(z) / 0.05
        rate, curvature = -z / 0.05 * density, (z**2 - 1) / 0.05**2 * density
        of_steps = (share, density, rate, curvature)
        of_bends = (tau_s * share + 0.05**2 * density, share, density, rate)
        for quantity, of_step, of_bend in zip(together, of_steps, of_bends, strict=True):
            expected = of_step @ steps + of_bend @ bends
            np.testing.assert_allclose(quantity[row], expected, rtol=1e-9, atol=1e-9)


def test_a_line_without_corners_is_constant() -> None:
    """No corner, and no time, are no special case."""
    nothing = np.zeros((0, 3))
    curve = SmoothedLine(np.array([1.0, 2.0, 3.0]), np.zeros(0), nothing, nothing, 0.5)
    value, first, *_ = curve.at(np.array([-5.0, 1e6]))
    np.testing.assert_array_equal(value, [[1, 2, 3], [1, 2, 3]])
    assert not first.any()
    assert curve.at(np.zeros(0)).value.shape == (0, 3)
