"""Samples off a motion, and straight lines between others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.imu.curvature import find_interpolation, find_straight_lines, lone_samples
from fedora_qa.estimators.imu.jumps import find_steps
from fedora_qa.estimators.imu.repeated_samples import repeated_samples
from fedora_qa.estimators.imu.sampled_curves import VectorSamples, divided_differences
from fedora_qa.estimators.imu.white_noise import noise_level
from tests.estimators.imu.smooth_motion import TIMES_NS, TIMES_S, uneven_ns
from tests.support.motion_world import RESTLESS


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


@pytest.mark.parametrize("stride", [3, 12, 35])
def test_straight_lines_of_a_part_are_found_with_their_rows(stride: int) -> None:
    """Poses between every n-th one lie on lines from row 60 to row 200; what lies outside is a motion."""
    positions_m = RESTLESS.positions_m(TIMES_S)
    knots = np.arange(60, 201, stride)
    part = np.arange(60, knots[-1] + 1)
    for axis in range(3):
        positions_m[part, axis] = np.interp(TIMES_S[part], TIMES_S[knots], positions_m[knots, axis])
    resolution = float(np.spacing(np.abs(positions_m).max()))
    found = find_straight_lines(TIMES_NS, VectorSamples(positions_m), resolution=resolution)
    assert found is not None
    assert found.stride == stride
    assert found.rows == (60, knots[-1])
    assert found.evenness < 1e-6


@pytest.mark.parametrize("per_step", [4, 9])
def test_coarse_steps_of_an_even_motion_are_no_straight_lines(per_step: int) -> None:
    """A coordinate that moves by a step every n-th sample is straight between, and bends by the step alone."""
    stairs = np.zeros((len(TIMES_NS), 3))
    stairs[:, 0] = np.arange(len(TIMES_NS)) // per_step * 0.0625
    curve = VectorSamples(stairs)
    assert (found := find_interpolation(TIMES_NS, curve, resolution=1e-15)) is not None
    assert found.evenness < 0.01
    assert find_interpolation(TIMES_NS, curve, resolution=1e-15, step=0.0625) is None
    assert find_straight_lines(TIMES_NS, curve, resolution=1e-15, step=0.0625) is None


def test_a_motion_lies_on_no_straight_lines() -> None:
    """Neither does a body at rest, nor one that keeps its velocity and turns once."""
    motion_m = RESTLESS.positions_m(TIMES_S)
    turned_m = np.abs(TIMES_S - TIMES_S[len(TIMES_S) // 2])[:, None] * [1.0, 0.5, 0.0]
    for positions_m in (motion_m, np.ones_like(motion_m), turned_m):
        resolution = float(np.spacing(np.abs(positions_m).max()))
        assert find_straight_lines(TIMES_NS, VectorSamples(positions_m), resolution=resolution) is None
