"""What a request chooses from: scenes of the package, streams, qualities, durations and seeds; nothing here draws."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Literal

from fedora_generator.flights.presets import PRESET_NAMES

STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", "flow")

Quality = Literal["draft", "standard", "reference"]
"""How closely events follow the light."""

DEFAULT_DURATION_S: Final = 2.0

MOST_SEED: Final = (1 << 63) - 1
"""A file stores the seed with 64 bits."""

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
