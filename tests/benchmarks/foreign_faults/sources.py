"""The clean sequences in which faults are planted."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from tests.benchmarks.foreign.scenes import Size

SPAN_S: Final = {"park-day": 6.9, "park-night": 6.9, "park-noisy": 4.8, "park-traffic": 1.8, "racetrack": 2.7}
"""Seconds of a scene's flight over which the sequences begin."""

SEEDS: Final = 2

GOLDEN: Final = 0.618_033_988_749_895
"""Multiples of the golden section, modulo 1, lie apart however many there are."""


@dataclass(frozen=True, slots=True)
class Source:
    """One clean sequence."""

    scene: str
    seed: int

    @property
    def start_s(self) -> float:
        """Where in the flight it begins: at places of this study alone."""
        return SPAN_S[self.scene] * ((0.37 + GOLDEN * self.seed) % 1.0)

    @property
    def donor(self) -> "Source":
        """The sequence of the same world that is taken for another one."""
        return Source(self.scene, self.seed + 1)

    def write(self, size: Size, target: Path) -> None:
        """Generate it."""
        scene = replace(load_scene(self.scene).with_size(size.width, size.height), seed=40_961 + 97 * self.seed)
        request = Request(duration_s=size.duration_s, quality="draft")
        generate_sequence(scene.starting_at(self.start_s), target, request, overwrite=True)
