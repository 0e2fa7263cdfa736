"""Which kind of flight a scene's table describes: its ``kind``, or, without one, steady rates and sines."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Discriminator, Tag

from fedora_generator.flight import FlightOptions
from fedora_generator.flights.kinds import BurstOptions, HoverOptions, LoopOptions, SurveyOptions, WaypointsOptions
from fedora_generator.flights.plan import waypoints_table
from fedora_generator.flights.presets import preset_table

TAG_PREFIX: Final = "kind="
"""Prefix of those parts of an error's location that stand for a kind, and not for a key."""

KINDS: Final = ("waypoints", "survey", "loop", "hover", "burst", "plan", "preset")
"""Values of ``kind`` in a scene; the last two refer to a table elsewhere."""

_HARMONIC: Final = TAG_PREFIX + "harmonic"


def resolve_flight(flight: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Table of a flight, with the table that it refers to in its place.

    Raises
    ------
    SceneError
        There is no such plan or preset, or the plan cannot be flown.
    """
    if flight.get("kind") == "plan":
        return waypoints_table(flight, folder)
    return preset_table(flight) if flight.get("kind") == "preset" else flight


def _require_known_kind(flight: object) -> object:
    if isinstance(flight, Mapping) and "kind" in flight and flight["kind"] not in KINDS:
        raise ValueError(f"Expected kind to be one of {', '.join(KINDS)}, or none, got {flight['kind']!r}")
    return flight


def _tag(flight: Any) -> str:
    kind = flight.get("kind") if isinstance(flight, Mapping) else getattr(flight, "kind", None)
    return _HARMONIC if kind is None else TAG_PREFIX + kind


FlightChoice = Annotated[
    Annotated[FlightOptions, Tag("kind=harmonic")]
    | Annotated[WaypointsOptions, Tag("kind=waypoints")]
    | Annotated[SurveyOptions, Tag("kind=survey")]
    | Annotated[LoopOptions, Tag("kind=loop")]
    | Annotated[HoverOptions, Tag("kind=hover")]
    | Annotated[BurstOptions, Tag("kind=burst")],
    Discriminator(_tag),
    BeforeValidator(_require_known_kind),
]
"""The type of a scene's flight."""
