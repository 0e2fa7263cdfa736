"""Tiles are sampled as their own motion asks for, and know every face that they may show."""

from itertools import pairwise

import numpy as np
import pytest

from fedora_generator.adaptive.camera_path import CameraPath, TilePlan, camera_paths, plan_tiles
from fedora_generator.camera import Camera, event_camera
from fedora_generator.flight import Flight, FlightOptions
from fedora_generator.flow import flow_px
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene
from fedora_generator.surfaces.faces import project_faces
from fedora_generator.surfaces.render_kernels import TILE
from fedora_qa.conventions import NS_PER_S

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
