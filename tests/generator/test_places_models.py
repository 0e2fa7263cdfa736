"""The places as wholes: well-formed, the same for the same seed, free where they are flown through, and visible."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera
from fedora_generator.flight import Flight
from fedora_generator.mesh import places
from fedora_generator.mesh.model import MeshModel
from fedora_generator.mesh.places import PLACES, outline_place
from fedora_generator.mesh.places.furniture import GATE_CENTER_M
from fedora_generator.mesh.world import MeshWorld
from fedora_generator.scene import Scene, load_scene
from fedora_qa.conventions import LUMA_WEIGHTS_RGB

MOST_TRIANGLES = 300_000
MOST_TEXELS = 100_000_000 // (3 * 2)
"""Of all textures together, so that they take 100 MB as half floats."""

NEAREST_LAYERS_M = 0.004
SCENES = ("park-mesh-day", "park-mesh-night", "racetrack-mesh-day", "racetrack-mesh-night")


@pytest.fixture(params=["park-mesh-day", "racetrack-mesh-day"])
def place(request: pytest.FixtureRequest) -> MeshModel:
    """Each of the places, as its scenes have it."""
    return place_of(load_scene(request.param))


def place_of(scene: Scene) -> MeshModel:
    """The place of a scene."""
    assert scene.place is not None
    return places.build_place(scene.place.name, scene.place.seed)


def test_meshes_are_well_formed(place: MeshModel) -> None:
    """Unit normals on the side that the winding names as front, finite texture coordinates, no empty triangle."""
    for mesh in place.meshes:
        corners = mesh.vertices_world_m[mesh.triangles]
        wound = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing = np.einsum("ni,nki->nk", wound, mesh.normals_world[mesh.triangles])
        assert np.allclose(np.linalg.norm(mesh.normals_world, axis=-1), 1, atol=1e-9), mesh.name
        assert np.linalg.norm(wound, axis=-1).min() > 0, mesh.name
        assert (facing > 0).mean() > 0.999, mesh.name
        assert np.isfinite(mesh.uv).all(), mesh.name
        assert mesh.reflectance_rgb.dtype == np.float32


def test_places_are_within_their_means(place: MeshModel) -> None:
    """A software rasteriser draws them, and their textures fit into memory."""
    assert 50_000 < sum(len(mesh.triangles) for mesh in place.meshes) < MOST_TRIANGLES
    assert sum(mesh.reflectance_rgb.size // 3 for mesh in place.meshes) < MOST_TEXELS


def test_textures_repeat_without_a_seam(place: MeshModel) -> None:
    """The step over an edge is no larger than the largest between two rows or columns within.

    Nothing is black, nothing is whiter than white, and nothing is without texture.
    """
    for mesh in place.meshes:
        picture = mesh.reflectance_rgb
        assert 0 < picture.min() <= picture.max() < 1, mesh.name
        assert picture[::3, ::3].std(axis=(0, 1)).max() > 0.02, mesh.name
        for turned in (picture, picture.swapaxes(0, 1)):
            steps = np.array([np.abs(row - below).mean() for row, below in pairwise([*turned, turned[0]])])
            assert steps[-1] <= 1.1 * steps[:-1].max(), mesh.name


def test_no_two_surfaces_share_a_plane(place: MeshModel) -> None:
    """Where two triangles that face the same way overlap, they are at least 4 mm apart: depth decides, not rounding."""
    corners = np.concatenate([mesh.vertices_world_m[mesh.triangles] for mesh in place.meshes])
    seen = corners[corners[..., 2].max(axis=-1) > 0]
    pairs = np.concatenate([overlapping(seen, shift) for shift in (0.0, 0.5)])
    assert seen[pairs].mean(axis=2).round(2).tolist() == []


def overlapping(corners: NDArray[np.float64], shift: float) -> NDArray[np.int64]:
    """Pairs (k, 2) of triangles of one plane that overlap.

    Planes are put into cells of normal and offset (``shift`` moves their borders); in each, triangles are swept along
    x, and two are apart if an edge of either divides them.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    offsets = np.einsum("ni,ni->n", normals, corners.mean(axis=1)) / NEAREST_LAYERS_M
    cells = np.column_stack([np.round(normals * 300), np.floor(offsets + shift)]).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    shrunk = corners.mean(axis=1, keepdims=True) + 0.98 * (corners - corners.mean(axis=1, keepdims=True))
    low, high = shrunk.min(axis=1) - 1e-3, shrunk.max(axis=1) + 1e-3
    order = np.lexsort((low[:, 0], cell.ravel()))
    cell, low, high = cell.ravel()[order], low[order], high[order]
    found, active = [np.empty((0, 2), dtype=np.int64)], np.arange(len(order) - 1)
    lag = 1
    while len(active):
        active = active[active + lag < len(order)]
        other = active + lag
        near = (cell[other] == cell[active]) & (low[other, 0] < high[active, 0])
        active, other = active[near], other[near]
        boxes = ((low[other] < high[active]) & (low[active] < high[other])).all(axis=-1)
        found.append(np.stack([order[active[boxes]], order[other[boxes]]], axis=-1))
        lag += 1
    pairs = np.concatenate(found)
    first, second = shrunk[pairs[:, 0]], shrunk[pairs[:, 1]]
    return pairs[~divided(first, second, normals[pairs[:, 0]])]


def divided(first: NDArray[np.float64], second: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether an edge of either of two coplanar triangles has the other wholly outside."""
    apart = np.zeros(len(first), dtype=bool)
    for inner in (first, second):
        for corner in range(3):
            axis = np.cross(inner[:, (corner + 1) % 3] - inner[:, corner], normals)
            along = [np.einsum("nki,ni->nk", triangle, axis) for triangle in (first, second)]
            apart |= (along[0].max(axis=1) <= along[1].min(axis=1)) | (along[1].max(axis=1) <= along[0].min(axis=1))
    return apart


def test_the_search_for_shared_planes_finds_them() -> None:
    """Two overlapping triangles 1 mm apart are found; beside each other, 1 cm apart, or back to back they are not."""
    one = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=np.float64)
    others = {
        "above": one + np.array([0.1, 0.1, 0.001]),
        "beside": one + np.array([1, 0, 0]),
        "apart": one + np.array([0, 0, 0.01]),
        "back": one[::-1],
    }
    found = {name: len(overlapping(np.stack([one, other]), 0.25)) for name, other in others.items()}
    assert found == {"above": 1, "beside": 0, "apart": 0, "back": 0}


def test_the_seed_decides(place: MeshModel) -> None:
    """The same seed gives the same bits; another one other trees in the same place."""
    build = PLACES[place.name].build
    once, again, other = (build(np.random.default_rng(seed)) for seed in (8, 8, 9))
    points = [np.concatenate([surface.vertices_m for _, surface in group.surfaces]) for group in (once, again, other)]
    assert np.array_equal(points[0], points[1])
    assert points[0].shape == points[2].shape
    assert not np.array_equal(points[0], points[2])
    assert once.solids[0] == other.solids[0]


def test_only_what_exists_is_built() -> None:
    """Another name is refused with those that there are, and so is a negative seed."""
    with pytest.raises(ValueError, match="Expected one of the places park, racetrack, got 'moon'"):
        places.build_place("moon", 0)
    with pytest.raises(ValueError, match="Expected seed >= 0, got -1"):
        places.build_place("park", -1)


@pytest.mark.parametrize("name", SCENES)
def test_lamps_shine_by_night_only(name: str) -> None:
    """The night scenes fly the same way in the same place, under its lamps."""
    scene, day = load_scene(name), load_scene(name.replace("night", "day"))
    assert scene.place == day.place
    assert scene.flight == day.flight
    assert (scene.light.lamp_scale > 0) == name.endswith("night")


@pytest.mark.parametrize("name", SCENES)
def test_flights_are_free_for_20_seconds(name: str) -> None:
    """The camera never enters a solid, looked at every millisecond, and comes no nearer to the ground than a metre."""
    scene = load_scene(name)
    poses = colour_camera(scene.camera).poses_at(Flight(scene.flight), np.arange(0, 20_000_001, 1000))
    assert place_of(scene).collision(poses[:, :3, 3]) is None
    assert poses[:, 2, 3].min() > 1.0


def test_gates_are_open_and_solid(place: MeshModel) -> None:
    """A camera may pass the middle of the first gate, and not its beam; nor a tree of the park, nor the ground."""
    if place.name == "racetrack":
        free, beam = np.array([[7.5, 0.0, GATE_CENTER_M]]), np.array([[7.5, 0.0, GATE_CENTER_M + 1.35]])
    else:
        free, beam = np.array([[6.0, 0.0, 1.7]]), np.array([[6.0, 5.4, 1.7]])
    assert place.collision(free) is None
    assert place.collision(beam) is not None
    assert place.collision(np.array([[0.0, 0.0, -0.1]])) == (0, "inside 'ground'")


@pytest.mark.parametrize("name", ["park-mesh-day", "racetrack-mesh-day"])
def test_the_outline_is_where_a_camera_can_be(name: str) -> None:
    """The solids of the whole place and nothing to draw; it ends where the ground does, and far above it."""
    scene = load_scene(name)
    assert scene.place is not None
    outline = outline_place(scene.place.name, scene.place.seed)
    assert outline.solids == place_of(scene).solids
    assert outline.meshes == ()
    middle, near_rim, beyond, above = ([0, 0, 200], [0, 690, 200], [710, 0, 200], [0, 0, 1100])
    assert outline.collision(np.array([middle, near_rim])) is None
    assert outline.collision(np.array([middle, beyond])) == (1, "beyond the rim of the ground")
    assert outline.collision(np.array([above])) == (0, "more than 1000 m above the ground")


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("name", SCENES)
def test_scenes_are_neither_dark_nor_blank(name: str) -> None:
    """By day the mean radiance is mid-range, by night dim but nowhere black; most of the view has a valid depth."""
    scene = load_scene(name).with_size(160, 120)
    world = MeshWorld.of(place_of(scene), scene.light)
    camera = colour_camera(scene.camera)
    T_world_camera = camera.poses_at(Flight(scene.flight), np.array([1_000_000]))[0]
    luma_dn = world.rgb_dn(camera, T_world_camera) @ np.array(LUMA_WEIGHTS_RGB)
    inverse_depth = world.inverse_depth_per_m(camera, T_world_camera)
    dim, mid = (3, 20) if name.endswith("night") else (20, 60)
    assert mid < luma_dn.mean() < (60 if name.endswith("night") else 120)
    assert np.quantile(luma_dn, 0.02) > dim / 2
    assert np.log(luma_dn).std() > 0.3
    assert (inverse_depth > 1 / 30).mean() > 0.6
    assert inverse_depth.max() < 1 / 0.5
