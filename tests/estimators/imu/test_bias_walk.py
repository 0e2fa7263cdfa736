"""The random walk of a bias within a segment: both ends and the bridge between them make up the walk."""

import numpy as np
import pytest

from fedora_qa.estimators.imu.bias_walk import BRIDGE_SQUARES, SegmentWalk

START_S, STOP_S, DENSITY = 2.0, 3.5, 0.3
TIMES_S = np.sort(np.random.default_rng(0).uniform(START_S, STOP_S, 40))
WALK = SegmentWalk(DENSITY, TIMES_S, START_S, STOP_S, np.full(40, 0.01))


def bridge_covariance(walk: SegmentWalk) -> np.ndarray:
    """The inverse of the tridiagonal information."""
    beside, own = walk.bridge_information
    return np.linalg.inv(np.diag(own) + np.diag(beside[1:], 1) + np.diag(beside[1:], -1))


@pytest.mark.parametrize("walk", [WALK, WALK.select(np.arange(40) % 3 > 0)], ids=["all rows", "two of three"])
def test_ends_and_bridge_have_the_covariance_of_a_wiener_process(walk: SegmentWalk) -> None:
    """Which is w^2 min(s, t) of two instants."""
    ends = DENSITY**2 * np.array([[START_S, START_S], [START_S, STOP_S]])
    due = DENSITY**2 * np.minimum.outer(walk.times_s, walk.times_s)
    np.testing.assert_allclose(walk.shares @ ends @ walk.shares.T + bridge_covariance(walk), due, rtol=1e-9)
    np.testing.assert_allclose(walk.variances, np.diag(due))
    np.testing.assert_allclose(walk.bridge_variances, np.diag(bridge_covariance(walk)))


def test_mean_variance_of_a_bridge_is_a_sixth_of_its_length() -> None:
    """And its squares have the eigenvalues of the closed form, as those of a dense covariance."""
    edges_s = np.linspace(START_S, STOP_S, 801)
    walk = SegmentWalk(DENSITY, (edges_s[1:] + edges_s[:-1]) / 2, START_S, STOP_S, np.diff(edges_s))
    assert np.mean(walk.bridge_variances) == pytest.approx(DENSITY**2 * (STOP_S - START_S) / 6, rel=1e-4)
    covariance = bridge_covariance(walk)
    assert np.sum(covariance**2) / np.trace(covariance) ** 2 == pytest.approx(BRIDGE_SQUARES, rel=1e-3)


def test_means_over_rows_vary_less_than_the_middles() -> None:
    """By the deficit, and means of different rows covary as the middles do: dense sums of a finely sampled walk."""
    rows, fine = 5, 400
    edges_s = np.linspace(START_S, STOP_S, rows + 1)
    walk = SegmentWalk(DENSITY, (edges_s[1:] + edges_s[:-1]) / 2, START_S, STOP_S, np.diff(edges_s))
    instants_s = START_S + (np.arange(rows * fine) + 0.5) * (STOP_S - START_S) / (rows * fine)
    of_instants = DENSITY**2 * np.minimum.outer(instants_s, instants_s)
    means = of_instants.reshape(rows, fine, rows, fine).mean(axis=(1, 3))
    middles = DENSITY**2 * np.minimum.outer(walk.times_s, walk.times_s)
    np.testing.assert_allclose(means, middles - np.diag(walk.mean_deficits), rtol=1e-5)
