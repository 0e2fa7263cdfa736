"""Intrinsics and poses of the cameras."""

import numpy as np
import pytest

from fedora_generator.camera import CameraOptions, colour_camera, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight, FlightOptions


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
