"""Noise, jumps, stops and straight lines of smooth motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.local_motion import (
    OrientationSamples,
    VectorSamples,
    divided_differences,
    find_interpolation,
    find_steps,
    lone_samples,
    most_precise_steps,
    noise_evenness,
    noise_level,
    repeated_samples,
)
from tests.support.motion_world import RESTLESS

TIMES_NS = np.arange(601) * 5_000_000
TIMES_S = TIMES_NS * 1e-9


def uneven_ns(count: int, seed: int = 0) -> NDArray[np.int64]:
    """Stamps that scatter by a fifth of a step."""
    return np.arange(count) * 5_000_000 + np.random.default_rng(seed).integers(-1000, 1000, count) * 1000


def polynomial(times_ns: NDArray[np.int64], coefficients: list[float]) -> NDArray[np.float64]:
    return np.polyval(coefficients, times_ns * 1e-9 - 1.5)[:, None] * [1.0, -0.5, 2.0]


@given(st.lists(st.floats(-5, 5), min_size=8, max_size=8))
def test_polynomials_have_no_noise(coefficients: list[float]) -> None:
    """A polynomial of degree 7 vanishes under differences of order 8, for even and uneven stamps, to rounding."""
    for times_ns in (TIMES_NS, uneven_ns(601)):
        level = noise_level(times_ns, VectorSamples(polynomial(times_ns, coefficients)), order=8)
        assert level is not None
        assert level.sigma < 1e-12


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
def test_white_noise_is_measured_within_its_error(times_ns: NDArray[np.int64]) -> None:
    """On a fast motion the noise comes out as it was put in; over many draws the stated error is the real one."""
    motion = RESTLESS.positions_m(times_ns * 1e-9)
    found = []
    for seed in range(100):
        noisy = motion + 0.003 * np.random.default_rng(seed).standard_normal(motion.shape)
        level = noise_level(times_ns, VectorSamples(noisy), order=8)
        assert level is not None
        found.append((level.sigma / 0.003 - 1) / (level.standard_error / level.sigma))
    assert abs(np.mean(found)) < 0.4
    assert 0.8 < np.std(found) < 1.25


def test_noise_of_orientations_is_that_of_each_axis() -> None:
    """Rotations shaken by 2 mrad an axis have 2 mrad of noise, while the body turns at up to 5 rad/s."""
    random = np.random.default_rng(5)
    shaken = RESTLESS.orientations(TIMES_S) * Rotation.from_rotvec(0.002 * random.standard_normal((601, 3)))
    level = noise_level(TIMES_NS, OrientationSamples(shaken.as_quat()), order=8)
    assert level is not None
    assert level.sigma == pytest.approx(0.002, abs=4 * level.standard_error)


def test_fast_motion_is_not_taken_for_noise() -> None:
    """What a motion of 1 Hz and 5 rad/s leaves is below the stated share of the motion and 1e-12 rad."""
    level = noise_level(TIMES_NS, OrientationSamples(RESTLESS.orientations(TIMES_S).as_quat()), order=8)
    assert level is not None
    assert level.sigma < level.motion + 1e-12


@pytest.mark.parametrize("count", range(20))
def test_noise_needs_as_many_differences_as_their_order(count: int) -> None:
    """Of n samples n - 10 differences of order 10 say what motion leaves; fewer than eight are too few."""
    times_ns, shaken = TIMES_NS[:count], np.random.default_rng(0).standard_normal((count, 3))
    assert (noise_level(times_ns, VectorSamples(shaken), order=8) is not None) == (count >= 18)


def test_a_gap_is_not_bridged_by_differences() -> None:
    """Samples on either side of a gap are never compared."""
    kept = np.r_[0:300, 310:601]
    level = noise_level(TIMES_NS[kept], VectorSamples(RESTLESS.positions_m(TIMES_S)[kept]), order=8)
    assert level is not None
    assert level.count == 292 + 283


def test_times_within_a_microsecond_are_not_compared() -> None:
    """A recorder may store one sample twice, with times that differ by less than the unit of the offsets."""
    times_ns = np.insert(TIMES_NS, 300, TIMES_NS[300] - 400)
    level = noise_level(times_ns, VectorSamples(RESTLESS.positions_m(times_ns * 1e-9)), order=8)
    assert level is not None
    assert level.sigma < 1e-9


def test_even_times_within_a_microsecond_are_not_compared() -> None:
    """Seconds that were stored as microseconds: every step is 5 ns."""
    times_ns = 5 * np.arange(100, dtype=np.int64)
    assert divided_differences(times_ns, VectorSamples(np.cos(np.arange(300.0)).reshape(-1, 3)), 8).shape == (0, 3)


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


def test_noisy_poses_are_searched_by_long_filters_and_exact_ones_by_short() -> None:
    """The filter with the least error depends on the noise."""
    curve = VectorSamples(RESTLESS.positions_m(TIMES_S))
    found = {
        sigma: [find_steps(TIMES_NS, curve, half_width=w, degree=d, sigma=sigma) for w, d in ((6, 7), (24, 3))]
        for sigma in (1e-9, 0.05)
    }
    assert most_precise_steps(found[1e-9], 1e-9) is found[1e-9][0]
    assert most_precise_steps(found[0.05], 0.05) is found[0.05][1]


def test_repeats_in_motion_are_stops_and_rest_is_not() -> None:
    """Values held for three samples are found; a body that slows down and rests holds none."""
    positions = RESTLESS.positions_m(TIMES_S)
    held = positions.copy()
    held[200:203] = held[199]
    assert repeated_samples(held, held, roundings=(1e-16, 1e-16)).tolist() == [200, 201, 202]
    resting = np.where(TIMES_S[:, None] < 1.0, (1.0 - TIMES_S[:, None]) ** 3 * positions[0], 0.0)
    assert repeated_samples(resting, resting, roundings=(1e-16, 1e-16)).tolist() == []
    assert repeated_samples(np.ones((50, 3)), roundings=(1e-16,)).tolist() == []


def test_repeats_between_roundings_are_no_stops() -> None:
    """A value that creeps by one unit of rounding now and then repeats in between; a step of many units shows."""
    creeping = np.floor(np.arange(50) / 4.0)[:, None]
    assert repeated_samples(creeping, roundings=(1.0,)).tolist() == []
    assert len(repeated_samples(creeping, roundings=(0.01,))) == 37


def test_a_repeat_of_one_array_alone_is_no_stop() -> None:
    """A body that turns on the spot repeats its position."""
    turning = np.outer(TIMES_S, [0.0, 0.0, 1.0])
    assert repeated_samples(np.zeros((601, 3)), turning, roundings=(1e-16, 1e-16)).tolist() == []


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


@given(st.lists(st.integers(0, 9), min_size=32, max_size=200))
def test_evenness_is_that_of_two_medians(sizes: list[int]) -> None:
    """Of any bends, equal ones too, the least even stride is the one that medians of both parts give."""
    values = np.zeros((len(sizes) + 2, 3))
    values[2:, 0] = np.cumsum(np.cumsum(sizes))
    bends = np.linalg.norm(divided_differences(TIMES_NS[: len(values)], VectorSamples(values), 2), axis=-1)
    expected = [
        (float(np.median(bends[~at])) / float(np.median(bends[at])), stride)
        for stride in range(2, min(20, len(bends) // 16) + 1)
        for phase in range(stride)
        if np.median(bends[at := np.arange(len(bends)) % stride == phase]) > 1e-6
    ]
    found = find_interpolation(TIMES_NS[: len(values)], VectorSamples(values), resolution=1e-8)
    least = min(expected, key=lambda one: (round(one[0], 2), one[1]), default=None)
    assert (None if found is None else (found.evenness, found.stride)) == least


@pytest.mark.parametrize("stride", [2, 4, 10])
def test_straight_lines_betray_the_rate_they_were_made_from(stride: int) -> None:
    """Linear interpolation from every n-th sample is found with its n; the motion itself is even."""
    positions = RESTLESS.positions_m(TIMES_S)
    even = find_interpolation(TIMES_NS, VectorSamples(positions), resolution=1e-16)
    assert even is not None
    assert even.evenness > 0.5
    lines = np.stack([np.interp(TIMES_S, TIMES_S[::stride], column[::stride]) for column in positions.T], axis=-1)
    found = find_interpolation(TIMES_NS, VectorSamples(lines), resolution=1e-16)
    assert found is not None
    assert found.evenness < 0.01
    assert found.stride == stride


@given(st.integers(0, 200))
def test_noise_does_not_look_interpolated(seed: int) -> None:
    """White noise is even to every stride."""
    noise = np.random.default_rng(seed).standard_normal((201, 3))
    found = find_interpolation(TIMES_NS[:201], VectorSamples(noise), resolution=1e-16)
    assert found is not None
    assert found.evenness > 0.3


@pytest.mark.parametrize("count", [0, 1, 5, 11])
def test_too_few_samples_say_nothing(count: int) -> None:
    """No noise, no steps and no lines come of a handful of samples, and nothing breaks."""
    curve = VectorSamples(np.zeros((count, 3)))
    assert noise_level(TIMES_NS[:count], curve, order=8) is None
    assert len(find_steps(TIMES_NS[:count], curve, half_width=6, degree=5, sigma=1.0).before) == 0
    assert find_interpolation(TIMES_NS[:count], curve, resolution=0.0) is None
    assert [len(found) for found in lone_samples(TIMES_NS[:count], curve)] == [0, 0]
    assert repeated_samples(curve.values, roundings=(1e-16,)).tolist() == []


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
def test_lone_samples_are_counted_and_noise_is_not(times_ns: NDArray[np.int64]) -> None:
    """Every sample that lies off alone, with its distance; neither motion, noise, nor a jump that stays has any."""
    motion = RESTLESS.positions_m(times_ns * 1e-9)
    off = motion.copy()
    rows = np.arange(20, 580, 40)
    off[rows, 2] += 0.5
    lone_rows, distances_m = lone_samples(times_ns, VectorSamples(off))
    np.testing.assert_array_equal(lone_rows, rows)
    np.testing.assert_allclose(distances_m, 0.5, rtol=0.02)
    jumped = motion + np.where(np.arange(len(motion)) > 300, 0.5, 0.0)[:, np.newaxis]
    noise = 0.003 * np.random.default_rng(7).standard_normal(motion.shape)
    for values in (motion, motion + noise, jumped):
        assert not len(lone_samples(times_ns, VectorSamples(values))[0])


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
def test_noise_is_in_every_sample_and_jumps_are_not(times_ns: NDArray[np.int64]) -> None:
    """White noise is as large by the median as by the largest tenth; positions that change between two sets do not."""
    motion = RESTLESS.positions_m(times_ns * 1e-9)
    noise = 0.003 * np.random.default_rng(7).standard_normal(motion.shape)
    assert noise_evenness(times_ns, VectorSamples(motion + noise), order=8) == pytest.approx(1.0, abs=0.1)
    taking_turns = motion + 0.05 * (np.arange(len(motion)) // 26 % 2)[:, np.newaxis]
    assert noise_evenness(times_ns, VectorSamples(taking_turns), order=8) < 0.01
    assert noise_evenness(times_ns[:9], VectorSamples(motion[:9]), order=8) == 1.0
