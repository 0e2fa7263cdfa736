"""Flights of the package by name: ``[flight] kind = "preset"``, ``name = "baylands-day1"``.

Duration, distance and largest speed and rate of turn are those of the sequence of that name in the table of the FEDORA
paper; the route is not. The baylands flights fit the avenue of the park, the others the straight of the racetrack. The
package's scenes of the same names fly them.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from fedora_generator.errors import SceneError

_PRESETS: Final = Path(__file__).parents[1] / "scenes" / "flights"

PRESET_NAMES: Final = ("baylands-day1", "baylands-day2", "baylands-ngt1", "racetrack-day", "racetrack-ngt")
"""Names of flights, and of the scenes that fly them."""


def preset_table(flight: Mapping[str, Any]) -> dict[str, Any]:
    """Table of the preset that a scene's table names, overridden by the scene's other keys.

    Raises
    ------
    SceneError
        There is no such preset.
    """
    name = flight.get("name")
    if name not in PRESET_NAMES:
        raise SceneError(f"Expected name to be one of the flights {', '.join(PRESET_NAMES)}, got {name!r}")
    table = tomllib.loads((_PRESETS / f"{name}.toml").read_text(encoding="utf-8"))
    return {**table, **{key: value for key, value in flight.items() if key not in ("kind", "name")}}
