"""Which meshes may be in a camera's view; the others are not drawn."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.mesh.model import TexturedMesh

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BoundingSpheres:
    """Spheres that enclose n meshes: centres (n, 3) in the world and radii (n,), metres."""

    centers_world_m: Floats
    radii_m: Floats

    @classmethod
    def of(cls, meshes: tuple[TexturedMesh, ...]) -> "BoundingSpheres":
        """Spheres around the middle of each mesh's extent."""
        extents = [(mesh.vertices_world_m.min(axis=0), mesh.vertices_world_m.max(axis=0)) for mesh in meshes]
        centers_m = np.array([0.5 * (low + high) for low, high in extents]).reshape(-1, 3)
        farthest_m = [
            np.linalg.norm(mesh.vertices_world_m - center_m, axis=1).max()
            for mesh, center_m in zip(meshes, centers_m, strict=True)
        ]
        return cls(centers_m, np.array(farthest_m))

    def may_be_visible(self, camera: Camera, T_world_camera: Floats) -> NDArray[np.bool_]:
        """Whether any point of each sphere may lie in the image.

        Parameters
        ----------
        camera
            Camera matrix and size of the image.
        T_world_camera
            (4, 4) pose of the camera.

        Returns
        -------
        visible
            (n,) never false for a sphere that has a point in the image.
        """
        # Inward unit normals (5, 3), optical frame, of the planes through the centre and the borders, and of z = 0.
        K = camera.K
        left, top = (-0.5 - K[0, 2]) / K[0, 0], (-0.5 - K[1, 2]) / K[1, 1]
        right, bottom = (camera.width - 0.5 - K[0, 2]) / K[0, 0], (camera.height - 0.5 - K[1, 2]) / K[1, 1]
        normals = np.array([[1, 0, -left], [-1, 0, right], [0, 1, -top], [0, -1, bottom], [0, 0, 1]])
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        centers_camera_m = (self.centers_world_m - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
        heights_m = centers_camera_m @ normals.T
        return np.asarray((heights_m >= -self.radii_m[:, None]).all(axis=1))
