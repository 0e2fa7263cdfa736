"""A fault that real pipelines make, with the causes that name it rightly."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from zlib import crc32

import h5py
import numpy as np
from numpy.typing import NDArray

EXACT_SCENES: Final = ("park-day", "park-night", "racetrack")
"""Scenes whose pose has no noise and in which nothing moves by itself: geometry can be computed from the file."""

QUIET_SCENES: Final = (*EXACT_SCENES, "park-traffic")
"""Scenes without noise of sensors."""

ALL_SCENES: Final = (*QUIET_SCENES, "park-noisy")

SHARES: Final = (0.12, 0.35)
"""Of the length of a file, the least and the greatest interval of a local fault."""

LAST_ROUND: Final = 12
"""The last round of kinds. It was measured before anybody had looked at its outcomes."""


@dataclass(frozen=True, slots=True)
class Range:
    """Sizes of a fault: log-uniform between two ends, of either sign where ``signed``, whole numbers if ``whole``."""

    low: float
    high: float
    unit: str
    signed: bool = False
    whole: bool = False

    def draw(self, random: np.random.Generator) -> float:
        """Return a size."""
        size = float(np.exp(random.uniform(np.log(self.low), np.log(self.high))))
        size = float(np.rint(size)) if self.whole else size
        return -size if self.signed and random.random() < 0.5 else size

    def holds(self, size: float) -> bool:
        """Whether a size can be drawn."""
        return self.low <= abs(size) <= self.high and (self.signed or size > 0) and (not self.whole or size % 1 == 0)


@dataclass(frozen=True, slots=True)
class Plan:
    """What is planted in a file.

    Attributes
    ----------
    size
        Of the fault, in the unit of its range; 0 where it has none.
    begin, end
        Shares of the rows, or of the time, that it covers.
    random
        Further random numbers, places and directions.
    donor
        A clean file of another sequence of the same world.
    """

    size: float
    begin: float
    end: float
    random: np.random.Generator
    donor: Path

    def rows(self, count: int) -> slice:
        """Return the rows of a dataset that it covers."""
        return slice(round(self.begin * count), max(round(self.begin * count) + 1, round(self.end * count)))

    def times_us(self, timestamps_us: NDArray[Any]) -> NDArray[np.bool_]:
        """Return which timestamps of a sorted stream lie within the time that it covers."""
        first_us, span_us = float(timestamps_us[0]), float(timestamps_us[-1] - timestamps_us[0])
        share = (timestamps_us - first_us) / span_us
        within: NDArray[np.bool_] = (share >= self.begin) & (share <= self.end)
        return within

    def direction(self) -> NDArray[np.float64]:
        """Return a random unit vector."""
        vector = self.random.normal(size=3)
        return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)


Plant = Callable[[h5py.File, Plan], None]
"""Puts a fault into an open copy of a clean file."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One way in which a pipeline spoils a file.

    Attributes
    ----------
    name
        In the table, and of the files.
    plant
        What is done to a copy.
    alters
        Beginnings of the paths of the objects that it alters; all else stays as it was, to the bit.
    truth
        Names that count as right, each ``stream:cause``; empty where no cause of the tool names the fault.
    pipeline
        Who makes it, in one sentence.
    size
        Range of its sizes; None where it has none.
    local
        Whether it covers a part of the file.
    composite
        Whether ``truth`` lists faults that are there together, not names of one fault.
    debatable
        Why the truth may be disputed.
    scenes
        Scenes in which it can be planted.
    round
        Counts from 1 the times at which kinds were added to be held out.
    """

    name: str
    plant: Plant
    alters: tuple[str, ...]
    truth: tuple[str, ...]
    pipeline: str
    size: Range | None = None
    local: bool = False
    composite: bool = False
    debatable: str = ""
    scenes: tuple[str, ...] = ALL_SCENES
    round: int = 1

    @property
    def held_out(self) -> bool:
        """Whether nobody looks at its outcomes while the diagnosis is built: all kinds of the last round."""
        return self.round == LAST_ROUND

    def plan(self, scene: str, seed: int, donor: Path) -> Plan:
        """Draw what is planted in a sequence: the same for the same sequence."""
        random = np.random.default_rng([crc32(self.name.encode()), crc32(scene.encode()), seed])
        size = 0.0 if self.size is None else self.size.draw(random)
        begin, end = 0.0, 1.0
        if self.local:
            share = float(np.exp(random.uniform(*np.log(SHARES))))
            begin = random.uniform(0.03, 0.97 - share)
            end = begin + share
        return Plan(size, begin, end, random, donor)
