"""The exact world made ready to render: arrays once, then an image per camera pose."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.surfaces.faces import Faces, faces_of, moved, pixel_rays, project_faces
from fedora_generator.surfaces.light import WHITE_DN, Light, even_irradiance, lamps_over_faces
from fedora_generator.surfaces.render_kernels import (
    lens_scratch,
    render_bodies,
    render_centres_through_lens,
    render_inverse_depth,
    render_radiance,
    render_radiance_through_lens,
    tile_count,
    tile_scratch,
)
from fedora_generator.surfaces.shading_kernels import Surfaces, View
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.textures import texture_table
from fedora_generator.surfaces.world import Movement, World
from fedora_generator.threads import in_threads
from fedora_qa.conventions import LUMA_WEIGHTS_RGB, US_PER_S

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ExactWorld:
    """A world under a light at one instant, rendered in float64; where nothing moves, at any.

    Radiance is linear DN (0..255 when nothing saturates), the average over each pixel's own footprint, unrounded.
    The result does not depend on the number of threads.
    """

    faces: Faces
    textures: TextureTable
    coloured: Surfaces
    grey: Surfaces
    movements: tuple[Movement, ...]
    initial_faces: Faces
    """Faces of the world as it is described, before any body is displaced"""

    @classmethod
    def of(cls, world: World, light: Light) -> "ExactWorld":
        """Prepare a world for rendering, as it is at time 0."""
        faces = faces_of(world)
        prepared = cls(
            faces=faces,
            textures=texture_table(list(world.textures.values())),
            coloured=_surfaces(world, light, faces, np.eye(3)),
            grey=_surfaces(world, light, faces, np.array(LUMA_WEIGHTS_RGB)[:, None]),
            movements=tuple(mover.movement for mover in world.movers),
            initial_faces=faces,
        )
        return prepared.at(0)

    @property
    def moves(self) -> bool:
        """Whether any body moves."""
        return bool(self.movements)

    def at(self, time_us: int) -> "ExactWorld":
        """Return the world as it is at a time; itself where nothing moves."""
        if not self.moves:
            return self
        time_s = np.array([time_us / US_PER_S])
        displacements_m = [self.displacement_m(body, time_s)[0] for body in range(1 + len(self.movements))]
        return replace(self, faces=moved(self.initial_faces, np.array(displacements_m)))

    def displacement_m(self, body: int, times_s: Floats) -> Floats:
        """Displacement (n, 3) of a body at ``times_s`` (n,), world, from where it is described; body 0 is at rest."""
        return self.movements[body - 1].displacement_m(times_s) if body else np.zeros((len(times_s), 3))

    def rgb_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Linear radiance (height, width, 3) of R, G, B, DN."""
        return self._radiance_dn(self.coloured, camera, T_world_camera)

    def luma_dn(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """Luma (height, width) of the linear radiance, DN."""
        return self._radiance_dn(self.grey, camera, T_world_camera)[..., 0]

    def inverse_depth_per_m(self, camera: Camera, T_world_camera: Floats) -> Floats:
        """1 / z-depth (height, width) along the optical axis at the pixel centres, 1/m; 0 where the sky is seen."""
        if camera.lens is not None:
            return self._at_centres(camera, T_world_camera)[0]
        inverse_depth = np.empty((camera.height, camera.width))
        self._fill(render_inverse_depth, camera, T_world_camera, inverse_depth)
        return inverse_depth

    def visible_bodies(self, camera: Camera, T_world_camera: Floats) -> NDArray[np.int64]:
        """Body (height, width) that each pixel centre shows; 0 for bodies at rest and the sky."""
        if not self.moves:
            return np.zeros((camera.height, camera.width), dtype=np.int64)
        if camera.lens is not None:
            return self._at_centres(camera, T_world_camera)[1]
        bodies = np.empty((camera.height, camera.width), dtype=np.int64)
        self._fill(render_bodies, camera, T_world_camera, self.faces.bodies, bodies)
        return bodies

    def _radiance_dn(self, surfaces: Surfaces, camera: Camera, T_world_camera: Floats) -> Floats:
        radiance_dn = np.empty((camera.height, camera.width, surfaces.sky_dn.shape[1]))
        if camera.lens is None:
            self._fill(render_radiance, camera, T_world_camera, self.textures, surfaces, radiance_dn)
        else:
            stage = (self.textures, surfaces, camera.pixel_maps)
            self._fill(render_radiance_through_lens, camera, T_world_camera, *stage, radiance_dn)
        return radiance_dn

    def _at_centres(self, camera: Camera, T_world_camera: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Inverse depth, 1/m, and bodies (height, width) at the pixel centres of a distorted camera."""
        inverse_depth = np.empty((camera.height, camera.width))
        bodies = np.empty((camera.height, camera.width), dtype=np.int64)
        filled = (self.faces.bodies, inverse_depth, bodies)
        self._fill(render_centres_through_lens, camera, T_world_camera, camera.pixel_maps, *filled)
        return inverse_depth, bodies

    def _fill(self, kernel: Callable[..., None], camera: Camera, T_world_camera: Floats, *arguments: object) -> None:
        """Run a loop over the tiles of an image, ``kernel(view, scratch, *arguments, first_tile, stop_tile)``."""
        front, lines = project_faces(self.faces, camera.K, T_world_camera)
        view = View(front, lines, pixel_rays(camera.K, T_world_camera))
        scratch_for = tile_scratch if camera.lens is None else lens_scratch

        def fill(_: int, first_tile: int, stop_tile: int) -> None:
            scratch = scratch_for(len(front), self.textures.waves.shape[1])
            kernel(view, scratch, *arguments, first_tile, stop_tile)

        in_threads(fill, tile_count(camera.height, camera.width))


def _surfaces(world: World, light: Light, faces: Faces, channels: Floats) -> Surfaces:
    """Surfaces in the colour channels whose weights of R, G, B are the columns of ``channels`` (3, c)."""
    textures = list(world.textures.values())
    return Surfaces(
        wave_offsets_m=faces.wave_offsets_m,
        texture_of_face=faces.textures,
        dark_dn=WHITE_DN * np.array([texture.dark_rgb for texture in textures]) @ channels,
        light_dn=WHITE_DN * np.array([texture.light_rgb for texture in textures]) @ channels,
        even_irradiance=even_irradiance(light, faces),
        lamps=lamps_over_faces(light, world.lamps, faces),
        sky_dn=WHITE_DN * np.array([light.sky_horizon_rgb, light.sky_zenith_rgb]) @ channels,
    )
