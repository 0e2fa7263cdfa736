"""What the checks and the diagnosis say of one faulty file, and whether that is right."""

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import h5py

from fedora_qa.causes import stream_family
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.benchmarks.foreign_faults.kind import Kind, Plan
from tests.benchmarks.foreign_faults.sources import Source

UNKNOWN = "unknown"
"""Identifier of the cause that says that none is known."""


@dataclass(frozen=True, slots=True)
class Named:
    """A diagnosis: stream, cause, magnitude and how it is known."""

    stream: str
    cause: str
    magnitude: float | None
    unit: str
    status: str

    @property
    def name(self) -> str:
        """``stream:cause``, where a rate of flow counts as flow."""
        return f"{stream_family(self.stream)}:{self.cause}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What is said of a file with one fault, or a composite of two.

    Attributes
    ----------
    kind, scene, seed
        The fault and the sequence.
    size, begin, end
        Of what was planted (``Plan``).
    verdict
        Of the file.
    failed
        Names of the checks that failed.
    crashed
        Names of the checks that crashed.
    diagnoses
        All of them, in the order of the record.
    """

    kind: str
    scene: str
    seed: int
    size: float
    begin: float
    end: float
    verdict: str
    failed: tuple[str, ...]
    crashed: tuple[str, ...]
    diagnoses: tuple[Named, ...]

    @property
    def is_found(self) -> bool:
        """Whether any check failed."""
        return bool(self.failed)

    @property
    def first(self) -> Named | None:
        """The first diagnosis that names a cause."""
        if not self.diagnoses or self.diagnoses[0].cause == UNKNOWN:
            return None
        return self.diagnoses[0]

    def is_first_right(self, kind: Kind) -> bool:
        """Whether the first diagnosis names cause and stream; none must be named where the truth has no name."""
        if not kind.truth:
            return self.first is None
        return self.first is not None and self.first.name in kind.truth

    def is_second_right(self, kind: Kind) -> bool:
        """Whether the second diagnosis names cause and stream, and the first does not say the same."""
        if len(self.diagnoses) < 2:
            return False
        first, second = (diagnosis.name for diagnosis in self.diagnoses[:2])
        return second in kind.truth and second != first

    def are_all_named(self, kind: Kind) -> bool:
        """Whether the first diagnoses are those of the faults of a composite, in any order."""
        return {diagnosis.name for diagnosis in self.diagnoses[: len(kind.truth)]} == set(kind.truth)


def plant(kind: Kind, plan: Plan, clean: Path, target: Path) -> None:
    """Write a copy of a clean sequence with a fault."""
    shutil.copyfile(clean, target)
    with h5py.File(target, "r+") as file:
        kind.plant(file, plan)


def state_path(folder: Path, kind: Kind, source: Source) -> Path:
    """Return the place of an outcome."""
    name = "".join(letter if letter.isalnum() else "-" for letter in kind.name)
    return folder / f"{name}-{source.scene}-{source.seed}.json"


def diagnose_planted(kind: Kind, source: Source, folder: Path, clean: Path, donor: Path) -> Outcome:
    """Plant a fault in a copy, check it, and forget the copy; an outcome in ``folder`` is read instead."""
    state = state_path(folder, kind, source)
    if state.exists():
        return outcome_of(json.loads(state.read_text(encoding="utf-8")))
    plan = kind.plan(source.scene, source.seed, donor)
    target = state.with_suffix(".h5")
    try:
        plant(kind, plan, clean, target)
        record = check_file(target, CheckOptions(evidence=None, profile="release")).record
    finally:
        target.unlink(missing_ok=True)
    outcome = Outcome(
        kind=kind.name,
        scene=source.scene,
        seed=source.seed,
        size=plan.size,
        begin=plan.begin,
        end=plan.end,
        verdict=record.verdict,
        failed=tuple(result.check for result in record.results if result.outcome == "failed"),
        crashed=tuple(result.check for result in record.results if result.outcome == "crashed"),
        diagnoses=tuple(Named(x.stream, x.cause, x.magnitude, x.unit, x.status) for x in record.diagnoses),
    )
    partial = state.with_suffix(".partial")
    partial.write_text(json.dumps(asdict(outcome)), encoding="utf-8")
    partial.rename(state)
    return outcome


def outcome_of(values: dict[str, Any]) -> Outcome:
    """Return an outcome from what JSON holds of it."""
    lists = {name: tuple(values[name]) for name in ("failed", "crashed")}
    return Outcome(**{**values, **lists, "diagnoses": tuple(Named(**named) for named in values["diagnoses"])})
