"""White noise of smooth motions is measured; the motion is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, VectorSamples
from fedora_qa.estimators.imu.white_noise import noise_evenness, noise_level, noisiest_part, slow_noise
from tests.estimators.imu.smooth_motion import TIMES_NS, TIMES_S, polynomial, uneven_ns
from tests.support.motion_world import RESTLESS


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


@pytest.mark.parametrize("times_ns", [TIMES_NS, uneven_ns(601)], ids=["even", "uneven"])
def test_noise_is_in_every_sample_and_jumps_are_not(times_ns: NDArray[np.int64]) -> None:
    """White noise is as large by the median as by the largest tenth; positions that change between two sets do not."""
    motion = RESTLESS.positions_m(times_ns * 1e-9)
    noise = 0.003 * np.random.default_rng(7).standard_normal(motion.shape)
    assert noise_evenness(times_ns, VectorSamples(motion + noise), order=8) == pytest.approx(1.0, abs=0.1)
    for_a_while = noise * (np.abs(np.arange(len(motion)) - 300) < 60)[:, np.newaxis]
    assert noise_evenness(times_ns, VectorSamples(motion + for_a_while), order=8) > 0.5
    taking_turns = motion + 0.05 * (np.arange(len(motion)) // 26 % 2)[:, np.newaxis]
    assert noise_evenness(times_ns, VectorSamples(taking_turns), order=8) < 0.01
    assert noise_evenness(times_ns[:9], VectorSamples(motion[:9]), order=8) == 1.0


@pytest.mark.parametrize("rows", [(0, 200), (191, 416), (300, None)], ids=["begin", "middle", "end"])
def test_the_part_of_other_noise_is_found_with_its_ratio(rows: tuple[int, int | None]) -> None:
    """Samples in a larger unit have its factor in their noise, and change most where they begin and end."""
    samples = RESTLESS.positions_m(TIMES_S) + 0.003 * np.random.default_rng(2).standard_normal((601, 3))
    samples[slice(*rows)] *= 50.0
    part = noisiest_part(TIMES_NS, VectorSamples(samples), order=8)
    assert part is not None
    assert part.rows == rows
    assert part.ratio == pytest.approx(50.0, rel=0.2)


def test_noise_of_all_samples_has_no_part_that_differs_much() -> None:
    """Of a hundred draws none has a part of five times the noise; exact samples have none at all."""
    draws = [0.003 * np.random.default_rng(seed).standard_normal((601, 3)) for seed in range(100)]
    parts = [noisiest_part(TIMES_NS, VectorSamples(samples), order=8) for samples in draws]
    assert max(part.ratio for part in parts if part is not None) < 5.0
    assert noisiest_part(TIMES_NS, VectorSamples(np.zeros((601, 3))), order=8) is None


def test_noise_behind_a_filter_is_larger_between_samples_far_apart() -> None:
    """A mean over nine samples leaves a third of each; white noise of any size is no filtered one, nor is a motion."""
    noise = 0.003 * np.random.default_rng(4).standard_normal((609, 3))
    motion = RESTLESS.positions_m(TIMES_S)
    means = motion + np.stack([np.convolve(axis, np.full(9, 1 / 9), mode="valid") for axis in noise.T], axis=1)

    def slow(samples: NDArray[np.float64], declared: float) -> float | None:
        return slow_noise(TIMES_NS, lambda rows: VectorSamples(samples[rows]), order=8, declared=declared)

    assert slow(means, 0.003) == pytest.approx(0.001, rel=0.3)
    for declared in (0.003, 0.03):
        assert slow(motion + noise[:601], declared) is None
        assert slow(motion, declared) is None
