"""Meshes, a light and cameras that the tests of the mesh world share."""

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera, CameraOptions, colour_camera
from fedora_generator.mesh.model import MeshModel, TexturedMesh
from fedora_generator.surfaces.light import Light

Floats = NDArray[np.float64]

AMBIENT = Light(name="ambient", ambient=1.0, sky_horizon_rgb=(0.2, 0.3, 0.4), sky_zenith_rgb=(0.5, 0.6, 0.7))

LOOKING_EAST = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Pose of a camera at the origin whose optical axis is X; its right is -Y, its down is -Z."""


def camera(width: int = 36, height: int = 27) -> Camera:
    return colour_camera(CameraOptions(width=width, height=height))


def grey(value: float = 0.5) -> NDArray[np.float32]:
    return np.full((1, 1, 3), value, dtype=np.float32)


def wall(
    reflectance_rgb: NDArray[np.float32],
    *,
    x_m: float = 4.0,
    half_m: float = 20.0,
    right_of_y_m: float | None = None,
    **options: object,
) -> TexturedMesh:
    """A wall that faces the camera; u goes right, v goes down, from 0 to 1. ``right_of_y_m`` cuts off its left."""
    left = half_m if right_of_y_m is None else right_of_y_m
    corners = [[x_m, left, half_m], [x_m, left, -half_m], [x_m, -half_m, -half_m], [x_m, -half_m, half_m]]
    return TexturedMesh(
        name="wall",
        vertices_world_m=np.array(corners, dtype=np.float64),
        normals_world=np.tile([-1.0, 0.0, 0.0], (4, 1)),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        uv=np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]),
        reflectance_rgb=reflectance_rgb,
        **options,  # type: ignore[arg-type]
    )


def model(*meshes: TexturedMesh, **options: object) -> MeshModel:
    return MeshModel(name="case", meshes=meshes, **options)  # type: ignore[arg-type]
