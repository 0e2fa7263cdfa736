"""Groups: painted surfaces with their lamps and solids, in a frame of their own, which are placed together."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fedora_generator.mesh.places.surface import Surface, moved, yaw_matrix
from fedora_generator.surfaces.world import Box, Lamp, Vector


@dataclass(frozen=True, slots=True)
class Group:
    """Surfaces by the name of their material, with the lamps and solids that belong to them."""

    surfaces: tuple[tuple[str, Surface], ...] = ()
    lamps: tuple[Lamp, ...] = ()
    solids: tuple[Box, ...] = ()

    def __add__(self, other: "Group") -> "Group":
        return Group(self.surfaces + other.surfaces, self.lamps + other.lamps, self.solids + other.solids)

    def at(self, x_m: float, y_m: float, z_m: float = 0.0, yaw_deg: float = 0.0) -> "Group":
        """Return the group rotated about the vertical, then shifted.

        Parameters
        ----------
        x_m, y_m, z_m
            Shift.
        yaw_deg
            Rotation, counter-clockwise.
        """
        shift_m = np.array([x_m, y_m, z_m])

        def place(position_m: Vector) -> Vector:
            x, y, z = (yaw_matrix(yaw_deg) @ position_m + shift_m).tolist()
            return x, y, z

        return Group(
            tuple((material, moved(surface, shift_m, yaw_deg)) for material, surface in self.surfaces),
            tuple(replace(lamp, position_m=place(lamp.position_m)) for lamp in self.lamps),
            tuple(
                replace(solid, center_m=place(solid.center_m), yaw_deg=solid.yaw_deg + yaw_deg) for solid in self.solids
            ),
        )


def painted(material: str, *surfaces: Surface) -> Group:
    """Surfaces of one material."""
    return Group(tuple((material, surface) for surface in surfaces))


def solid(name: str, size_m: Vector, center_m: Vector) -> Group:
    """Build an upright box that a camera must not enter; nothing is drawn.

    Parameters
    ----------
    name
        For the message of a collision.
    size_m
        Along the box's own x, y and z.
    center_m
        In the frame of the group.
    """
    return Group(solids=(Box(name=name, center_m=center_m, size_m=size_m, texture=name),))


def together(groups: Iterable[Group]) -> Group:
    """All groups as one."""
    parts = list(groups)
    return Group(
        tuple(item for part in parts for item in part.surfaces),
        tuple(lamp for part in parts for lamp in part.lamps),
        tuple(box for part in parts for box in part.solids),
    )
