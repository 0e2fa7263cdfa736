"""Meshes that are not drawn because the camera cannot see them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.mesh.rasteriser import BoundingSpheres
from tests.generator.mesh_cases import LOOKING_EAST, camera, grey, wall


@given(st.floats(-0.49, 36 - 0.51), st.floats(-0.49, 27 - 0.51), st.floats(0.05, 500.0), st.integers(0, 2**32 - 1))
def test_a_sphere_with_a_visible_point_is_never_left_out(column: float, row: float, z_m: float, seed: int) -> None:
    """Whatever point of the image a sphere reaches, from whatever pose, it may be seen."""
    rng, lens = np.random.default_rng(seed), camera()
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T_world_camera[:3, 3] = rng.normal(size=3) * 30
    visible_m = T_world_camera @ np.append(z_m * np.linalg.inv(lens.K) @ [column, row, 1.0], 1.0)
    away_m = rng.normal(size=3) * z_m
    spheres = BoundingSpheres((visible_m[:3] + away_m)[None], np.array([np.linalg.norm(away_m) * 1.000001]))
    assert spheres.may_be_visible(lens, T_world_camera)[0]


def test_what_lies_behind_or_beside_is_left_out() -> None:
    """A small sphere behind, and one far to the side, are not drawn; the wall ahead is."""
    centers_m = np.array([[-5.0, 0.0, 0.0], [5.0, 20.0, 0.0], [5.0, 0.0, 20.0], [5.0, 0.0, 0.0]])
    seen = BoundingSpheres(centers_m, np.ones(4)).may_be_visible(camera(), LOOKING_EAST)
    assert seen.tolist() == [False, False, False, True]


def test_a_sphere_encloses_its_mesh() -> None:
    """Every vertex lies within the radius."""
    mesh = wall(grey(), half_m=3.0)
    spheres = BoundingSpheres.of((mesh,))
    distances_m = np.linalg.norm(mesh.vertices_world_m - spheres.centers_world_m[0], axis=1)
    assert distances_m.max() <= spheres.radii_m[0] * (1 + 1e-12)
