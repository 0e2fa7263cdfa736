"""Results of runs: one small JSON file each, which is there once the run is complete."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.learning.flights import MotionKind
from tests.benchmarks.learning.runs import Arrangement, TrainingRun

ROOT: Final = Path(__file__).parents[3]
RESULTS: Final = ROOT / "out" / "learning"


@dataclass(frozen=True, slots=True)
class Results:
    """The results of one budget, in a folder."""

    folder: Path

    @property
    def flights(self) -> Path:
        """Where flights lie."""
        return self.folder / "flights"

    def holds(self, name: str) -> bool:
        """Whether there is a result of that name."""
        return self._path(name).exists()

    def write(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a result, entirely or not at all."""
        target = self._path(name)
        partial = target.with_suffix(".partial")
        partial.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
        partial.replace(target)

    def read(self, name: str) -> Mapping[str, Any] | None:
        """Return a result; None where there is none."""
        path = self._path(name)
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None

    def of(self, arrangement: Arrangement, seeds: int) -> tuple[Mapping[str, Any], ...]:
        """Return the results of an arrangement that are there, by seed."""
        every = (self.read(TrainingRun(arrangement, seed).name) for seed in range(seeds))
        return tuple(result for result in every if result is not None)

    def errors(self, arrangement: Arrangement, seeds: int, metric: str, kind: MotionKind) -> Sequence[float]:
        """Return an error measure on the test flights of a kind, one of each run that is there."""
        return [result["errors"][kind][metric] for result in self.of(arrangement, seeds)]

    def trivial(self, arrangement: Arrangement) -> Mapping[str, Any] | None:
        """Return the errors of the predictors that look at no events, by their name; None where they are not there."""
        return self.read(trivial_name(arrangement))

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def trivial_name(arrangement: Arrangement) -> str:
    """Name of the result of the predictors that look at no events."""
    return f"{arrangement.kind}-{arrangement.rate_hz}hz-trivial"
