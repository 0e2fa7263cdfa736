"""The clean sequences that are transformed."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from tests.benchmarks.foreign.transformation import Transformation

SCENES: Final = {"park-day": 2.3, "park-night": 2.3, "park-noisy": 1.6, "park-traffic": 0.6, "racetrack": 0.9}
"""Seconds of flight from the start of a sequence to that of the next seed, by scene."""

SEEDS: Final = 4


@dataclass(frozen=True, slots=True)
class Size:
    """How large the sequences are, px and s."""

    width: int = 270
    height: int = 200
    duration_s: float = 1.0

    @property
    def name(self) -> str:
        """The folder of its outcomes."""
        return f"{self.width}x{self.height}-{self.duration_s:g}s"


@dataclass(frozen=True, slots=True)
class Source:
    """One clean sequence."""

    scene: str
    seed: int

    def write(self, size: Size, target: Path) -> None:
        """Generate it. Another seed begins at another place of the flight, as some worlds have no noise."""
        scene = replace(load_scene(self.scene).with_size(size.width, size.height), seed=self.seed)
        request = Request(duration_s=size.duration_s, quality="draft")
        generate_sequence(scene.starting_at(SCENES[self.scene] * self.seed), target, request, overwrite=True)


def state_path(folder: Path, transformation: Transformation, source: Source) -> Path:
    """Return the place of what the checks said of a file."""
    name = "".join(letter if letter.isalnum() else "-" for letter in transformation.name)
    return folder / f"{name}-{source.scene}-{source.seed}.json"
