"""Intrinsics and poses of the cameras."""

from dataclasses import replace
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from fedora_generator.camera import Camera, CameraOptions, Lens, colour_camera, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight, FlightOptions
from fedora_generator.flow import scene_flow_px
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene


def test_the_cameras_of_the_paper() -> None:
    """60 degrees across 1440 and 640 pixels: f = 1247.0766 and 554.2563 px, centres between the middle pixels."""
    colour, events = colour_camera(CameraOptions()), event_camera(CameraOptions())
    assert (colour.width, colour.height, events.width, events.height) == (1440, 1080, 640, 480)
    np.testing.assert_allclose(colour.K, [[1247.0766, 0, 719.5], [0, 1247.0766, 539.5], [0, 0, 1]], atol=5e-5)
    np.testing.assert_allclose(events.K, [[554.2563, 0, 319.5], [0, 554.2563, 239.5], [0, 0, 1]], atol=5e-5)


def test_both_cameras_see_a_direction_at_matching_pixels() -> None:
    """x_rgb + 1/2 = 2.25 (x_event + 1/2) for one ray through both."""
    colour, events = colour_camera(CameraOptions()), event_camera(CameraOptions())
    ray = np.array([0.21, -0.13, 1.0])
    x_rgb, x_event = (camera.K @ ray for camera in (colour, events))
    np.testing.assert_allclose(x_rgb[:2] + 0.5, 2.25 * (x_event[:2] + 0.5))


def test_a_camera_looks_ahead_from_its_mount() -> None:
    """A point 2 m ahead, 0.3 m right and 0.4 m down of the camera, taken to the body by hand."""
    camera = colour_camera(CameraOptions(position_body_m=(0.1, 0.0, -0.03)))
    np.testing.assert_allclose(camera.T_body_camera @ [0.3, 0.4, 2.0, 1.0], [2.1, -0.3, -0.43, 1.0])


def test_a_pitched_camera_looks_down() -> None:
    """Positive pitch lowers the view: the optical axis at 30 degrees is (cos 30, 0, -sin 30) in the body."""
    camera = colour_camera(CameraOptions(pitch_deg=30.0))
    np.testing.assert_allclose(camera.T_body_camera[:3, 2], [np.cos(np.pi / 6), 0, -0.5])
    np.testing.assert_allclose(np.linalg.det(camera.T_body_camera), 1.0)


def test_the_pose_carries_the_lever_arm_round() -> None:
    """A body at (1, 2, 3) turned left by 90 degrees: the camera 0.1 m ahead of it is 0.1 m north, and looks north."""
    camera = colour_camera(CameraOptions(position_body_m=(0.1, 0.0, 0.0)))
    flight = Flight(FlightOptions(position_m=(1.0, 2.0, 3.0), attitude_deg=(90.0, 0.0, 0.0)))
    T_world_camera = camera.pose_at(flight, 0)
    np.testing.assert_allclose(T_world_camera[:3, 3], [1.0, 2.1, 3.0])
    np.testing.assert_allclose(T_world_camera[:3, 2], [0, 1, 0], atol=1e-12)


def test_a_camera_needs_pixels() -> None:
    """Size 0 is refused, and a size that leaves the event camera none."""
    with pytest.raises(ValueError, match="at least 1x1 pixels, got 0x10"):
        CameraOptions(width=0, height=10)
    with pytest.raises(SceneError, match="leaves the event camera a pixel, got 40x1"):
        event_camera(CameraOptions(width=40, height=1))


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
