"""What a place is described by: builders of objects, their positions, and the materials that only it has.

A builder draws what it leaves to chance from a generator of random numbers and returns an object in a frame of its own:
metres, z up, the ground at z = 0. ``functools.partial`` gives it its sizes. A description combines builders and runs
none, so it is data.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fedora_generator.mesh.places.materials import Material
from fedora_generator.mesh.places.surface import Group, together

Builder = Callable[[np.random.Generator], Group]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceDescription:
    """Objects of a place in the world frame (ENU), metres.

    The order of ``objects`` is that of the random numbers. ``materials`` are those that ``MATERIALS`` does not have.
    """

    objects: tuple[Builder, ...]
    materials: Mapping[str, Material]

    def build(self, rng: np.random.Generator) -> Group:
        """Build all objects in order."""
        return together(build(rng) for build in self.objects)


def objects(
    build: Builder, at_m: tuple[tuple[float, float], ...], *, z_m: float = 0.0, yaw_deg: float = 0.0
) -> Builder:
    """Several objects of the same kind and sizes; what is random differs between them.

    Parameters
    ----------
    build
        Builds an object in a frame of its own.
    at_m
        x and y of each object's origin, metres.
    z_m
        Height of the origins.
    yaw_deg
        Rotation of each object about the vertical, degrees counter-clockwise.
    """
    return lambda rng: together(build(rng).at(x_m, y_m, z_m, yaw_deg) for x_m, y_m in at_m)


def assembly(*parts: Builder) -> Builder:
    """Objects that keep their positions to each other; together they are placed like a single object."""
    return lambda rng: together(build(rng) for build in parts)
