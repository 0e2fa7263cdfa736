"""Divided differences of samples, by the symmetries that they have."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.jumps import find_steps
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, VectorSamples, divided_differences
from tests.estimators.imu.smooth_motion import TIMES_NS, TIMES_S, uneven_ns
from tests.support.motion_world import RESTLESS


def test_even_times_within_a_microsecond_are_not_compared() -> None:
    """Seconds that were stored as microseconds: every step is 5 ns."""
    times_ns = 5 * np.arange(100, dtype=np.int64)
    assert divided_differences(times_ns, VectorSamples(np.cos(np.arange(300.0)).reshape(-1, 3)), 8).shape == (0, 3)


@pytest.mark.parametrize("curve", [VectorSamples, OrientationSamples])
def test_even_clocks_are_weighed_alike_step_by_step_and_all_at_once(
    curve: type[VectorSamples] | type[OrientationSamples],
) -> None:
    """A clock that is even by a nanosecond and less has the pattern of an even one, and so the same jumps and noise."""
    of_curve = RESTLESS.positions_m(TIMES_S) if curve is VectorSamples else RESTLESS.orientations(TIMES_S).as_quat()
    nearly_ns = TIMES_NS + np.arange(601) % 2
    for half_width, degree in ((4, 5), (24, 3)):
        even, nearly = (
            find_steps(times_ns, curve(of_curve), half_width=half_width, degree=degree, sigma=1e-9)
            for times_ns in (TIMES_NS, nearly_ns)
        )
        np.testing.assert_array_equal(even.before, nearly.before)
        np.testing.assert_allclose(even.gains, nearly.gains, rtol=1e-12)
        np.testing.assert_allclose(even.sizes, nearly.sizes, atol=1e-13)
        np.testing.assert_allclose(even.motion, nearly.motion, atol=1e-13)
    differences = divided_differences(TIMES_NS, curve(of_curve), 8)
    np.testing.assert_allclose(differences, divided_differences(nearly_ns, curve(of_curve), 8), atol=1e-14)


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
@pytest.mark.parametrize("order", [2, 8, 10])
def test_differences_do_not_depend_on_the_direction_of_time(times_ns: NDArray[np.int64], order: int) -> None:
    """A turning body, whose orientations err, has the same differences of even order backward."""
    shaken = RESTLESS.orientations(times_ns * 1e-9) * Rotation.from_rotvec(
        0.01 * np.random.default_rng(5).standard_normal((601, 3))
    )
    forward = divided_differences(times_ns, OrientationSamples(shaken.as_quat()), order)
    backward = divided_differences(times_ns[-1] - times_ns[::-1], OrientationSamples(shaken.as_quat()[::-1]), order)
    np.testing.assert_allclose(backward[::-1], forward, atol=1e-12)
