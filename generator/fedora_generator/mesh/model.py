"""A world of triangles: meshes, lamps, solids, and options of precision and antialiasing."""

from dataclasses import dataclass
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.surfaces.world import Box, Lamp, departures

GROUND: Final = "ground"


@dataclass(frozen=True, slots=True, kw_only=True)
class TexturedMesh:
    """Triangles under one texture. Surfaces are Lambert's: their radiance does not depend on the direction of view.

    ``vertices_world_m`` (n, 3) and ``normals_world`` (n, 3, unit) are in the world frame (ENU); ``triangles`` (m, 3)
    index them, counter-clockwise from the front. ``uv`` (n, 2) are texture coordinates; (0, 0) is the outer corner of
    the first texel of the first row, (1, 1) that of the last texel of the last row. Beyond, the texture repeats if
    ``repeats``; otherwise its outermost texels continue.
    ``reflectance_rgb`` (h, w, 3), float32, linear, 0 to 1. ``emission_rgb`` is constant radiance, linear, added to the
    reflected light: 1 is white. A two-sided mesh is visible from behind too, with its normal reversed.
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
    """A world of triangles, all at rest.

    A camera must not enter ``solids``; it must stay over the solid with the name ``GROUND``, if there is one.
    """

    name: str
    meshes: tuple[TexturedMesh, ...]
    lamps: tuple[Lamp, ...] = ()
    solids: tuple[Box, ...] = ()

    def collision(
        self, positions_world_m: NDArray[np.float64], times_s: NDArray[np.float64] | None = None
    ) -> tuple[int, str] | None:
        """First point that is inside a solid or not over the ground.

        Parameters
        ----------
        positions_world_m
            (n, 3) points.
        times_s
            (n,) ignored, as nothing moves.

        Returns
        -------
        collision
            Index of the point, and what it collides with; None if all points are free.
        """
        hits = [
            (int(np.argmax(inside)), f"inside {solid.name!r}")
            for solid in self.solids
            if (inside := solid.contains(positions_world_m)).any()
        ]
        for ground in (solid for solid in self.solids if solid.name == GROUND):
            departed = departures(ground.heights_m(positions_world_m))
            hits += [(index, departure) for index, departure in departed if index is not None]
        return min(hits, default=None)


Precision = Literal["float", "8bit"]

GAMMA: Final = 2.2
"""Exponent of the 8-bit encoding, the same as in pyrender's own shader."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshDetail:
    """Precision and antialiasing of a mesh world.

    Attributes
    ----------
    precision
        ``float``: radiance in float32 from the shader to the file. ``8bit``: encoded with a gamma of 1/2.2 and rounded
        to 8 bits, as pyrender's own framebuffer has it, then decoded: steps of 1.5 DN at 128 DN and 0.4 DN at 10 DN.
    colour_factor, event_factor
        Fragments along each side of a pixel of the colour and of the event camera. An event pixel is 2.25 colour
        pixels wide, so that about twice as many give both the same texture.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    precision: Precision = "float"
    colour_factor: int = 2
    event_factor: int = 4

    def __post_init__(self) -> None:
        if self.precision not in ("float", "8bit"):
            raise ValueError(f"Expected precision to be 'float' or '8bit', got {self.precision!r}")
        for name in ("colour_factor", "event_factor"):
            if not 1 <= getattr(self, name) <= 16:
                raise ValueError(f"Expected {name} from 1 to 16, got {getattr(self, name)}")
