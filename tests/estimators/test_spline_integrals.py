"""Double integrals of splines against SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from fedora_qa.estimators.imu.specific_force import integrated_twice


@pytest.mark.parametrize("knots", [2, 3, 4, 5, 9, 400])
def test_integrals_are_those_of_scipy(knots: int) -> None:
    """Between uneven knots, at them, and beyond the first and last, for any number of knots."""
    random = np.random.default_rng(knots)
    times_s = np.cumsum(random.uniform(0.5, 1.5, knots)) * 1e-3
    values = random.normal(size=(5, knots))
    at_s = np.concatenate((times_s, random.uniform(times_s[0] - 4e-4, times_s[-1] + 4e-4, 200)))
    expected = CubicSpline(times_s, values, axis=1).antiderivative(2)(at_s)
    np.testing.assert_allclose(integrated_twice(times_s, values, at_s), expected, atol=1e-13 * np.abs(expected).max())


def test_a_cubic_is_integrated_exactly() -> None:
    """The double integral of t^3 from 0 is t^5 / 20."""
    times_s = np.array([0.0, 0.3, 0.4, 1.1, 1.9, 2.0])
    at_s = np.linspace(0.0, 2.0, 33)
    np.testing.assert_allclose(integrated_twice(times_s, times_s[None] ** 3, at_s)[0], at_s**5 / 20, atol=1e-14)
