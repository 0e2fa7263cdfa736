"""Is the confidence of a diagnosis how often it is right? And how sharp would shares have to be for that?

Run ``python -m tests.benchmarks.confidence``. Faults of nominal size (docs/corpus.md) are planted in small sequences,
each alone. Of each that is found the first diagnosis is held against the truth. ``SHARPNESS`` of
``fedora_qa/diagnosis/diagnose.py`` is where the likelihood is greatest, rounded.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

import click
import numpy as np

from fedora_generator.corpus.build import plant_together
from fedora_generator.faults import FaultError
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.diagnosis import diagnose as diagnosis
from fedora_qa.engine.run import CheckOptions, check_file
from tests.benchmarks.named_causes import OPTIONS, planned_faults

SIZE: Final = (180, 136)
SHARPNESSES: Final = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0)
EDGES: Final = (0.0, 0.3, 0.5, 0.7, 0.9, 1.0)


@dataclass(frozen=True, slots=True)
class Told:
    """A first diagnosis: the plausibilities of its rivals, its own first, and whether it is right."""

    truth: str
    said: str
    plausibilities: tuple[float, ...]

    @property
    def is_right(self) -> bool:
        """Whether cause and stream are those that were planted."""
        return self.said == self.truth


@click.command()
@click.option("--scenes", default="park-day,park-noisy", show_default=True)
@click.option("--every", default=3, show_default=True, help="Plant every so manieth fault of a scene only.")
def main(scenes: str, every: int) -> None:
    """Plant, check, and print how true the confidence is."""
    told = [one for scene in scenes.split(",") for one in first_diagnoses(scene, every)]
    for line in page(told):
        click.echo(line)


def first_diagnoses(scene: str, every: int) -> Iterator[Told]:
    """Yield the first diagnosis of each planted fault that is found and to which causes are named."""
    small = load_scene(scene).with_size(*SIZE)
    with TemporaryDirectory() as folder:
        base, target = Path(folder, "clean.h5"), Path(folder, "faulty.h5")
        generate_sequence(small, base, Request(duration_s=OPTIONS.duration_s, quality=OPTIONS.quality))
        for planned in planned_faults(small)[::every]:
            target.unlink(missing_ok=True)
            try:
                plant_together(base, target, planned.faults, base.parent)
            except FaultError:
                continue
            one = _first_diagnosis(target, f"{planned.faults[0].stream}:{planned.faults[0].cause}")
            if one is not None:
                click.echo(f"{one.truth}: {one.said} {diagnosis.share_of_first(one.plausibilities):.0%}", err=True)
                yield one


def _first_diagnosis(path: Path, truth: str) -> Told | None:
    asked: list[Sequence[float]] = []

    def share(plausibilities: Sequence[float]) -> float:
        asked.append(plausibilities)
        return told_share(plausibilities)

    told_share = diagnosis.share_of_first
    with patch.object(diagnosis, "share_of_first", share):
        record = check_file(path, CheckOptions(evidence=None)).record
    if not asked:
        return None
    first = record.diagnoses[0]
    return Told(truth, f"{first.stream}:{first.cause}", tuple(asked[0]))


def log_likelihood(told: Sequence[Told], sharpness: float) -> float:
    """Return the logarithm of the probability that those are right which are, if confidences were true."""
    shares = np.array([diagnosis.share_of_first(one.plausibilities, sharpness) for one in told])
    right = np.array([one.is_right for one in told])
    return float(np.log(np.where(right, shares, 1.0 - shares)).sum())


def page(told: Sequence[Told]) -> Iterator[str]:
    """Two tables of markdown: what is right of what states how much, and the likelihood by sharpness."""
    shares = np.array([diagnosis.share_of_first(one.plausibilities) for one in told])
    right = np.array([one.is_right for one in told])
    yield f"{len(told)} diagnoses, {right.sum()} right."
    yield "\n| confidence | diagnoses | mean confidence | right |\n| --- | --- | --- | --- |"
    for low, high in pairwise(EDGES):
        within = (shares >= low) & (shares < high)
        if within.any():
            means = f"{shares[within].mean():.0%} | {right[within].mean():.0%}"
            yield f"| {low:.0%} to {high:.0%} | {within.sum()} | {means} |"
    yield "\n| sharpness | log-likelihood |\n| --- | --- |"
    for sharpness in SHARPNESSES:
        yield f"| {sharpness:g} | {log_likelihood(told, sharpness):.2f} |"


if __name__ == "__main__":
    main()
