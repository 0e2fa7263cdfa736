"""Rectangles, boxes, movers with their movement, and lamps of the world (ENU, metres), read from TOML."""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.surfaces.textures import Texture

Floats = NDArray[np.float64]
Axis = Literal["x", "y", "z"]

AXES: Final[tuple[Axis, ...]] = ("x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sway:
    """``amplitude_m * sin(2 pi frequency_hz t + phase_deg)`` along one axis of the world."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    axis: Axis
    amplitude_m: float
    frequency_hz: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise ValueError(f"Expected axis to be one of {', '.join(AXES)}, got {self.axis!r}")
        if not all(map(math.isfinite, (self.amplitude_m, self.frequency_hz, self.phase_deg))):
            raise ValueError(f"Expected a finite amplitude_m, frequency_hz and phase_deg, got {self}")

    def along_m(self, times_s: Floats) -> Floats:
        """Displacement (n,) along the axis."""
        return self.amplitude_m * np.sin(2 * math.pi * self.frequency_hz * times_s + math.radians(self.phase_deg))


@dataclass(frozen=True, slots=True, kw_only=True)
class Movement:
    """Displacement of a box from its described position: ``velocity_m_s t`` and the sum of its sways."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sways: tuple[Sway, ...] = ()

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.velocity_m_s)):
            raise ValueError(f"Expected a finite velocity_m_s, got {self.velocity_m_s}")

    def displacement_m(self, times_s: Floats) -> Floats:
        """Displacement (n, 3) in the world at ``times_s`` (n,)."""
        displacement_m = np.array(self.velocity_m_s) * times_s[:, None]
        for sway in self.sways:
            displacement_m[:, AXES.index(sway.axis)] += sway.along_m(times_s)
        return displacement_m


Vector = tuple[float, float, float]

HIGHEST_M: Final = 1000.0
"""Largest height of a flight over the ground: about the distance of the rims of the package's worlds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rectangle:
    """A one-sided rectangle; its front is where ``u_axis`` x ``v_axis`` points. The default lies flat, facing up."""

    name: str
    center_m: Vector
    size_m: tuple[float, float]
    texture: str
    u_axis: Vector = (1.0, 0.0, 0.0)
    v_axis: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        _require_size(self.name, self.size_m)
        axes = np.array([self.u_axis, self.v_axis])
        if not np.allclose(axes @ axes.T, np.eye(2), atol=1e-6):
            raise ValueError(f"Expected orthogonal unit vectors u_axis and v_axis, got {self.u_axis} and {self.v_axis}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An upright box turned by ``yaw_deg`` about the vertical; ``size_m`` is along its own x, y and z."""

    name: str
    center_m: Vector
    size_m: Vector
    texture: str
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        _require_size(self.name, self.size_m)

    @property
    def axes_world(self) -> NDArray[np.float64]:
        """Axes of the box as columns (3, 3): the rotation from its frame to the world's."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    def contains(self, positions_world_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, border included."""
        in_box_m = (positions_world_m - np.array(self.center_m)) @ self.axes_world
        return np.asarray((np.abs(in_box_m) <= 0.5 * np.array(self.size_m)).all(axis=-1))

    def heights_m(self, positions_world_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights (n,) of points (n, 3) over the top, NaN beside it."""
        in_box_m = (positions_world_m - np.array(self.center_m)) @ self.axes_world
        half_m = 0.5 * np.array(self.size_m)
        over = (np.abs(in_box_m[:, :2]) <= half_m[:2]).all(axis=-1)
        return np.where(over, in_box_m[:, 2] - half_m[2], np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mover(Box):
    """A box that moves as one body: at time t it is at ``center_m`` plus its movement's displacement."""

    movement: Movement


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamp:
    """A point lamp: irradiance ``strength`` at 1 m, falling with the inverse square (softened near the lamp)."""

    position_m: Vector
    strength: float = 1.0

    def __post_init__(self) -> None:
        if self.strength < 0:
            raise ValueError(f"Expected strength >= 0, got {self.strength}")


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Everything at rest (body 0), and the ``movers``: bodies 1, 2, ... Boxes may touch and pierce each other."""

    name: str
    textures: dict[str, Texture]
    rectangles: tuple[Rectangle, ...] = ()
    boxes: tuple[Box, ...] = ()
    lamps: tuple[Lamp, ...] = field(default=())
    movers: tuple[Mover, ...] = ()

    def __post_init__(self) -> None:
        if not self.rectangles and not self.boxes:
            raise ValueError(f"Expected at least one rectangle or box, got an empty world {self.name!r}")
        solids: list[Rectangle | Box] = [*self.rectangles, *self.boxes, *self.movers]
        for solid in solids:
            if solid.texture not in self.textures:
                names = ", ".join(self.textures) or "none"
                raise ValueError(f"Expected a texture of the world ({names}), got {solid.texture!r} at {solid.name!r}")

    def collision(
        self, positions_world_m: NDArray[np.float64], times_s: NDArray[np.float64] | None = None
    ) -> tuple[int, str] | None:
        """First point that is inside a box, under the ground or beyond its rim.

        Parameters
        ----------
        positions_world_m
            (n, 3) points.
        times_s
            (n,) time at each point; without it, movers are at their position at time 0.

        Returns
        -------
        collision
            Index of the point, and what it collides with; None if all points are free.
        """
        hits = [(_first(box.contains(positions_world_m)), f"inside {box.name!r}") for box in self.boxes]
        for mover in self.movers:
            displacement_m = mover.movement.displacement_m(np.zeros(1) if times_s is None else times_s)
            hits.append((_first(mover.contains(positions_world_m - displacement_m)), f"inside {mover.name!r}"))
        heights_m = []
        for flat in self.rectangles:
            axes = np.array([flat.u_axis, flat.v_axis])
            normal = np.cross(*axes)
            if normal[2] > 0.5:  # it faces up: it is ground
                offsets_m = positions_world_m - np.array(flat.center_m)
                over = (np.abs(offsets_m @ axes.T) <= 0.5 * np.array(flat.size_m)).all(axis=-1)
                heights_m.append(np.where(over, offsets_m @ normal, np.nan))
                hits.append((_first(heights_m[-1] <= 0), f"below {flat.name!r}"))
        if heights_m:  # a world without ground has no rim
            heights_m += [box.heights_m(positions_world_m) for box in self.boxes]
            hits += departures(np.fmin.reduce(heights_m))
        return min(((index, obstacle) for index, obstacle in hits if index is not None), default=None)


def departures(heights_m: NDArray[np.float64]) -> list[tuple[int | None, str]]:
    """First point beyond the rim of the ground, and first point too far above it.

    Parameters
    ----------
    heights_m
        (n,) over the ground; NaN where there is no ground below.

    Returns
    -------
    departures
        Index of the point, None if there is none, and what it departs from.
    """
    return [
        (_first(np.isnan(heights_m)), "beyond the rim of the ground"),
        (_first(heights_m > HIGHEST_M), f"more than {HIGHEST_M:g} m above the ground"),
    ]


def _first(flags: NDArray[np.bool_]) -> int | None:
    return int(np.argmax(flags)) if flags.any() else None


def _require_size(name: str, size_m: tuple[float, ...]) -> None:
    if min(size_m) <= 0:
        raise ValueError(f"Expected size_m > 0, got {size_m} at {name!r}")
