"""What the checks say of one transformed file."""

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import h5py

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.benchmarks.foreign.scenes import Source, state_path
from tests.benchmarks.foreign.transformation import Transformation


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the checks say of a file, which is correct.

    Attributes
    ----------
    transformation, scene, seed
        The transformation and the sequence.
    verdict
        Of the file.
    alarms
        Code and message of each finding of a failed check, and each crash; empty as it should be.
    warnings
        Codes of the findings of checks that warn.
    """

    transformation: str
    scene: str
    seed: int
    verdict: str
    alarms: tuple[str, ...]
    warnings: tuple[str, ...]


def check_transformed(transformation: Transformation, source: Source, folder: Path, clean: Path) -> Outcome:
    """Transform a copy of a clean sequence, check it, and forget it; an outcome in ``folder`` is read instead."""
    state = state_path(folder, transformation, source)
    if state.exists():
        return outcome_of(json.loads(state.read_text(encoding="utf-8")))
    target = state.with_suffix(".h5")
    try:
        transform(transformation, clean, target)
        record = check_file(target, CheckOptions(evidence=None, profile="release")).record
    finally:
        target.unlink(missing_ok=True)
    alarms = [f"{x.code}: {x.message}" for r in record.results if r.outcome == "failed" for x in r.findings]
    alarms += [f"{r.check} crashed: {r.traceback}" for r in record.results if r.outcome == "crashed"]
    warnings = [x.code for r in record.results if r.outcome == "warned" for x in r.findings]
    outcome = Outcome(transformation.name, source.scene, source.seed, record.verdict, tuple(alarms), tuple(warnings))
    partial = state.with_suffix(".partial")
    partial.write_text(json.dumps(asdict(outcome)), encoding="utf-8")
    partial.rename(state)
    return outcome


def transform(transformation: Transformation, clean: Path, target: Path) -> None:
    """Write the transformed copy of a clean sequence."""
    shutil.copyfile(clean, target)
    with h5py.File(target, "r+") as file:
        transformation.change(file)


def outcome_of(values: dict[str, Any]) -> Outcome:
    """Return an outcome from what JSON holds of it."""
    return Outcome(**{**values, "alarms": tuple(values["alarms"]), "warnings": tuple(values["warnings"])})
