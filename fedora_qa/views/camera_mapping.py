"""How one camera's pixels lie in another's image."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import DepthSteps
from fedora_qa.geometry.lens import distorted, undistorted
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.camera_axes import AXES_AGREE, CENTRES_AGREE_M, is_about_parallel, why_not_one_lens

Float64 = NDArray[np.float64]


def why_not_comparable(facts: Facts, first: str, second: str) -> str:
    """Return why depth steps in one camera cannot be located in the other; empty where they can.

    Parameters
    ----------
    facts
        With the declared cameras.
    first, second
        Names of the cameras.

    Returns
    -------
    str
        A sentence, or an empty string.
    """
    cameras = facts.declared.cameras
    missing = [name for name in (first, second) if name not in cameras]
    if missing:
        return f"the camera {' and the camera '.join(missing)} is not declared in /metadata/cameras"
    camera1, camera2 = cameras[first], cameras[second]
    if camera1.model != "pinhole" or camera2.model != "pinhole":
        return f"Expected pinhole cameras, got {camera1.model} ({first}) and {camera2.model} ({second})"
    matrices = (camera1.K, camera2.K, camera1.T_body_camera, camera2.T_body_camera)
    if not all(np.all(np.isfinite(matrix)) for matrix in matrices) or min(camera1.K[0, 0], camera1.K[1, 1]) <= 0:
        return f"K or T_body_camera of the cameras {first} and {second} is not usable"
    if not is_about_parallel(camera1, camera2):
        return f"the optical axes of the cameras {first} and {second} differ"
    return ""


def why_not_one_centre(facts: Facts, first: str, second: str) -> str:
    """Return why the pixels of two cameras have no position in each other's image; empty where they have.

    Cameras of one centre see each point along one ray, at any depth: their lenses, their rotation and K relate their
    pixels.

    Parameters
    ----------
    facts
        With the declared cameras.
    first, second
        Names of the cameras.

    Returns
    -------
    str
        A sentence, or an empty string. Besides the conditions of ``why_not_comparable``, the centres must agree within
        ``CENTRES_AGREE_M``, without skew.
    """
    reason = why_not_comparable(facts, first, second)
    if reason:
        return reason
    camera1, camera2 = facts.declared.cameras[first], facts.declared.cameras[second]
    # Two centres give parallax, which depends on depth: no mapping of pixels then takes one image to the other.
    if np.abs(camera1.T_body_camera - camera2.T_body_camera)[:3, 3].max() > CENTRES_AGREE_M:
        return f"the cameras {first} and {second} do not share one centre"
    if camera1.K[0, 1] or camera2.K[0, 1]:
        return f"K of the cameras {first} and {second} has skew"
    return ""


def why_not_one_view(facts: Facts, first: str, second: str, *, rotated: bool = False) -> str:
    """Return why the images of two cameras differ by more than a scale; empty where they do not.

    Cameras of one direction and one lens image a ray at one point of the image plane, so that K alone relates their
    pixels.

    Parameters
    ----------
    facts
        With the declared cameras.
    first, second
        Names of the cameras.
    rotated
        Whether the axes of pinhole cameras without distortion may differ, as by ``is_about_parallel``: K and a rotation
        then relate their pixels.

    Returns
    -------
    str
        A sentence, or an empty string. Besides the conditions of ``why_not_one_centre``, the elements of the rotations
        must agree within ``AXES_AGREE``.
    """
    reason = why_not_one_centre(facts, first, second)
    if reason:
        return reason
    camera1, camera2 = facts.declared.cameras[first], facts.declared.cameras[second]
    difference = np.abs(camera1.T_body_camera - camera2.T_body_camera)
    may_differ = rotated and camera1.lens is camera2.lens is None
    if difference[:3, :3].max() > AXES_AGREE and not may_differ:
        return f"the axes of the cameras {first} and {second} differ"
    return why_not_one_lens(camera1, camera2, (first, second))


def outlines_in_camera(source: Camera, target: Camera, steps: DepthSteps) -> tuple[Float64, Float64]:
    """Return where the outlines of one camera's depth lie in another camera.

    Parameters
    ----------
    source, target
        The camera of the depth, and the camera into which the outlines are projected.
    steps
        Outlines with n points. Each belongs to the nearer surface; its depth gives the point that is projected.

    Returns
    -------
    tuple
        Columns and rows (n,), px; -1, outside of the image, for points beside or behind the target camera.
    """
    same_pixels = np.array_equal(source.K, target.K) and source.lens == target.lens
    if same_pixels and np.array_equal(source.T_body_camera, target.T_body_camera):
        return steps.columns, steps.rows
    pixels = np.stack((steps.columns, steps.rows, np.ones(len(steps))))
    # X = z m with the ray m = K^-1 (u, v, 1)^T before the lens, in m in the source camera (Z forward, X right, Y down).
    rays = np.linalg.inv(source.K) @ pixels
    rays[0], rays[1] = undistorted(source.lens, rays[0], rays[1])
    points_m = steps.depths_m * rays
    T_target_source = np.linalg.inv(target.T_body_camera) @ source.T_body_camera
    in_target_m = T_target_source[:3, :3] @ points_m + T_target_source[:3, 3:]
    if target.lens is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            # A ray that the lens does not image becomes NaN, which is not ahead of the camera either.
            in_target_m[:2] = distorted(target.lens, *(in_target_m[:2] / in_target_m[2])) * in_target_m[2]
    x, y, z = target.K @ in_target_m
    ahead = z > 0
    columns, rows = (np.divide(coordinate, z, out=np.full(len(steps), -1.0), where=ahead) for coordinate in (x, y))
    return columns, rows
