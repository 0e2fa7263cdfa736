"""What the sensors ask of a world, whoever renders it."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera

Floats = NDArray[np.float64]


class RenderedWorld(Protocol):
    """A world under its light. Radiance is linear DN (0..255 when nothing saturates), averaged over each pixel."""

    def rgb_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Linear radiance (height, width, 3) of R, G, B, DN."""
        ...

    def luma_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Luma (height, width) of the linear radiance, DN."""
        ...

    def inverse_depth_per_m(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """1 / z-depth (height, width) along the optical axis at the pixel centres, 1/m; 0 where the sky is seen."""
        ...
