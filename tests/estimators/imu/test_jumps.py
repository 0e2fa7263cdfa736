"""Jumps of smooth motions, with their sizes and errors."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.imu.jumps import StepEstimates, find_steps, most_precise_steps
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, VectorSamples
from fedora_qa.estimators.imu.white_noise import noise_level
from fedora_qa.views.motion_samples import NOISE_ORDER
from tests.estimators.imu.smooth_motion import TIMES_NS, TIMES_S, polynomial, uneven_ns
from tests.support.motion_world import RESTLESS


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
@pytest.mark.parametrize(("half_width", "degree"), [(4, 5), (6, 7), (12, 3)])
def test_a_jump_is_found_to_size_and_place(times_ns: NDArray[np.int64], half_width: int, degree: int) -> None:
    """On a motion of the filter's degree the jump is exact, and nothing else is seen."""
    values = polynomial(times_ns, [0.3] * (degree + 1))
    values[300:] += [0.002, 0.0, -0.01]
    steps = find_steps(times_ns, VectorSamples(values), half_width=half_width, degree=degree, sigma=1e-9)
    place = int(np.argmax(np.abs(steps.sizes).max(axis=1)))
    assert steps.before[place] == 299
    np.testing.assert_allclose(steps.sizes[place], [0.002, 0.0, -0.01], atol=1e-9)
    far = np.abs(steps.before - 299) > 2 * half_width
    assert np.abs(steps.sizes[far]).max() < 1e-9


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
@pytest.mark.parametrize(("half_width", "degree"), [(4, 5), (6, 7), (12, 3)])
def test_motion_of_the_degree_of_a_filter_does_not_pass_it(
    times_ns: NDArray[np.int64], half_width: int, degree: int
) -> None:
    """A power of the time in half widths passes the next lower filter, and the difference is stated as motion."""
    count = 2 * half_width + 8
    values = ((times_ns[:count] * 1e-9 / 0.005 - count / 2) / half_width)[:, None] ** degree * [1.0, -0.5, 2.0]
    steps, lower = (
        find_steps(times_ns[:count], VectorSamples(values), half_width=half_width, degree=each, sigma=1e-9)
        for each in (degree, degree - 2)
    )
    assert len(steps.before) == 9
    assert np.abs(steps.sizes).max() < 1e-9
    passed = np.abs(lower.sizes).max(axis=1)
    assert passed.max() > 0.01
    # The bound is the largest difference within reach, here of all nine steps.
    np.testing.assert_allclose(steps.motion[4], passed.max(), atol=1e-9)


def test_the_gain_is_that_of_the_noise() -> None:
    """White noise comes out with the stated gain."""
    noise = np.random.default_rng(1).standard_normal((601, 3))
    steps = find_steps(TIMES_NS, VectorSamples(noise), half_width=8, degree=5, sigma=1.0)
    assert np.std(steps.sizes) == pytest.approx(steps.gains[0], rel=0.1)


def test_smooth_motion_stays_below_its_own_bound() -> None:
    """On a fast motion every filter's answer lies below what it states the motion may add."""
    curve = OrientationSamples(RESTLESS.orientations(TIMES_S).as_quat())
    for half_width, degree in ((4, 5), (8, 5), (24, 5), (12, 3), (24, 3)):
        steps = find_steps(TIMES_NS, curve, half_width=half_width, degree=degree, sigma=1e-12)
        assert np.all(np.abs(steps.sizes).max(axis=1) <= steps.motion + 1e-11)


@pytest.mark.parametrize("noise", [1e-6, 0.03, 0.3])
def test_a_vibration_is_no_jump(noise: float) -> None:
    """At no frequency does the filter of the least error exceed its bound by more than noise."""
    random, excess = np.random.default_rng(3), {}
    for cycles in np.linspace(0.01, 0.49, 49):
        values = vibration(cycles) + noise * random.standard_normal((201, 3))
        steps, sigma = most_precise(values, noise)
        beyond = np.abs(steps.sizes) - steps.motion[:, None]
        excess[cycles] = float((beyond / (sigma * steps.gains[:, None])).max())
    assert max(excess.values()) < 6.0, excess


@pytest.mark.parametrize(("cycles", "jump"), [(0.04, 5.0), (0.1, 5.0), (0.2, 5.0), (0.25, 12.0), (0.3, 20.0)])
def test_a_jump_of_several_amplitudes_of_a_vibration_is_found(cycles: float, jump: float) -> None:
    """A vibration everywhere does not hide a jump at one place."""
    values = vibration(cycles) + 1e-6 * np.random.default_rng(3).standard_normal((201, 3))
    values[90:, 1] += jump
    steps, sigma = most_precise(values, 1e-6)
    row, axis = divmod(int(np.argmax(np.abs(steps.sizes) - steps.motion[:, None])), 3)
    assert (int(steps.before[row]), axis) == (89, 1)
    assert abs(steps.sizes[row, axis]) - steps.motion[row] > 7.0 * sigma * steps.gains[row]


def test_spikes_are_not_taken_for_a_vibration() -> None:
    """Single samples far off leave residuals, but not everywhere."""
    values = 0.01 * np.random.default_rng(3).standard_normal((401, 3))
    values[[120, 300], 0] += 5.0
    steps = find_steps(TIMES_NS[:401], VectorSamples(values), half_width=12, degree=5, sigma=0.01)
    assert np.max(np.abs(steps.sizes) - steps.motion[:, None]) > 1.0


def vibration(cycles: float) -> NDArray[np.float64]:
    """Return a vibration (201, 3) of so many cycles a sample, with amplitudes up to 1, beside a slow motion."""
    samples = np.arange(201)[:, None]
    slow = 10.0 * np.sin(2 * np.pi * 0.0025 * samples)
    values: NDArray[np.float64] = slow + np.sin(2 * np.pi * cycles * samples + [0.3, 1.9, 4.0]) * [0.3, 1.0, 0.05]
    return values


def most_precise(values: NDArray[np.float64], least_sigma: float) -> tuple[StepEstimates, float]:
    """Return the jumps of samples by the filter of the least error, and the noise."""
    times_ns, curve = TIMES_NS[: len(values)], VectorSamples(values)
    level = noise_level(times_ns, curve, order=NOISE_ORDER)
    assert level is not None
    sigma = max(least_sigma, level.sigma)
    filters = ((4, 5), (6, 7), (8, 5), (12, 5), (24, 5), (12, 3), (24, 3))
    candidates = [find_steps(times_ns, curve, half_width=w, degree=d, sigma=sigma) for w, d in filters]
    return most_precise_steps(candidates, sigma), sigma


def test_noisy_poses_are_searched_by_long_filters_and_exact_ones_by_short() -> None:
    """The filter with the least error depends on the noise."""
    curve = VectorSamples(RESTLESS.positions_m(TIMES_S))
    found = {
        sigma: [find_steps(TIMES_NS, curve, half_width=w, degree=d, sigma=sigma) for w, d in ((6, 7), (24, 3))]
        for sigma in (1e-9, 0.05)
    }
    assert most_precise_steps(found[1e-9], 1e-9) is found[1e-9][0]
    assert most_precise_steps(found[0.05], 0.05) is found[0.05][1]
