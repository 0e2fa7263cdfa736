"""Places of the mesh world: a park and a racetrack, each described in a file of its own and built from a seed.

Read in this order:

* ``park``, ``racetrack``: what stands where, with its sizes and materials, and the ground around the flight.
  ``description`` is what they are written in.
* ``buildings``, ``furniture``, ``trees``, ``ground``: the builders of objects.
* ``surface``, ``shapes``: surfaces in metres, and how they are combined and placed.
* ``materials``, ``paint``: pictures of the materials.
"""

import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_generator.mesh.model import MeshModel, TexturedMesh
from fedora_generator.mesh.places.description import PlaceDescription
from fedora_generator.mesh.places.materials import MATERIALS
from fedora_generator.mesh.places.park import PARK
from fedora_generator.mesh.places.racetrack import RACETRACK
from fedora_generator.mesh.places.surface import Group, Surface, joined

PLACES: Final[Mapping[str, PlaceDescription]] = MappingProxyType({"park": PARK, "racetrack": RACETRACK})


def build_place(name: str, seed: int) -> MeshModel:
    """Build a place with its meshes, lamps and solids.

    Parameters
    ----------
    name
        Of ``PLACES``.
    seed
        The same seed gives the same place.

    Raises
    ------
    ValueError
        There is no such place, or the seed is negative.
    """
    group = _group(name, seed)
    materials = {**MATERIALS, **PLACES[name].materials}
    by_material: dict[str, list[Surface]] = {}
    for material_name, surface in group.surfaces:
        by_material.setdefault(material_name, []).append(surface)
    meshes = []
    for material_name, surfaces in by_material.items():
        material, surface = materials[material_name], joined(surfaces)
        meshes.append(
            TexturedMesh(
                name=material_name,
                vertices_world_m=surface.vertices_m,
                normals_world=surface.normals,
                triangles=surface.triangles,
                uv=surface.uv_m / material.size_m,
                reflectance_rgb=material.picture(_generator(material_name, seed), material.shape),
                emission_rgb=material.emission_rgb,
                two_sided=material.two_sided,
            )
        )
    return MeshModel(name=name, meshes=tuple(meshes), lamps=group.lamps, solids=group.solids)


def outline_place(name: str, seed: int) -> MeshModel:
    """Build a place with its lamps and solids, but without meshes: enough to test a flight for collisions.

    Parameters
    ----------
    name
        Of ``PLACES``.
    seed
        As in ``build_place``.

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
    return PLACES[name].build(_generator(name, seed))


def _generator(name: str, seed: int) -> np.random.Generator:
    """Random numbers of a place or a material, which do not depend on what else is built."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])
