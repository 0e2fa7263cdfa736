"""How one camera's pixels lie in another's image."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.edge_steps import DepthSteps
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.event_camera import AXES_AGREE, CENTRES_AGREE_M

Float64 = NDArray[np.float64]

_FARTHEST_TURN_RAD: Final = np.deg2rad(10.0)
"""Cameras turned further against each other see rows of one as slanted lines in the other."""


def why_not_comparable(facts: Facts, first: str, second: str) -> str:
    """Say why steps in one camera cannot be looked for in the other; empty where they can."""
    cameras = facts.declared.cameras
    missing = [name for name in (first, second) if name not in cameras]
    if missing:
        return f"the camera {' and the camera '.join(missing)} is not declared in /metadata/cameras"
    one, other = cameras[first], cameras[second]
    if one.model != "pinhole" or other.model != "pinhole":
        return f"Expected pinhole cameras, got {one.model} ({first}) and {other.model} ({second})"
    matrices = (one.K, other.K, one.T_body_camera, other.T_body_camera)
    if not all(np.all(np.isfinite(matrix)) for matrix in matrices) or min(one.K[0, 0], one.K[1, 1]) <= 0:
        return f"K or T_body_camera of the cameras {first} and {second} is not usable"
    R = other.T_body_camera[:3, :3].T @ one.T_body_camera[:3, :3]
    if np.trace(R) < 1 + 2 * np.cos(_FARTHEST_TURN_RAD):
        return f"the cameras {first} and {second} look in different directions"
    return ""


def why_not_one_view(facts: Facts, first: str, second: str) -> str:
    """Say why the cameras do not see one picture up to its scale; empty where they do."""
    reason = why_not_comparable(facts, first, second)
    if reason:
        return reason
    one, other = facts.declared.cameras[first], facts.declared.cameras[second]
    difference = np.abs(one.T_body_camera - other.T_body_camera)
    if difference[:3, 3].max() > CENTRES_AGREE_M:
        return f"the cameras {first} and {second} do not share one centre"
    if difference[:3, :3].max() > AXES_AGREE or one.K[0, 1] or other.K[0, 1]:
        return f"the cameras {first} and {second} do not look in one direction without skew"
    return ""


def seen_from(source: Camera, target: Camera, steps: DepthSteps) -> tuple[Float64, Float64]:
    """Return columns and rows (n,), px, at which the target camera sees the outlines that the source sees.

    An outline belongs to the nearer surface, whose depth takes it to a camera that sits elsewhere. Points that end up
    beside or behind the target camera come out as -1, outside its image.
    """
    if np.array_equal(source.K, target.K) and np.array_equal(source.T_body_camera, target.T_body_camera):
        return steps.columns, steps.rows
    pixels = np.stack((steps.columns, steps.rows, np.ones(len(steps))))
    points_m = steps.depths_m * (np.linalg.inv(source.K) @ pixels)
    T_target_source = np.linalg.inv(target.T_body_camera) @ source.T_body_camera
    x, y, z = target.K @ (T_target_source[:3, :3] @ points_m + T_target_source[:3, 3:])
    ahead = z > 0
    columns, rows = (np.divide(one, z, out=np.full(len(steps), -1.0), where=ahead) for one in (x, y))
    return columns, rows
