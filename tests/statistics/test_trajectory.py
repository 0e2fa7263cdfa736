"""Distance and greatest speeds against closed forms, exact and noisy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import erf

from fedora_qa.statistics.trajectory import CurveEstimate, rotation, translation

Float64 = NDArray[np.float64]

POSE_NOISE_M = 0.005
POSE_NOISE_RAD = np.radians(0.2)
Z_LIMIT = 5.0


def instants(duration_s: float) -> Float64:
    return np.arange(round(200 * duration_s) + 1) / 200.0


def circle(times_s: Float64) -> Float64:
    """A helix: radius 5 m, 1.2 rad/s, climbing at 0.3 m/s. Its speed is constant."""
    return np.stack([5 * np.cos(1.2 * times_s), 5 * np.sin(1.2 * times_s), 0.3 * times_s], axis=1)


def line(times_s: Float64) -> Float64:
    """A straight line, its speed 3 + 2 sin(2 t) m/s along (2, 3, 6) / 7."""
    along = 3 * times_s + 1 - np.cos(2 * times_s)
    return along[:, None] * np.array([2.0, 3.0, 6.0]) / 7.0


def tumble(times_s: Float64) -> Float64:
    """Turning by 8 sin(t / 2) rad about the axis (1, 2, 2) / 3; q changes sign on the way as solvers leave it."""
    turned = 8 * np.sin(times_s / 2)
    return Rotation.from_rotvec(turned[:, None] * np.array([1.0, 2.0, 2.0]) / 3.0).as_quat()


CIRCLE_SPEED = np.hypot(6.0, 0.3)
CURVES = {
    "circle": (circle, 4.0, 4 * CIRCLE_SPEED, CIRCLE_SPEED),
    "line": (line, 4.0, 12 + 1 - np.cos(8.0), 5.0),
    "rest": (np.zeros_like, 4.0, 0.0, 0.0),
}


def positions(name: str, times_s: Float64) -> Float64:
    return np.zeros((len(times_s), 3)) if name == "rest" else CURVES[name][0](times_s)


def deviation(estimate: CurveEstimate, truth: float) -> float:
    return abs(estimate.value - truth) / max(estimate.standard_error, 1e-9)


@pytest.mark.parametrize("name", CURVES)
def test_exact_poses(name: str) -> None:
    """Without noise nothing is smoothed away: distance and greatest speed agree with the closed form to 2e-5."""
    _, duration_s, distance_m, speed_max_m_s = CURVES[name]
    times_s = instants(duration_s)
    motion = translation(times_s, positions(name, times_s))
    assert motion is not None
    assert motion.length.value == pytest.approx(distance_m, rel=2e-5, abs=1e-9)
    assert motion.speed_max.value == pytest.approx(speed_max_m_s, rel=2e-5, abs=1e-9)
    assert motion.noise < 1e-6


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["circle", "line"])
def test_noisy_poses(name: str, seed: int) -> None:
    """5 mm of noise add metres to the naive sum of steps; here they stay within the error bar, below 1%."""
    _, duration_s, distance_m, speed_max_m_s = CURVES[name]
    times_s = instants(duration_s)
    noisy = positions(name, times_s) + np.random.default_rng(seed).normal(0, POSE_NOISE_M, (len(times_s), 3))
    naive = np.sum(np.linalg.norm(np.diff(noisy, axis=0), axis=1))
    motion = translation(times_s, noisy)
    assert motion is not None
    assert naive > distance_m + 0.5
    assert deviation(motion.length, distance_m) < Z_LIMIT
    assert deviation(motion.speed_max, speed_max_m_s) < Z_LIMIT
    assert motion.length.standard_error < 0.01 * distance_m
    assert motion.noise == pytest.approx(POSE_NOISE_M, rel=0.15)


def test_hovering_in_noise_covers_no_distance() -> None:
    """At rest, 5 mm of noise make a naive path of metres; here it is zero within its error of centimetres."""
    times_s = instants(10.0)
    noisy = np.random.default_rng(1).normal(0, POSE_NOISE_M, (len(times_s), 3))
    motion = translation(times_s, noisy)
    assert motion is not None
    assert np.sum(np.linalg.norm(np.diff(noisy, axis=0), axis=1)) > 20.0
    assert motion.length.value < Z_LIMIT * motion.length.standard_error
    assert motion.length.standard_error < 0.1


def test_errors_are_honest() -> None:
    """Over many noisy flights the deviations, in units of their error bars, have a spread of about one."""
    times_s = instants(3.0)
    truth = 3 * CIRCLE_SPEED
    random = np.random.default_rng(7)
    motions = [translation(times_s, circle(times_s) + random.normal(0, 0.02, (len(times_s), 3))) for _ in range(24)]
    scaled = [(m.length.value - truth) / m.length.standard_error for m in motions if m is not None]
    assert 0.4 < np.sqrt(np.mean(np.square(scaled))) < 1.7


def test_exact_rotation() -> None:
    """A turn about a fixed axis: angle and greatest rate agree with the closed form."""
    times_s = instants(4.0)
    motion = rotation(times_s, tumble(times_s))
    assert motion is not None
    assert motion.speed_max.value == pytest.approx(4.0, rel=2e-5)
    assert motion.length.value == pytest.approx(8 * (2 - np.sin(2.0)), rel=2e-5)


@pytest.mark.parametrize("seed", range(3))
def test_noisy_rotation(seed: int) -> None:
    """0.2 degrees of noise in the body frame stay within the error bar, and are measured as such."""
    times_s = instants(4.0)
    noise = Rotation.from_rotvec(np.random.default_rng(seed).normal(0, POSE_NOISE_RAD, (len(times_s), 3)))
    noisy = (Rotation.from_quat(tumble(times_s)) * noise).as_quat()
    motion = rotation(times_s, noisy)
    assert motion is not None
    assert deviation(motion.speed_max, 4.0) < Z_LIMIT
    assert deviation(motion.length, 8 * (2 - np.sin(2.0))) < Z_LIMIT
    assert motion.noise == pytest.approx(POSE_NOISE_RAD, rel=0.15)


def test_a_fast_turn_in_a_quiet_flight() -> None:
    """Ten seconds of noise at rest do not smooth away one turn of half a second."""
    times_s = instants(10.0)
    yaw = np.pi / 2 * erf((times_s - 7.3) / (0.2 * np.sqrt(2)))
    turning = Rotation.from_rotvec(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
    noise = Rotation.from_rotvec(np.random.default_rng(5).normal(0, POSE_NOISE_RAD, (len(times_s), 3)))
    motion = rotation(times_s, (turning * noise).as_quat())
    assert motion is not None
    assert deviation(motion.speed_max, np.pi / (0.2 * np.sqrt(2 * np.pi))) < Z_LIMIT
    assert motion.speed_max.standard_error < 0.03 * motion.speed_max.value


@settings(max_examples=20, deadline=None)
@given(
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    shift=st.tuples(*[st.floats(-1e5, 1e5)] * 3),
    signs=st.integers(0, 2**32 - 1),
)
def test_frame_and_sign_do_not_matter(
    turn: tuple[float, float, float], shift: tuple[float, float, float], signs: int
) -> None:
    """Another world frame, 100 km away, and quaternions of either sign give the same distance and speeds."""
    times_s = instants(1.0)
    world = Rotation.from_rotvec(turn)
    moved = translation(times_s, world.apply(circle(times_s)) + np.array(shift))
    flips = np.random.default_rng(signs).choice([-1.0, 1.0], (len(times_s), 1))
    turned = rotation(times_s, (world * Rotation.from_quat(tumble(times_s))).as_quat() * flips)
    still, still_turned = translation(times_s, circle(times_s)), rotation(times_s, tumble(times_s))
    assert moved is not None
    assert still is not None
    assert turned is not None
    assert still_turned is not None
    assert moved.length.value == pytest.approx(still.length.value, rel=1e-6)
    assert moved.speed_max.value == pytest.approx(still.speed_max.value, rel=1e-4)
    assert turned.length.value == pytest.approx(still_turned.length.value, rel=1e-6)
    assert turned.speed_max.value == pytest.approx(still_turned.speed_max.value, rel=1e-4)


def test_a_gap_is_bridged() -> None:
    """Half a second without poses on a straight line changes neither distance nor greatest speed."""
    times_s = instants(4.0)
    with_margins = (times_s < 1.5) | (times_s > 2.0)
    steady = np.outer(times_s, [1.0, 2.0, 2.0])
    motion = translation(times_s[with_margins], steady[with_margins])
    assert motion is not None
    assert motion.length.value == pytest.approx(12.0, rel=1e-6)
    assert motion.speed_max.value == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("count", [0, 1, 2, 15])
def test_too_few_poses(count: int) -> None:
    """A handful of poses cannot tell noise from motion: there is no estimate, and no crash."""
    times_s = np.arange(count) / 200.0
    assert translation(times_s, np.zeros((count, 3))) is None
    assert rotation(times_s, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))) is None
