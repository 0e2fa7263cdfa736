"""What the sensors need of a world, exact or rasterised."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera

Floats = NDArray[np.float64]


class RenderedWorld(Protocol):
    """A world under its light, at one instant where anything moves.

    Radiance is linear DN (0..255 when nothing saturates), averaged over each pixel. Moving bodies are 1, 2, ...;
    body 0 is all that is at rest.
    """

    @property
    def moves(self) -> bool:
        """Whether any body moves."""
        ...

    def at(self, time_us: int) -> "RenderedWorld":
        """Return the world as it is at a time; itself where nothing moves."""
        ...

    def displacement_m(self, body: int, times_s: Floats) -> Floats:
        """Displacement (n, 3) of a body at ``times_s`` (n,), world; body 0 is at rest."""
        ...

    def visible_bodies(self, camera: Camera, T_world_camera: Floats) -> NDArray[np.int64]:
        """Body (height, width) that each pixel centre shows; 0 for bodies at rest and the sky."""
        ...

    def rgb_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Linear radiance (height, width, 3) of R, G, B, DN."""
        ...

    def luma_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Luma (height, width) of the linear radiance, DN."""
        ...

    def inverse_depth_per_m(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """1 / z-depth (height, width) along the optical axis at the pixel centres, 1/m; 0 where the sky is seen."""
        ...
