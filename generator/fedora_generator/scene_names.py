"""The scenes of the package by name, and what each shows, without anything that draws them."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from fedora_generator.flights.presets import PRESET_NAMES

SCENES: Final = Path(__file__).parent / "scenes"
"""The folder of their files."""

SCENE_NAMES: Final = (
    "park-day",
    "park-night",
    "racetrack",
    "hover",
    "fast-turn",
    "park-noisy",
    "park-traffic",
    "racetrack-drive",
    "park-mesh-day",
    "park-mesh-night",
    "racetrack-mesh-day",
    "racetrack-mesh-night",
    *PRESET_NAMES,
)
"""Scenes of the package: the first has an exact world and every stream, the last are the paper's sequences."""


def scene_descriptions() -> Mapping[str, str]:
    """Return what each scene of the package shows, by its name, in order."""
    return {name: tomllib.loads((SCENES / f"{name}.toml").read_text("utf-8"))["description"] for name in SCENE_NAMES}
