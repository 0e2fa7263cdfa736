"""Templates of tiles: how a camera's motion changes as its mounting does."""

import numpy as np

from fedora_qa.checks.flow.tile_templates import by_mounting
from fedora_qa.geometry.camera import camera_motion
from fedora_qa.geometry.so3 import exp


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
