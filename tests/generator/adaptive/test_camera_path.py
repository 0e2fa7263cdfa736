"""The camera's way as polynomials is that of the flight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.adaptive.camera_path import camera_paths
from fedora_generator.adaptive.light_kernels import look
from fedora_generator.camera import event_camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.render import ExactWorld
from fedora_generator.scene import load_scene
from fedora_generator.surfaces.faces import project_faces
from fedora_generator.surfaces.shading_kernels import View
from fedora_qa.conventions import NS_PER_S

SCENE = load_scene("fast-turn").with_size(72, 54)
WORLD = ExactWorld.of(SCENE.world, SCENE.light)
CAMERA = event_camera(SCENE.camera)


@given(st.floats(0, 10), st.floats(1e-3, 0.1), st.lists(st.floats(0, 1), min_size=1, max_size=5))
@settings(max_examples=40, deadline=None)
def test_a_path_is_the_flight_to_rounding(start_s: float, length_s: float, shares: list[float]) -> None:
    """At any instant of a path of the fastest turn, rays and position are the flight's to 1e-12."""
    start_ns = round(start_s * NS_PER_S)
    flight = SCENE.fly()
    paths = camera_paths(WORLD, CAMERA, flight, start_ns, start_ns + round(length_s * NS_PER_S))
    for path in paths:
        for share in shares:
            time_s = (path.start_ns + share * (path.stop_ns - path.start_ns)) / NS_PER_S
            pose = CAMERA.poses_between(flight, np.array([time_s]))[0]
            rays, places_m = path.at(share)
            np.testing.assert_allclose(rays, pose[:3, :3] @ np.linalg.inv(CAMERA.K), atol=1e-12)
            np.testing.assert_allclose(places_m, pose[None, :3, 3], atol=1e-12)


@pytest.mark.parametrize("name", ["park-day", "hover"])
def test_minutes_after_its_start_a_flight_is_as_smooth(name: str) -> None:
    """Rounding grows with the phase of a swing, and entries that cross zero have no digits of their own to lose."""
    scene = load_scene(name).with_size(72, 54)
    flight, frame_ns = scene.fly(), 20_000_000
    for number in range(1_500, 6_000, 3):
        paths = camera_paths(WORLD, CAMERA, flight, number * frame_ns, (number + 1) * frame_ns)
        assert len(paths) <= 2


def test_what_shakes_is_cut_into_more_paths() -> None:
    """A shake of 300 Hz turns six times in 20 ms: more than one polynomial, true to 1e-11, and no gap between."""
    flight = Flight(
        FlightOptions(position_m=(0.0, 0.0, 1.0), terms=(HarmonicTerm(axis="yaw", amplitude=1.0, frequency_hz=300.0),))
    )
    paths = camera_paths(WORLD, CAMERA, flight, 0, 20_000_000)
    assert len(paths) > 1
    assert [path.start_ns for path in paths] == [0, *(path.stop_ns for path in paths[:-1])]
    assert paths[-1].stop_ns == 20_000_000
    for path in paths:
        pose = CAMERA.poses_between(flight, np.array([(0.3 * path.start_ns + 0.7 * path.stop_ns) / NS_PER_S]))[0]
        np.testing.assert_allclose(path.at(0.7)[0], pose[:3, :3] @ np.linalg.inv(CAMERA.K), atol=1e-11)


def test_what_no_polynomial_holds_is_refused() -> None:
    """A shake of 1 GHz turns within every microsecond: one message, and no endless halving."""
    shake = HarmonicTerm(axis="x", amplitude=1.0, frequency_hz=1e9)
    flight = Flight(FlightOptions(position_m=(0.0, 0.0, 1.0), terms=(shake,)))
    with pytest.raises(SceneError, match="Expected a flight that moves smoothly"):
        camera_paths(WORLD, CAMERA, flight, 0, 20_000_000)


def test_a_look_is_the_projection_of_the_faces() -> None:
    """The lines of every face at an instant of a path are those of the pose there; a face turned away is nowhere."""
    faces = WORLD.faces
    (path,) = camera_paths(WORLD, CAMERA, SCENE.fly(), 980_000_000, 990_000_000)
    every = np.arange(len(faces.textures))
    view = View(every, np.empty((len(every), 7, 3)), np.empty((3, 3)))
    look(faces.frames, faces.bodies, path.coefficients, 0.37, view, np.empty((1, 3)), np.empty((2, 12)))
    pose = CAMERA.poses_between(SCENE.fly(), np.array([0.9837]))[0]
    front, lines = project_faces(faces, CAMERA.K, pose)
    np.testing.assert_allclose(view.lines[front], lines, atol=1e-11 * np.abs(lines).max())
    away = np.setdiff1d(every, front)
    assert away.size
    assert (view.lines[away, 3:, 2] == -1).all()
    assert (view.lines[away, 3:, :2] == 0).all()
