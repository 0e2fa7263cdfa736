"""Interpolated poses against motions in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.geometry import so3
from fedora_qa.geometry.motion import interpolate_poses, interpolation_gains, lagrange_weights, noise_of_difference

STEP_NS = 5_000_000


def tumbling(times_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and orientations of a body on a sine of 1 m and 3 Hz that also rolls by a sine of 1 rad."""
    phase = 2 * np.pi * 3 * times_ns * 1e-9
    positions_m = np.stack((np.sin(phase), np.cos(phase), 0.1 * phase), axis=-1)
    yaw_then_roll = Rotation.from_euler("ZX", np.stack((0.5 * phase, np.sin(phase)), axis=-1))
    return positions_m, yaw_then_roll.as_quat()


def errors(at_ns: np.ndarray, times_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    R, positions_m = interpolate_poses(times_ns, *tumbling(times_ns), at_ns=at_ns)
    true_positions_m, true_xyzw = tumbling(at_ns)
    off = so3.log(np.swapaxes(so3.matrices_from_quaternions(true_xyzw), -1, -2) @ R)
    return np.linalg.norm(off, axis=-1), np.linalg.norm(positions_m - true_positions_m, axis=-1)


def test_the_error_is_what_the_docstring_states() -> None:
    """A circle at 3 Hz, sampled at 200 Hz: below 0.0049 h^6 d6 inside and 0.024 h^6 d6 at the ends."""
    times_ns = np.arange(60) * STEP_NS
    circle_m = np.sqrt(2) * (2 * np.pi * 3 * STEP_NS * 1e-9) ** 6  # h^6 d6, a sine in each of two coordinates
    inside = np.arange(3 * STEP_NS, 56 * STEP_NS, 700_001)
    assert 0.002 * circle_m < errors(inside, times_ns)[1].max() < 0.0049 * circle_m
    ends = np.concatenate((np.arange(0, STEP_NS, 300_001), np.arange(58 * STEP_NS, 59 * STEP_NS, 300_001)))
    assert 0.0049 * circle_m < errors(ends, times_ns)[1].max() < 0.024 * circle_m


def test_rotations_converge_with_the_sixth_power_of_the_step() -> None:
    """Half the step leaves a 64th of the error, where rotations about changing axes do not commute."""
    at_ns = np.arange(100_000_000, 200_000_000, 1_100_003)
    coarse, fine = (errors(at_ns, np.arange(0, 300_000_001, step))[0].max() for step in (10_000_000, 5_000_000))
    assert 50 < coarse / fine < 80


def test_samples_are_given_back() -> None:
    """At a sample's stamp the sample itself comes out, to rounding, with uneven stamps and alternating signs."""
    times_ns = np.cumsum(np.array([0, 5, 6, 4, 5, 9, 5, 5])) * 1_000_000
    positions_m, orientations_xyzw = tumbling(times_ns)
    orientations_xyzw[::2] *= -1
    R, found_m = interpolate_poses(times_ns, positions_m, orientations_xyzw, at_ns=times_ns)
    np.testing.assert_allclose(found_m, positions_m, rtol=0, atol=1e-16)
    np.testing.assert_allclose(R, Rotation.from_quat(orientations_xyzw).as_matrix(), atol=1e-15)


def test_a_rotation_that_turns_evenly_is_exact() -> None:
    """Constant angular velocity is a straight line of rotation vectors: no interpolation error at 10 rad/s."""
    times_ns = np.arange(10) * STEP_NS
    orientations_xyzw = so3.exp_quaternion(times_ns[:, None] * 1e-9 * np.array([6.0, 0.0, 8.0]))
    at_ns = np.arange(0, 9 * STEP_NS, 123_457)
    R, _ = interpolate_poses(times_ns, np.zeros((10, 3)), orientations_xyzw, at_ns=at_ns)
    np.testing.assert_allclose(R, so3.exp(at_ns[:, None] * 1e-9 * np.array([6.0, 0.0, 8.0])), atol=1e-14)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_few_samples_are_enough_or_give_nan(count: int) -> None:
    """Outside the span NaN comes out; inside, what few samples can say."""
    times_ns = np.arange(count) * STEP_NS
    at_ns = np.array([-1, 0, STEP_NS // 2, 4 * STEP_NS + 1])
    R, positions_m = interpolate_poses(times_ns, *tumbling(times_ns), at_ns=at_ns)
    expected = [False, count > 0, count > 1, False]
    np.testing.assert_array_equal(np.isfinite(positions_m).all(axis=-1), expected)
    np.testing.assert_array_equal(np.isfinite(R).all(axis=(-1, -2)), expected)


def test_interpolation_multiplies_errors_of_samples_by_its_gain() -> None:
    """Positions that each err by 1, with either sign, err by the gain at most: 1 at a sample, 1.39 between samples."""
    times_ns = np.arange(20) * 5_000_000
    at_ns = np.array([45_000_000, 47_500_000, 2_500_000])
    gains = interpolation_gains(times_ns, at_ns=at_ns)
    np.testing.assert_allclose(gains, [1.0, 356 / 256, 766 / 256])
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (500, 20, 3))
    orientations = np.tile([0.0, 0.0, 0.0, 1.0], (20, 1))
    largest = np.max([np.abs(interpolate_poses(times_ns, s, orientations, at_ns=at_ns)[1]) for s in signs], axis=0)
    np.testing.assert_allclose(largest, np.tile(gains[:, None], 3), rtol=1e-9)


def test_a_wide_gap_is_not_bridged() -> None:
    """Between samples that are more than four steps apart NaN comes out; beside the gap nothing is lost."""
    times_ns = np.concatenate((np.arange(10), np.arange(15, 25))) * STEP_NS
    rotation, position = errors(np.array([8.5, 9, 12, 15, 15.5]) * STEP_NS, times_ns)
    np.testing.assert_array_equal(np.isnan(position), [False, False, True, False, False])
    assert np.nanmax(rotation) < 1e-6


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.lists(st.floats(-9, 9), min_size=6, max_size=6))
def test_lagrange_weights_reproduce_polynomials(jitter: list[float], coefficients: list[float]) -> None:
    """The weights give every polynomial of degree 5 exactly, on any stencil of distinct nodes."""
    nodes = np.arange(-2.3, 3.0) + 0.1 * np.array(jitter)
    weights = lagrange_weights(nodes[None])[0]
    np.testing.assert_allclose(weights @ np.polyval(coefficients, nodes), coefficients[-1], atol=1e-8)


def test_poses_that_share_samples_share_their_noise() -> None:
    """Between two samples the noise is that of two; of a line through two samples it is the share of their interval."""
    times_ns = 35_000_000 * np.arange(20, dtype=np.int64)
    assert noise_of_difference(times_ns, start_ns=int(times_ns[3]), end_ns=int(times_ns[9])) == pytest.approx(1.0)
    assert noise_of_difference(times_ns[:2], start_ns=5_000_000, end_ns=25_000_000) == pytest.approx(20 / 35)


@pytest.mark.parametrize(("start_ms", "end_ms"), [(300, 320), (311, 331), (20, 40), (205, 400)])
def test_the_noise_of_a_difference_is_that_of_drawn_noise(start_ms: int, end_ms: int) -> None:
    """2100 numbers have a spread with an error of 1.5%; four of them are allowed."""
    random, times_ns = np.random.default_rng(5), 35_000_000 * np.arange(20, dtype=np.int64)
    at_ns = 1_000_000 * np.array([start_ms, end_ms], dtype=np.int64)
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (20, 1))
    differences = [
        np.diff(interpolate_poses(times_ns, random.normal(size=(20, 3)), upright, at_ns=at_ns)[1], axis=0)[0]
        for _ in range(700)
    ]
    ratio = float(np.std(differences)) / np.sqrt(2.0)
    expected = noise_of_difference(times_ns, start_ns=int(at_ns[0]), end_ns=int(at_ns[1]))
    assert ratio == pytest.approx(expected, rel=0.065)
