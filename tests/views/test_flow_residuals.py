"""Templates of tiles: how a camera's motion changes as its mounting does."""

import numpy as np
import pytest

from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.geometry.so3 import exp
from fedora_qa.views.flow_residuals import _twist_between, by_mounting


def test_a_turned_mounting_changes_the_motion() -> None:
    """The twist per radian is that by which the motion of a camera that is turned a little differs."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = exp(np.array([0.4, -1.2, 0.7])), (0.2, -0.1, 0.05)
    poses = (
        exp(np.array([0.1, 0.2, 0.3])),
        np.array([1.0, 2, 3]),
        exp(np.array([0.2, 0.1, 0.5])),
        np.array([1.3, 2, 2]),
    )
    motion, step = camera_motion(*poses, T), 1e-6
    for axis, turn in enumerate(step * np.eye(3)):
        ends = []
        for by in (turn, -turn):
            turned = T.copy()
            turned[:3, :3] = T[:3, :3] @ exp(by)
            ends.append(camera_motion(*poses, turned).twist_from(motion))
        np.testing.assert_allclose(by_mounting(motion)[:, axis], (ends[0] - ends[1]) / (2 * step), atol=1e-6)


@pytest.mark.parametrize("turn_rad", [0.0, 1e-9, 1e-4, 0.3, 1.0, 1.1, 3.0])
def test_a_twist_between_motions_is_that_of_the_logarithm(turn_rad: float) -> None:
    """Whatever the angle, to the rounding of the matrices."""
    axis = np.array([0.6, -0.64, 0.48])
    other = RigidMotion(exp(np.array([0.4, -1.2, 0.7])), np.array([0.2, -0.1, 0.05]))
    one = RigidMotion(exp(turn_rad * axis) @ other.R, np.array([0.3, 0.1, -0.2]))
    found = _twist_between(one, other)
    np.testing.assert_allclose(found, one.twist_from(other), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found[:3], turn_rad * axis, rtol=1e-9, atol=1e-15)
