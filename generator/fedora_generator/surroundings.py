"""The surroundings of the flight, and the renderer that draws them."""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera
from fedora_generator.choices import Quality
from fedora_generator.errors import SceneError
from fedora_generator.mesh import places
from fedora_generator.mesh.from_world import FINEST_TEXEL_RAD, model_of_world
from fedora_generator.mesh.model import MeshDetail, MeshModel
from fedora_generator.mesh.world import MeshWorld
from fedora_generator.render import ExactWorld
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.scene import Scene
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.world import World

MESH_DETAIL: Final[dict[Quality, MeshDetail]] = {
    "draft": MeshDetail(colour_factor=1, event_factor=2),
    "standard": MeshDetail(colour_factor=2, event_factor=4),
    "reference": MeshDetail(colour_factor=4, event_factor=8),
}
"""Antialiasing by quality, where the scene does not set it (see mesh/README.md for what each leaves)."""

LEAST_DETAIL_BY_LAMPS: Final = MeshDetail(colour_factor=2, event_factor=4)
"""Where there is no sun: lit windows end in the dark, and the error of coarser steps at such an edge exceeds the
allowed difference of frames and events of one pixel (mesh/README.md)."""


class Surroundings(Protocol):
    """Solids that a camera must not enter."""

    @property
    def name(self) -> str:
        """Name, as files declare it."""

    def collision(
        self, positions_world_m: NDArray[np.float64], times_s: NDArray[np.float64] | None = None
    ) -> tuple[int, str] | None:
        """First of the points (n, 3), at its time (n,), that is inside or below something, and which; else None."""


def surroundings_of(scene: Scene, *, drawn: bool = True) -> World | MeshModel:
    """World of a scene, or its place, built from its seed; painted only where it will be ``drawn``."""
    if scene.world is not None:
        return scene.world
    if scene.place is None:
        raise SceneError(f"Expected a world or a place, got neither in {scene.name}")
    try:
        build = places.build_place if drawn else places.outline_place
        return build(scene.place.name, scene.place.seed)
    except ValueError as error:
        raise SceneError(f"{error}, at place of {scene.name}") from error


def render_surroundings(
    scene: Scene, surroundings: World | MeshModel, quality: Quality, path_world_m: NDArray[np.float64]
) -> RenderedWorld:
    """Prepare the surroundings of a scene, under its light, for the renderer of the scene.

    Parameters
    ----------
    scene
        Its light, renderer and mesh detail.
    surroundings
        As ``surroundings_of`` returns them.
    quality
        Antialiasing of meshes, where the scene does not set it.
    path_world_m
        (n, 3) positions of the camera, near which textures are fine.

    Raises
    ------
    GraphicsMissingError
        The scene is drawn by OpenGL, and there is none.
    """
    if isinstance(surroundings, World):
        if scene.renderer == "exact":
            return ExactWorld.of(surroundings, scene.light)
        pixel_rad = 1 / float(colour_camera(scene.camera).K[0, 0])
        texel_rad = max(FINEST_TEXEL_RAD, pixel_rad)
        surroundings = model_of_world(surroundings, path_world_m, texel_rad=texel_rad)
    return MeshWorld.of(surroundings, scene.light, scene.mesh or mesh_detail(scene.light, quality))


def mesh_detail(light: Light, quality: Quality) -> MeshDetail:
    """Antialiasing that a light needs, at a quality."""
    detail, least = MESH_DETAIL[quality], LEAST_DETAIL_BY_LAMPS
    if light.sun_strength > 0:
        return detail
    return MeshDetail(
        colour_factor=max(detail.colour_factor, least.colour_factor),
        event_factor=max(detail.event_factor, least.event_factor),
    )
