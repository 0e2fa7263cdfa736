"""A camera of a rig whose axes are not those of the others."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.diagnosis.declared_cameras import hypotheses_of_mountings, odd_mounting
from fedora_qa.sequence.facts import Facts
from tests.support.memory_sequence import facts_of, memory_sequence


def rig(**rotations_deg: tuple[float, float, float]) -> Facts:
    """Facts of parallel cameras, some of which are rotated."""
    facts = facts_of(memory_sequence())
    cameras = dict(facts.declared.cameras)
    for name, rotation_deg in rotations_deg.items():
        T_body_camera = cameras[name].T_body_camera.copy()
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ Rotation.from_rotvec(rotation_deg, degrees=True).as_matrix()
        cameras[name] = replace(cameras[name], T_body_camera=T_body_camera)
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


@pytest.mark.parametrize("name", ["rgb", "depth", "events"])
def test_the_odd_camera_is_told_with_its_rotation(name: str) -> None:
    """Undone, it is parallel to the others."""
    facts = rig(**{name: (0.31, -1.27, 0.83)})
    odd = odd_mounting(facts)
    assert odd is not None
    assert odd.camera == name
    assert odd.rotation_deg == pytest.approx((0.31, -1.27, 0.83))
    undone = odd.undo(facts, memory_sequence()).declared
    assert undone is not None
    first, *others = (camera.T_body_camera[:3, :3] for camera in undone.cameras.values())
    assert all(np.allclose(first, other, atol=1e-12) for other in others)
    (hypothesis,) = hypotheses_of_mountings(facts, (name,))
    assert hypothesis.magnitude == pytest.approx(-np.linalg.norm((0.31, -1.27, 0.83)))
    assert hypotheses_of_mountings(facts, {"rgb", "depth", "events"} - {name}) == ()


@pytest.mark.parametrize(
    "rotations",
    [
        pytest.param({}, id="parallel"),
        pytest.param({"depth": (5.0, 0.0, 0.0)}, id="an angle that somebody chose"),
        pytest.param({"depth": (0.31, -1.27, 0.83), "rgb": (1.0, 0.2, -0.4)}, id="all differ"),
        pytest.param({"depth": (31.3, -12.7, 8.3)}, id="another view"),
    ],
)
def test_no_camera_is_odd(rotations: dict[str, tuple[float, float, float]]) -> None:
    """Rigs of designers, and of cameras that are all calibrated, have none."""
    assert odd_mounting(rig(**rotations)) is None
