"""A scene: world, light, flight and sensors, read from TOML.

``world`` names a world of the package, or a TOML file beside the scene, or is a table itself. ``base`` names a scene
whose tables this one starts from. A world has a ``base`` as well: its textures are put over those of the other, its
rectangles, boxes and lamps are added.

``renderer`` is how it is drawn. ``"exact"`` (the default) casts rays in float64. ``"mesh"`` draws triangles through
OpenGL: the same ``world``, or a place of ``mesh/places``, which only this renderer can draw::

    renderer = "mesh"
    place = { name = "park", seed = 3 }     # instead of world; seed is 0 if left out

Boxes that move are ``movers`` of an exact world; a scene may add them to the world of its base::

    [[world.movers]]
    name = "cart"
    center_m = [7.0, -1.6, 0.5]
    size_m = [1.6, 0.9, 1.0]
    texture = "wood"
    movement = { velocity_m_s = [0.3, 1.2, 0.0] }    # and sways, see surfaces/world.py

``[flight]`` is a sum of steady rates and sines (``flight.py``), or, with a ``kind``, flown by a quadrotor
(``flights/``).

``[rates]`` sets how often streams are written (``rates.py``); a rate of the inertial unit is ``imu.rate_hz``::

    [rates]
    frames_hz = 100                  # colour, and depth without a depth_hz
    flow_hz = [20, 12.5]
    pose_hz = 250

``[camera]`` may give all cameras a distorted lens (``camera.py``), with the exact renderer::

    [camera]
    distortion_model = "radtan"      # or "equidistant"
    distortion = [-0.37, 0.16, 3e-4, -2e-4]

``[mesh]`` sets its precision and antialiasing (``mesh/model.py``); without it the quality of the request does.
"""

import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from fedora_generator.camera import CameraOptions
from fedora_generator.errors import SceneError
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.flight import Flight
from fedora_generator.flights.choice import TAG_PREFIX, FlightChoice
from fedora_generator.flights.kinds import QuadrotorOptions
from fedora_generator.imu import ImuOptions, PoseOptions
from fedora_generator.mesh.model import MeshDetail
from fedora_generator.rates import RateOptions
from fedora_generator.scene_tables import impossible_value, read_scene, scene_path
from fedora_generator.surfaces.light import Light
from fedora_generator.surfaces.world import World

_LONGEST_VALUE_TEXT: Final = 60

# Pydantic's names of the two problems that have their own sentences.
_UNKNOWN_KEY: Final = ("unexpected_keyword_argument", "extra_forbidden")
_MISSING_KEY: Final = ("missing", "missing_argument", "missing_keyword_only_argument")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A place of ``mesh/places`` by its name, the same for the same seed."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    name: str
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Everything that determines a sequence, but its duration.

    It has either a ``world`` or a ``place``. ``mesh`` is None where the quality of the request decides.
    ``event_step_us`` fixes the renders of the event camera to a grid, as in a game engine; with 0 image motion decides.
    ``depth_range_m`` is the nearest and farthest valid z-depth. The sequence begins ``start_s`` into the flight.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    name: str
    description: str
    world: World | None = None
    place: Place | None = None
    renderer: Literal["exact", "mesh"] = "exact"
    mesh: MeshDetail | None = None
    light: Light
    flight: FlightChoice
    start_s: float = 0.0
    events: EventSensorOptions
    event_step_us: int = 0
    camera: CameraOptions = field(default_factory=CameraOptions)
    imu: ImuOptions = field(default_factory=ImuOptions)
    pose: PoseOptions = field(default_factory=PoseOptions)
    rates: RateOptions = field(default_factory=RateOptions)
    depth_range_m: tuple[float, float] = (0.1, 30.0)
    seed: int = 0

    def __post_init__(self) -> None:
        if self.renderer not in ("exact", "mesh"):
            raise ValueError(f"Expected renderer to be 'exact' or 'mesh', got {self.renderer!r}")
        if (self.world is None) == (self.place is None):
            raise ValueError(f"Expected either a world or a place, got {'neither' if self.world is None else 'both'}")
        if self.renderer == "exact" and self.world is None:
            raise ValueError("Expected a world with the exact renderer, got a place; set renderer = 'mesh'")
        if self.renderer == "exact" and self.mesh is not None:
            raise ValueError("Expected no table mesh with the exact renderer, got one; set renderer = 'mesh'")
        if self.renderer == "mesh" and self.camera.distortion_model != "none":
            raise ValueError("Expected no distortion with the mesh renderer, got some; use the exact one")
        if self.world is not None and self.world.movers:
            # The light of the exact world is computed once, so that nothing may move in that of a lamp.
            if self.renderer == "mesh":
                raise ValueError("Expected no movers with the mesh renderer, got some; use the exact one")
            if any(lamp.strength * self.light.lamp_scale > 0 for lamp in self.world.lamps):
                raise ValueError(
                    "Expected no lit lamp where anything moves, whose light would change; set lamp_scale to 0"
                )
        near_m, far_m = self.depth_range_m
        if not 0 < near_m < far_m:
            raise ValueError(f"Expected depth_range_m to ascend from above 0, got {near_m} to {far_m}")
        if not 0 <= self.event_step_us <= self.rates.frame_interval_us:
            raise ValueError(
                f"Expected event_step_us from 0 to {self.rates.frame_interval_us:g}, the interval of the frames, at "
                f"which events are rendered anyway, got {self.event_step_us}"
            )
        if self.events.model == "linear" and self.event_step_us == 0:
            raise ValueError(
                "Expected event_step_us with the linear model, which compares one rendered step to the next"
            )
        if not (math.isfinite(self.start_s) and self.start_s >= 0):
            raise ValueError(f"Expected start_s >= 0, got {self.start_s}")
        if self.seed < 0:
            raise ValueError(f"Expected seed >= 0, got {self.seed}")
        if not self.name or "/" in self.name:
            raise ValueError(f"Expected a name, without a slash as files are called after it, got {self.name!r}")

    @property
    def digest(self) -> str:
        """SHA-256 of the scene's canonical JSON."""
        values = _ADAPTER.dump_python(self, mode="json")
        # A scene of the usual rates has the digest that it had before there were others.
        if self.rates == RateOptions():
            del values["rates"]
        # And so has one without distortion.
        if self.camera.distortion_model == "none":
            del values["camera"]["distortion_model"], values["camera"]["distortion"]
        # And one whose sensor is not lin-log.
        if not self.events.linear_below_dn:
            del values["events"]["linear_below_dn"]
        document = json.dumps(values, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(document.encode()).hexdigest()

    def fly(self) -> Flight:
        """Flight of the scene from its start on, in the wind of its seed."""
        return Flight(self.flight, self.seed, self.start_s)

    @property
    def remaining_s(self) -> float | None:
        """How long the flight lasts from the start on; None where it has no end, as a hover or a sum of sines."""
        length_s = self.flight.route().duration_s if isinstance(self.flight, QuadrotorOptions) else 0.0
        return length_s - self.start_s if length_s > 0 else None

    def starting_at(self, start_s: float) -> "Scene":
        """Return the scene with its sequence beginning ``start_s`` seconds into the flight, while that lasts."""
        try:
            scene = replace(self, start_s=start_s)
        except ValueError as error:
            raise SceneError(str(error)) from error
        if scene.remaining_s is not None and scene.remaining_s <= 0:
            raise SceneError(
                f"Expected a start before the end of the flight at {start_s + scene.remaining_s:g} s, got {start_s:g} s"
            )
        return scene

    def with_size(self, width: int, height: int) -> "Scene":
        """Return the scene with another size of the colour and depth camera."""
        try:
            return replace(self, camera=replace(self.camera, width=width, height=height))
        except ValueError as error:
            raise SceneError(str(error)) from error


_ADAPTER: Final = TypeAdapter(Scene)


def load_scene(name_or_path: str | Path) -> Scene:
    """Scene of the package by its name, or of a TOML file.

    Raises
    ------
    SceneError
        No such scene, not TOML, a key that is unknown or missing, or a value that is refused.
    """
    path = scene_path(str(name_or_path))
    tables = read_scene(path)
    try:
        scene = _ADAPTER.validate_python(tables)
    except ValidationError as error:
        raise SceneError(f"{_sentence_about_first_problem(error)} ({path.name})") from error
    if impossible := impossible_value(tables):
        raise SceneError(f"{impossible} ({path.name})")
    return scene


def _sentence_about_first_problem(error: ValidationError) -> str:
    """Return a sentence about the first problem and its key; an unknown key explains a missing one and comes first."""
    first = min(error.errors(), key=lambda problem: problem["type"] not in _UNKNOWN_KEY)
    parts = (str(part) for part in first["loc"])
    key = ".".join(part for part in parts if not part.startswith(TAG_PREFIX)) or "the scene"
    if first["type"] in _UNKNOWN_KEY:
        return f"Expected only known keys, got {key}; remove or correct it"
    if first["type"] in _MISSING_KEY:
        return f"Expected a value for {key}, got none; add it"
    if first["type"] == "value_error":
        return f"{first['msg'].removeprefix('Value error, ')}, at {key}"
    expected = first["msg"].replace("Input should be", "Expected", 1)
    if first["type"] == "dataclass_type":
        expected = "Expected a table"
    if first["type"] == "too_long":
        expected = f"Expected at most {first['ctx']['max_length']} values"
    got = repr(first["input"])
    if len(got) > _LONGEST_VALUE_TEXT:
        got = f"{got[:_LONGEST_VALUE_TEXT]}..."
    return f"{expected}, got {got} at {key}"
