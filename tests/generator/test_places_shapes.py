"""Shapes of places: closed where they say so, fronts outside, texture the right way up."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from fedora_generator.mesh.places.shapes import (
    boulder,
    box,
    cylinder,
    gridded_box,
    leaves,
    plate,
    prism,
    roughened,
    tube,
    turned,
)
from fedora_generator.mesh.places.surface import Surface, joined, moved, quads

HEXAGON = [(math.cos(a), math.sin(a)) for a in np.arange(6) * math.pi / 3]


def solid_of(surface: Surface) -> trimesh.Trimesh:
    """The surface as the oracle sees it, equal points made one."""
    mesh = trimesh.Trimesh(surface.vertices_m.round(9), surface.triangles, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh


def least_agreement(surface: Surface) -> float:
    """Least cosine between a triangle's winding and the normals at its corners."""
    corners = surface.vertices_m[surface.triangles]
    wound = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    wound /= np.linalg.norm(wound, axis=-1, keepdims=True)
    return float(np.einsum("ni,nki->nk", wound, surface.normals[surface.triangles]).min())


CLOSED: dict[str, tuple[Callable[[], Surface], float]] = {
    "box": (lambda: box((1.0, 2.0, 3.0), (5.0, 6.0, 7.0)), 6.0),
    "prism": (lambda: prism(HEXAGON, 2.0), 2.0 * 1.5 * math.sqrt(3)),
    "cylinder of 6 sides": (lambda: cylinder(1.0, 2.0, sides=6), 2.0 * 1.5 * math.sqrt(3)),
    "cone": (lambda: turned([(0, 0), (1, 0), (0, 3)], sides=200), math.pi),
    "ring": (lambda: turned([(1, 0), (2, 0), (2, 1), (1, 1), (1, 0)], sides=200), 3 * math.pi),
    "ball": (lambda: boulder((1.0, 2.0, 0.5), np.random.default_rng(1), 0.0, cells=24), 4 / 3 * math.pi),
    "gridded box": (lambda: gridded_box((1.0, 2.0, 3.0), 0.3), 6.0),
}


@pytest.mark.parametrize(("make", "volume_m3"), CLOSED.values(), ids=list(CLOSED))
def test_solids_are_closed_and_face_outwards(make: Callable[[], Surface], volume_m3: float) -> None:
    """Every edge has two triangles, and the volume enclosed has the right size and sign."""
    mesh = solid_of(make())
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume_m3, rel=0.006)


@pytest.mark.parametrize("roughness", [0.1, 0.35])
def test_rough_solids_stay_closed(roughness: float) -> None:
    """Boulders and roughened boxes have no gap at the edges of their faces, and face outwards."""
    rng = np.random.default_rng(7)
    for surface in (boulder((1, 1, 1), rng, roughness), roughened(gridded_box((2, 1, 1), 0.2), 0.04, 0.5, rng)):
        mesh = solid_of(surface)
        assert mesh.is_watertight
        assert mesh.volume > 0


def test_normals_of_a_boulder_are_its_own() -> None:
    """The closed form agrees with the triangles of a fine mesh."""
    surface = boulder((1.0, 1.4, 0.8), np.random.default_rng(3), 0.3, cells=100)
    corners = surface.vertices_m[surface.triangles]
    centers = surface.normals[surface.triangles].mean(axis=1)
    wound = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosines = np.einsum("ni,ni->n", wound, centers) / np.linalg.norm(wound, axis=1) / np.linalg.norm(centers, axis=1)
    assert np.quantile(cosines, 0.01) > math.cos(math.radians(2.5))


def test_winding_agrees_with_normals() -> None:
    """On every kind of shape the front is where the normals point."""
    rng = np.random.default_rng(5)
    points = rng.normal(size=(50, 3))
    facing = points / np.linalg.norm(points, axis=-1, keepdims=True)
    shapes = {
        **{name: make() for name, (make, _) in CLOSED.items()},
        "tube": tube([(0, 0, 0), (0, 0.2, 1), (0.3, 0.4, 2)], [0.3, 0.25, 0.2]),
        "plate": plate((0, 1), (0, 1)),
        "leaves": leaves(points, facing, 0.2, 0.1, rng),
    }
    assert {name: least_agreement(shape) > 0.3 for name, shape in shapes.items()} == dict.fromkeys(shapes, True)


def test_upright_faces_have_their_picture_upright() -> None:
    """On each side of a box u grows to the right and v downwards, from 0 at the upper left corner."""
    surface = box((2.0, 2.0, 3.0))
    for face in range(4):
        here = slice(4 * face, 4 * face + 4)
        points, uv = surface.vertices_m[here], surface.uv_m[here]
        right = np.cross([0, 0, 1], surface.normals[here][0])
        assert np.allclose(uv[:, 0], points @ right + 1.0)
        assert np.allclose(uv[:, 1], 1.5 - points[:, 2])


@given(
    yaw_deg=st.floats(-360, 360),
    shift_m=st.tuples(*[st.floats(-100, 100)] * 3),
    size_m=st.tuples(*[st.floats(0.01, 50)] * 3),
)
def test_moving_changes_no_shape(
    yaw_deg: float, shift_m: tuple[float, float, float], size_m: tuple[float, float, float]
) -> None:
    """Lengths of edges, textures and the sense of winding survive; the lowest point only shifts."""
    before = box(size_m)
    after = moved(before, shift_m, yaw_deg)
    edges = [np.diff(surface.vertices_m[surface.triangles], axis=1) for surface in (before, after)]
    lengths = [np.linalg.norm(edge, axis=-1) for edge in edges]
    assert np.allclose(*lengths, atol=1e-9)
    assert np.array_equal(before.uv_m, after.uv_m)
    assert least_agreement(after) > 0.999
    assert after.vertices_m[:, 2].min() == pytest.approx(before.vertices_m[:, 2].min() + shift_m[2], abs=1e-9)


def test_joining_keeps_every_triangle() -> None:
    """The corners of the parts, one after the other, are those of the whole."""
    parts = [box((1, 1, 1)), cylinder(1, 2), quads([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]])]
    corners = [part.vertices_m[part.triangles] for part in parts]
    whole = joined(parts)
    assert np.array_equal(whole.vertices_m[whole.triangles], np.concatenate(corners))
