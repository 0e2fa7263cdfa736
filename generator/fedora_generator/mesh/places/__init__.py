"""Places of the mesh world, built in code: a park and a racetrack."""

import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_generator.mesh.model import MeshModel, TexturedMesh
from fedora_generator.mesh.places.group import Group
from fedora_generator.mesh.places.materials import MATERIALS, Material
from fedora_generator.mesh.places.park import PARK_MATERIALS, park
from fedora_generator.mesh.places.racetrack import RACETRACK_MATERIALS, racetrack
from fedora_generator.mesh.places.surface import Surface, joined

Builder = Callable[[np.random.Generator], Group]

PLACES: Final[Mapping[str, tuple[Builder, Mapping[str, Material]]]] = MappingProxyType(
    {"park": (park, PARK_MATERIALS), "racetrack": (racetrack, RACETRACK_MATERIALS)}
)
"""Places by name: who builds it, and its own materials."""


def build_place(name: str, seed: int) -> MeshModel:
    """Build a place: everything that stands in it, painted; the same for the same seed.

    Raises
    ------
    ValueError
        There is no such place, or the seed is negative.
    """
    group = _group(name, seed)
    materials = {**MATERIALS, **PLACES[name][1]}
    by_material: dict[str, list[Surface]] = {}
    for material, surface in group.surfaces:
        by_material.setdefault(material, []).append(surface)
    meshes = tuple(
        _painted(material, materials[material], joined(surfaces), _generator(material, seed))
        for material, surfaces in by_material.items()
    )
    return MeshModel(name=name, meshes=meshes, lamps=group.lamps, solids=group.solids)


def outline_place(name: str, seed: int) -> MeshModel:
    """Return the solids of a place and nothing to draw, for who only needs to know what not to fly into.

    Raises
    ------
    ValueError
        There is no such place, or the seed is negative.
    """
    group = _group(name, seed)
    return MeshModel(name=name, meshes=(), lamps=group.lamps, solids=group.solids)


def _group(name: str, seed: int) -> Group:
    if name not in PLACES:
        raise ValueError(f"Expected one of the places {', '.join(PLACES)}, got {name!r}")
    if seed < 0:
        raise ValueError(f"Expected seed >= 0, got {seed}")
    build, _ = PLACES[name]
    return build(_generator(name, seed))


def _painted(name: str, material: Material, surface: Surface, rng: np.random.Generator) -> TexturedMesh:
    return TexturedMesh(
        name=name,
        vertices_world_m=surface.vertices_m,
        normals_world=surface.normals,
        triangles=surface.triangles,
        uv=surface.uv_m / material.size_m,
        reflectance_rgb=material.picture(rng, material.shape),
        emission_rgb=material.emission_rgb,
        two_sided=material.two_sided,
    )


def _generator(name: str, seed: int) -> np.random.Generator:
    """Random numbers of one thing: its own, whatever else is built."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])
