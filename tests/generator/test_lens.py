"""Distorted cameras of the generator: its lens against OpenCV, its images against a pinhole, its flow against both."""

from dataclasses import replace
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from fedora_generator.camera import Camera, CameraOptions, Lens, colour_camera
from fedora_generator.errors import SceneError
from fedora_generator.flow import scene_flow_px
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene

LENSES = {
    "radtan": (-0.37, 0.16, 4e-4, -3e-4),
    "equidistant": (0.19, 0.004, 0.0007, -0.0004),
}


def distorted_scene(model: str, name: str = "park-day", width: int = 48, height: int = 36) -> Scene:
    camera = CameraOptions(width=width, height=height, distortion_model=model, distortion=LENSES[model])
    return replace(load_scene(name), camera=camera)


@pytest.fixture(params=LENSES)
def scene(request: pytest.FixtureRequest) -> Scene:
    return distorted_scene(request.param)


def places(camera: Camera) -> np.ndarray:
    """Where OpenCV sees the pixels in a pinhole's image: (height, width, 2), px."""
    assert camera.lens is not None
    pixels = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).astype(np.float64)
    undistort = cv2.undistortPoints if camera.lens.model == "radtan" else cv2.fisheye.undistortPoints
    # OpenCV stops after some steps: the rest is added as often as it takes.
    target, asked = pixels.reshape(-1, 1, 2), pixels.reshape(-1, 1, 2).copy()
    coefficients, still = np.array(camera.lens.coefficients), np.zeros(3)
    project = cv2.projectPoints if camera.lens.model == "radtan" else cv2.fisheye.projectPoints
    for _ in range(30):
        rays = undistort(asked, camera.K, coefficients).reshape(-1, 2)
        points = np.column_stack([rays, np.ones(len(rays))])[:, None]
        asked += target - project(points, still, still, camera.K, coefficients)[0].reshape(-1, 1, 2)
    return (points[:, 0] @ camera.K.T)[:, :2].reshape(pixels.shape)


def test_pixels_look_where_opencv_says(scene: Scene) -> None:
    """The maps give each pixel its place in the pinhole's image, to 1e-8 px."""
    camera = colour_camera(scene.camera)
    pixels = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1)
    homogeneous = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
    mapped = np.einsum("hwij,hwj->hwi", camera.pixel_maps, homogeneous)
    np.testing.assert_allclose(mapped[..., :2], places(camera), rtol=0, atol=1e-8)


def test_images_are_those_of_a_fine_pinhole(scene: Scene) -> None:
    """Depth at the centres is exact; radiance is the mean over a distorted pixel, here by 9 x 9 samples of it."""
    assert scene.world is not None
    world, camera = ExactWorld.of(scene.world, scene.light), colour_camera(scene.camera)
    T_world_camera = camera.pose_at(scene.fly(), 0)
    fine, every = 16, 9
    K = camera.K.copy()
    K[:2] *= fine
    # Wide enough for pincushions and barrels: half of the image again on each side.
    width, height = 2 * camera.width * fine, 2 * camera.height * fine
    K[0, 2], K[1, 2] = (width - 1) / 2, (height - 1) / 2
    pinhole = Camera(width, height, K, camera.T_body_camera)
    radiance_dn = world.luma_dn(pinhole, T_world_camera)
    offsets = (np.arange(every) - (every - 1) / 2) / every
    samples = np.zeros((camera.height, camera.width))
    for dx in offsets:
        for dy in offsets:
            pixels = np.stack(np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy, [1.0]), axis=-1)
            at = np.einsum("hwij,hwj->hwi", camera.pixel_maps, pixels[:, :, 0])
            rays = at @ np.linalg.inv(camera.K).T
            columns, rows = rays[..., 0] * K[0, 0] + K[0, 2], rays[..., 1] * K[1, 1] + K[1, 2]
            samples += map_coordinates(radiance_dn, [rows, columns], order=1) / every**2
    error_dn = np.abs(world.luma_dn(camera, T_world_camera) - samples)
    # Samples of an edge err by a ninth of its height at most.
    assert np.median(error_dn) < 0.05
    assert error_dn.max() < 6.0


def test_flow_ends_where_the_next_frame_shows_the_point(scene: Scene) -> None:
    """Points of the depth, moved by the poses and projected by OpenCV, end where the flow says."""
    assert scene.world is not None
    world, camera = ExactWorld.of(scene.world, scene.light), colour_camera(scene.camera)
    assert camera.lens is not None
    times_us = (0, 100_000)
    poses = tuple(camera.pose_at(scene.fly(), time_us) for time_us in times_us)
    inverse_depth = world.inverse_depth_per_m(camera, poses[0])
    flow = scene_flow_px(world, camera, inverse_depth, np.zeros(inverse_depth.shape, np.int64), poses, times_us)
    seen = inverse_depth > 0
    at = np.concatenate([places(camera), np.ones((*seen.shape, 1))], axis=-1)[seen]
    points0_m = at @ np.linalg.inv(camera.K).T / inverse_depth[seen][:, None]
    T_end_start = np.linalg.inv(poses[1]) @ poses[0]
    project = cv2.projectPoints if camera.lens.model == "radtan" else cv2.fisheye.projectPoints
    R, _ = cv2.Rodrigues(T_end_start[:3, :3])
    ends = project(points0_m[:, None], R, T_end_start[:3, 3], camera.K, np.array(camera.lens.coefficients))[0]
    rows, columns = np.nonzero(seen)
    expected = ends.reshape(-1, 2) - np.stack([columns, rows], axis=-1)
    np.testing.assert_allclose(flow[seen], expected, rtol=1e-5, atol=1e-5)


def test_files_declare_the_lens_of_their_cameras(tmp_path: Path) -> None:
    """Model and coefficients stand beside K; a camera without distortion declares none and keeps its digest."""
    scene = distorted_scene("radtan")
    streams = frozenset({"depth"})
    generate_sequence(scene, tmp_path / "bent.h5", Request(duration_s=0.02, streams=streams))
    with h5py.File(tmp_path / "bent.h5") as file:
        attributes = file["metadata/cameras/depth"].attrs
        assert attributes["distortion_model"] == "radtan"
        np.testing.assert_array_equal(attributes["distortion"], LENSES["radtan"])
    straight = replace(scene, camera=CameraOptions(width=48, height=36))
    assert straight.digest != scene.digest
    generate_sequence(straight, tmp_path / "straight.h5", Request(duration_s=0.02, streams=streams))
    with h5py.File(tmp_path / "straight.h5") as file:
        assert not {"distortion_model", "distortion"} & set(file["metadata/cameras/depth"].attrs)


def test_impossible_lenses_are_refused() -> None:
    """A wrong number of coefficients, a barrel that folds over within the image, and a mesh."""
    with pytest.raises(ValueError, match="4 or 5 numbers in distortion"):
        CameraOptions(distortion_model="radtan", distortion=(0.1,))
    with pytest.raises(SceneError, match="one-to-one over the image"):
        Lens("radtan", (-3.0, 0.0, 0.0, 0.0)).rays_of(np.array([[0.5, 0.3]]))
    with pytest.raises(ValueError, match="no distortion with the mesh renderer"):
        distorted_scene("radtan", "park-mesh-day")
