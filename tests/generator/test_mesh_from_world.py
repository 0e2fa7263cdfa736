"""Triangles made from rectangles and boxes, before anything is drawn."""

import numpy as np
import pytest

from fedora_generator.mesh.from_world import CELL_TEXELS, MARGIN_TEXELS, model_of_world
from fedora_generator.mesh.model import TexturedMesh
from fedora_generator.surfaces.textures import StepPattern, Texture, WaveBand
from fedora_generator.surfaces.world import Box, Lamp, Rectangle, World

PATH_M = np.array([[0.0, 0.0, 1.5], [1.0, 0.0, 1.5]])
WORLD = World(
    name="yard",
    textures={
        "waves": Texture(
            dark_rgb=(0.1, 0.2, 0.3),
            light_rgb=(0.5, 0.7, 0.9),
            waves=(WaveBand(longest_m=3.0, shortest_m=0.4, count=4, seed=1),),
        ),
        "stripes": Texture(
            dark_rgb=(0.1, 0.1, 0.1),
            light_rgb=(0.9, 0.9, 0.9),
            steps=(StepPattern(kind="stripes", period_m=(0.7, 0.7), duty=(0.25, 0.5)),),
        ),
    },
    rectangles=(Rectangle(name="floor", center_m=(3.0, 0.0, 0.0), size_m=(200.0, 100.0), texture="waves"),),
    boxes=(Box(name="crate", center_m=(5.0, 1.0, 0.5), size_m=(1.4, 0.8, 1.0), yaw_deg=30.0, texture="stripes"),),
    lamps=(Lamp(position_m=(0.0, 0.0, 4.0)),),
)


def areas_m2(mesh: TexturedMesh) -> float:
    a, b, c = (mesh.vertices_world_m[mesh.triangles[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def meshes_of(face: int) -> list[TexturedMesh]:
    return [mesh for mesh in model_of_world(WORLD, PATH_M, texel_rad=0.02).meshes if mesh.name == f"face {face}"]


@pytest.mark.parametrize(("face", "area_m2"), [(0, 20_000.0), (1, 0.8), (3, 1.4), (5, 1.12)])
def test_the_cells_of_a_face_cover_it(face: int, area_m2: float) -> None:
    """Cells neither overlap nor leave a gap: their areas sum to the face's."""
    assert sum(areas_m2(mesh) for mesh in meshes_of(face)) == pytest.approx(area_m2, rel=1e-12)


def test_triangles_turn_their_front_to_their_normal() -> None:
    """Counter-clockwise as seen from the front, which points out of the box."""
    for mesh in model_of_world(WORLD, PATH_M, texel_rad=0.1).meshes:
        a, b, c = (mesh.vertices_world_m[mesh.triangles[:, i]] for i in range(3))
        assert ((np.cross(b - a, c - a) * mesh.normals_world[0]).sum(axis=1) > 0).all()
        if mesh.name != "face 0":
            outward_m = mesh.vertices_world_m.mean(axis=0) - np.array(WORLD.boxes[0].center_m)
            assert outward_m @ mesh.normals_world[0] > 0


def test_cells_are_finer_near_the_path() -> None:
    """The cell under the path has the smallest texels; none has more texels along a side than it may."""
    cells = meshes_of(0)
    distances_m = [np.linalg.norm(cell.vertices_world_m.mean(axis=0) - PATH_M[0]) for cell in cells]
    texels_m = [np.sqrt(areas_m2(cell) / cell.reflectance_rgb[..., 0].size) for cell in cells]
    assert texels_m[int(np.argmin(distances_m))] < 0.1 * texels_m[int(np.argmax(distances_m))]
    assert max(max(cell.reflectance_rgb.shape[:2]) for cell in cells) <= CELL_TEXELS + 2 * MARGIN_TEXELS + 16


def test_a_texel_is_the_mean_of_the_texture_over_it() -> None:
    """Against a numerical mean of the stripes, which are light for a quarter of 0.7 m from the face's centre on."""
    face = meshes_of(5)[0]  # the top of the crate, u along its own x
    image = face.reflectance_rgb
    columns = image.shape[1]
    texel_m = 1.4 / (columns - 2 * MARGIN_TEXELS)
    u_m = -0.7 + (np.arange(columns)[:, None] - MARGIN_TEXELS + np.linspace(0, 1, 2001)) * texel_m
    light = (np.mod(u_m / 0.7, 1.0) < 0.25).mean(axis=1)
    np.testing.assert_allclose(image[image.shape[0] // 2, :, 0], 0.1 + 0.8 * light, atol=5e-3)


def test_neighbouring_cells_continue_each_other() -> None:
    """The margin of a cell shows what lies beyond its border: it is the same surface, sampled on."""
    cell = max(meshes_of(0), key=areas_m2)
    uv = cell.uv * np.array(cell.reflectance_rgb.shape[1::-1])
    assert uv.min() == pytest.approx(MARGIN_TEXELS)
    assert not cell.repeats
    assert np.isfinite(cell.reflectance_rgb).all()


def test_lamps_and_solids_come_along() -> None:
    """Light and collisions are those of the world."""
    model = model_of_world(WORLD, PATH_M, texel_rad=0.1)
    assert model.lamps == WORLD.lamps
    inside = np.array([[0.0, 0.0, 1.5], [5.0, 1.0, 0.5]])
    assert model.collision(inside) == (1, "inside 'crate'")
    assert model.collision(inside[:1]) is None
