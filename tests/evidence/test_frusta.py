"""Frusta are where the poses and the mounting place a camera, and their rays are those of the corners of its image."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.evidence.trajectory import frusta_of
from fedora_qa.geometry.lens import pixels_of_rays
from fedora_qa.sequence.declared import Camera, Lens
from tests.evidence.test_clouds import LEVER_M, T_BODY_CAMERA, K

CAMERA = Camera(8, 6, K, T_BODY_CAMERA)
YAWS_RAD = np.array([0.0, 0.7, 2.0])
POSITIONS_M = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 1.0], [6.0, 8.0, 2.0]])
TIMES_US = np.arange(3.0)


def turned(**cameras: Camera) -> dict[str, np.ndarray]:
    """What is kept of a body that yaws, by the last part of the names."""
    R_world_body = Rotation.from_euler("Z", YAWS_RAD[:, None]).as_matrix()
    kept = frusta_of(cameras, TIMES_US, POSITIONS_M, R_world_body)
    assert {name.rpartition("/")[0] for name in kept} <= {f"frusta/{camera}" for camera in cameras}
    return {name.rpartition("/")[2]: array for name, (array, _) in kept.items()}


def test_rays_are_those_of_the_corners() -> None:
    """Back through an independent chain of rotations and a lens, they fall on the outer edges of the corner pixels."""
    lens = Lens("radtan", (-0.1, 0.01, 1e-3, 0.0))
    kept = turned(rgb=replace(CAMERA, lens=lens))
    for k, yaw_rad in enumerate(YAWS_RAD):
        back = Rotation.from_euler("Z", -yaw_rad)
        np.testing.assert_allclose(back.apply(kept["centres_world_m"][k] - POSITIONS_M[k]), LEVER_M, atol=1e-12)
        forward, left, up = back.apply(kept["rays_world"][k]).T
        np.testing.assert_allclose(forward, 1.0, atol=1e-12)
        columns, rows = pixels_of_rays(K, lens, -left, -up)
        np.testing.assert_allclose(columns, [-0.5, 7.5, 7.5, -0.5], atol=1e-5)
        np.testing.assert_allclose(rows, [-0.5, -0.5, 5.5, 5.5], atol=1e-5)


def test_the_first_usable_camera_is_kept() -> None:
    """A camera without an image plane, or whose lens images no ray at a corner, gives way to the next."""
    fisheye, folded = replace(CAMERA, model="omnidirectional"), Lens("radtan", (-0.9, 0.0, 0.0, 0.0))
    kept = frusta_of(
        {"events": CAMERA, "depth": CAMERA, "rgb": fisheye}, TIMES_US[:1], POSITIONS_M[:1], np.eye(3)[None]
    )
    assert set(kept) == {f"frusta/depth/{name}" for name in ("times_us", "centres_world_m", "rays_world")}
    assert turned(rgb=replace(CAMERA, lens=folded)) == {}
    assert turned() == {}
