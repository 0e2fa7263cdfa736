"""The camera's way as polynomials is that of the flight."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.adaptive.camera_path import CameraPath, TilePlan, camera_paths, plan_tiles
from fedora_generator.adaptive.light_kernels import look
from fedora_generator.camera import Camera, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight, FlightOptions, HarmonicTerm
from fedora_generator.flow import flow_px
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene
from fedora_generator.surfaces.faces import project_faces
from fedora_generator.surfaces.render_kernels import TILE
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


EXACT = ("park-day", "racetrack", "fast-turn")
BOUND_PX = 0.5


def planned(name: str, start_us: int = 980_000) -> tuple[ExactWorld, Scene, Camera, CameraPath, TilePlan]:
    """A scene at 160x120 events, and the plan of the 20 ms from a start."""
    scene = load_scene(name).with_size(360, 270)
    world, camera = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera)
    (path,) = camera_paths(world, camera, scene.fly(), start_us * 1000, (start_us + 20_000) * 1000)
    return world, scene, camera, path, plan_tiles(world.faces, path, camera.height, camera.width, BOUND_PX)


def by_tile(image: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Largest value (tiles,) of each tile."""
    rows, columns = -(-image.shape[0] // TILE), -(-image.shape[1] // TILE)
    padded = np.pad(image, ((0, rows * TILE - image.shape[0]), (0, columns * TILE - image.shape[1])))
    return np.asarray(padded.reshape(rows, TILE, columns, TILE).max(axis=(1, 3)).ravel())


@pytest.mark.parametrize("name", EXACT)
def test_no_tile_moves_farther_than_the_bound_between_its_samples(name: str) -> None:
    """The flow of every step of every tile, from depth and poses, is under the bound (2%: pace changes a little)."""
    world, scene, camera, path, plan = planned(name)
    flight = scene.fly()
    for samples in np.unique(plan.samples).tolist():
        times_s = np.linspace(path.start_ns, path.stop_ns, samples + 1) / NS_PER_S
        poses = camera.poses_between(flight, times_s)
        for here, there in pairwise(poses):
            flow = flow_px(world.inverse_depth_per_m(camera, here), camera.K, here, there)
            moved_px = by_tile(np.nan_to_num(np.hypot(flow[..., 0], flow[..., 1])))
            assert moved_px[plan.samples == samples].max() < 1.02 * BOUND_PX


@pytest.mark.parametrize("name", EXACT)
def test_a_tile_knows_every_face_it_shows(name: str) -> None:
    """At 21 instants of the path, the faces that are nearest at the pixels of a tile are among those of its plan."""
    world, scene, camera, path, plan = planned(name)
    flight = scene.fly()
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1).reshape(-1, 3).astype(float)
    tiles = (rows // TILE * -(-camera.width // TILE) + columns // TILE).ravel()
    shown = 0
    for time_s in np.linspace(path.start_ns, path.stop_ns, 21) / NS_PER_S:
        front, lines = project_faces(world.faces, camera.K, camera.poses_between(flight, np.array([time_s]))[0])
        on_face = (np.einsum("fbi,pi->pfb", lines[:, 3:], pixels) >= 0).all(axis=-1)
        inverse_depth = np.where(on_face, pixels @ lines[:, 2].T, 0.0)
        nearest = np.where(on_face.any(axis=1), front[inverse_depth.argmax(axis=1)], -1)
        for tile, face in {*zip(tiles.tolist(), nearest.tolist(), strict=True)}:
            if face >= 0:
                shown += 1
                assert face in plan.faces[plan.face_starts[tile] : plan.face_starts[tile + 1]]
    assert shown > 1000


def test_a_still_camera_asks_for_one_sample() -> None:
    """Where nothing moves, the end of the path is enough."""
    scene = load_scene("hover").with_size(360, 270)
    world, camera = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera)
    (path,) = camera_paths(world, camera, Flight(FlightOptions(position_m=(0.0, 0.0, 1.7))), 0, 20_000_000)
    assert (plan_tiles(world.faces, path, camera.height, camera.width, BOUND_PX).samples == 1).all()


def test_a_fast_corner_does_not_set_the_cost_of_the_image() -> None:
    """In forward flight the densest tile is sampled twice as often as the mean one."""
    world, _, camera, path, _ = planned("racetrack")
    samples = plan_tiles(world.faces, path, camera.height, camera.width, 0.05).samples
    assert samples.max() > 2 * samples.mean()
