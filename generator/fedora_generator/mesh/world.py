"""The mesh world: textured triangles under a light, rendered through OpenGL."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.mesh.model import MeshDetail, MeshModel
from fedora_generator.surfaces.light import WHITE_DN, Light
from fedora_qa.conventions import LUMA_WEIGHTS_RGB

if TYPE_CHECKING:
    from fedora_generator.mesh.rasteriser import Rasteriser

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MeshWorld:
    """A model under a light, rendered in float32.

    Radiance is linear DN (0..255 when nothing saturates), the average over each pixel's own footprint, unrounded.
    The same model, light and detail give the same bits on the same machine, on any number of threads.
    """

    rasteriser: "Rasteriser"
    detail: MeshDetail

    @classmethod
    def of(cls, model: MeshModel, light: Light, detail: MeshDetail | None = None) -> "MeshWorld":
        """Prepare a model for rendering.

        Parameters
        ----------
        model
            Meshes and lamps.
        light
            Sun, sky and the strength of the lamps.
        detail
            Precision and antialiasing; the default is ``MeshDetail()``.

        Raises
        ------
        GraphicsMissingError
            This machine has no OpenGL.
        """
        from fedora_generator.mesh.context import open_context  # noqa: PLC0415

        open_context()  # before anything imports OpenGL
        from fedora_generator.mesh.rasteriser import Rasteriser  # noqa: PLC0415

        detail = detail or MeshDetail()
        return cls(Rasteriser(model, light, detail), detail)

    @property
    def moves(self) -> bool:
        """Whether anything moves: no."""
        return False

    def at(self, time_us: int) -> "MeshWorld":
        """Return itself, at any time."""
        return self

    def displacement_m(self, body: int, times_s: Floats) -> Floats:
        """Displacement (n, 3): none."""
        return np.zeros((len(times_s), 3))

    def visible_bodies(self, camera: Camera, T_world_camera: Floats) -> NDArray[np.int64]:
        """Body (height, width) that each pixel shows: 0, as everything is at rest."""
        return np.zeros((camera.height, camera.width), dtype=np.int64)

    def rgb_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Linear radiance (height, width, 3) of R, G, B, DN."""
        return WHITE_DN * self.rasteriser.radiance(camera, T_world_camera, self.detail.colour_factor)

    def luma_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Luma (height, width) of the linear radiance, DN."""
        radiance_dn = WHITE_DN * self.rasteriser.radiance(camera, T_world_camera, self.detail.event_factor)
        return np.asarray(radiance_dn @ np.array(LUMA_WEIGHTS_RGB))

    def inverse_depth_per_m(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """1 / z-depth (height, width) along the optical axis at the pixel centres, 1/m; 0 for the sky."""
        return self.rasteriser.inverse_depth_per_m(camera, T_world_camera)
