"""The motion behind a flow field is recovered, and small faults are told from it and sized."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.flow.motion_fit import FlowSample, fit_most, fit_motion, parallel_sum, twist_statistic
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import rigid_flow

K = np.array([[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]])
MOTION = RigidMotion(Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix(), np.array([0.1, -0.05, -0.4]))
SIGMA_PX = 1e-4
SPREAD = np.diag([0.003, 0.003, 0.003, 0.01, 0.01, 0.01]) ** 2


def sample(motion: RigidMotion = MOTION, K_made: np.ndarray = K, gain: float = 1.0, seed: int = 0) -> FlowSample:
    rng = np.random.default_rng(seed)
    columns, rows, depths_m = rng.uniform(0, 640, 300), rng.uniform(0, 480, 300), rng.uniform(1.0, 20.0, 300)
    flow_px = gain * rigid_flow(K_made, motion, columns, rows, depths_m)
    return FlowSample(columns, rows, depths_m, flow_px, SIGMA_PX)


def test_motion_is_recovered_exactly() -> None:
    """From a start that is off by a degree and 5 cm, to rounding: three-dimensional scenes leave nothing open."""
    twist = np.array([0.01, -0.015, 0.02, 0.05, -0.02, 0.03])
    fit = fit_motion(K, MOTION, sample(MOTION.corrected(twist)))
    assert fit is not None
    np.testing.assert_allclose(fit.twist, twist, atol=1e-9)
    assert np.abs(fit.residual_px).max() < 1e-8


def test_nonsense_is_refused() -> None:
    """A field that no motion explains, hundreds of pixels off, gives no fit rather than a wild one."""
    garbage = sample()
    rng = np.random.default_rng(1)
    wild = FlowSample(garbage.columns, garbage.rows, garbage.depths_m, 5000 * rng.standard_normal((300, 2)), SIGMA_PX)
    assert fit_motion(K, MOTION, wild) is None


@pytest.mark.parametrize("share", [0.25, 0.45])
def test_motion_of_most_pixels_is_recovered_exactly(share: float) -> None:
    """Pixels that move by themselves, anywhere in the image, have no effect as long as they are less than half."""
    twist = np.array([0.01, -0.015, 0.02, 0.05, -0.02, 0.03])
    whole = sample(MOTION.corrected(twist))
    moving = np.random.default_rng(3).random(300) < share
    whole.flow_px[moving] += [8.0, -5.0]
    fit = fit_motion(K, MOTION, whole)
    assert fit is not None
    assert np.abs(fit.twist - twist).max() > 1e-3
    most = fit_most(K, MOTION, whole, fit)
    np.testing.assert_allclose(most.twist, twist, atol=1e-9)
    np.testing.assert_allclose(most.residual_px[moving], np.tile([8.0, -5.0], (moving.sum(), 1)), atol=1e-6)
    np.testing.assert_allclose(most.residual_px[~moving], 0.0, atol=1e-6)


def test_correction_is_chi_square_under_its_noise() -> None:
    """Over 400 draws of the declared noise the statistic has mean 6 and variance 12, the moments of chi-square(6)."""
    rng = np.random.default_rng(2)
    statistics = []
    for _ in range(400):
        twist = np.sqrt(np.diag(SPREAD)) * rng.standard_normal(6)
        fit = fit_motion(K, MOTION, sample(MOTION.corrected(twist)))
        assert fit is not None
        statistic, expected = twist_statistic(fit, SPREAD)
        assert expected == pytest.approx(6.0, abs=1e-3)
        statistics.append(statistic)
    assert np.mean(statistics) == pytest.approx(6.0, abs=5 * np.sqrt(12 / 400))
    assert np.var(statistics) == pytest.approx(12.0, rel=0.4)


def test_parallel_sum_is_that_of_the_inverses() -> None:
    """Of regular matrices; of a singular one, where only its own directions count; of any size, where 1 is lost."""
    rng = np.random.default_rng(4)
    one, other = (root @ root.T for root in rng.normal(size=(2, 6, 6)))
    np.testing.assert_allclose(parallel_sum(one, other), np.linalg.inv(np.linalg.inv(one) + other), rtol=1e-8)
    flat = np.outer(one[0], one[0])
    limit = flat / (1.0 + one[0] @ other @ one[0])
    np.testing.assert_allclose(parallel_sum(flat, other), limit, atol=1e-9 * np.abs(limit).max())
    huge = 1e30 * np.outer(other[0], other[0])
    left = parallel_sum(one, huge)
    assert np.all(np.isfinite(left))
    assert abs(other[0] @ left @ other[0]) < 1e-12 * (other[0] @ one @ other[0])
