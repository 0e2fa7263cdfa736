"""What a world of triangles consists of, before anything is drawn."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.world import Box, Lamp, departures

GROUND: Final = "ground"


@dataclass(frozen=True, slots=True, kw_only=True)
class TexturedMesh:
    """Triangles under one texture. Surfaces are Lambert's: their radiance does not depend on where they are seen from.

    ``vertices_world_m`` (n, 3) and ``normals_world`` (n, 3, unit) are in the world frame (ENU); ``triangles`` (m, 3)
    index them, counter-clockwise as seen from the front. ``uv`` (n, 2) are texture coordinates; (0, 0) is the outer
    corner of the first texel of the first row, (1, 1) that of the last of the last. Beyond, the texture repeats, or
    its outermost texels go on.
    ``reflectance_rgb`` (h, w, 3), float32, linear, 0 to 1. ``emission_rgb`` is radiance of its own, linear, added
    everywhere the same: 1 is white. A two-sided mesh is seen from behind too, with its normal turned around.
    """

    name: str
    vertices_world_m: NDArray[np.float64]
    normals_world: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float64]
    reflectance_rgb: NDArray[np.float32]
    emission_rgb: tuple[float, float, float] = (0.0, 0.0, 0.0)
    two_sided: bool = False
    repeats: bool = True

    def __post_init__(self) -> None:
        vertices = len(self.vertices_world_m)
        if self.normals_world.shape != (vertices, 3) or self.uv.shape != (vertices, 2):
            raise ValueError(
                f"Expected a normal and texture coordinates for each of {vertices} vertices of {self.name!r}"
            )
        if self.triangles.size == 0 or self.triangles.min() < 0 or self.triangles.max() >= vertices:
            raise ValueError(f"Expected triangles that index {vertices} vertices of {self.name!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshModel:
    """Everything that stands in a world of triangles.

    ``solids`` are what a camera must not enter; it must stay over the one that is called ``GROUND``, if there is one.
    """

    name: str
    meshes: tuple[TexturedMesh, ...]
    lamps: tuple[Lamp, ...] = ()
    solids: tuple[Box, ...] = ()

    def collision(
        self, positions_world_m: NDArray[np.float64], times_s: NDArray[np.float64] | None = None
    ) -> tuple[int, str] | None:
        """First of the points (n, 3) that is inside a solid or not over the ground, and which; None if none is.

        Nothing moves with time.
        """
        hits = [
            (int(np.argmax(inside)), f"inside {solid.name!r}")
            for solid in self.solids
            if (inside := solid.contains(positions_world_m)).any()
        ]
        for ground in (solid for solid in self.solids if solid.name == GROUND):
            departed = departures(ground.heights_m(positions_world_m))
            hits += [(index, what) for index, what in departed if index is not None]
        return min(hits, default=None)
