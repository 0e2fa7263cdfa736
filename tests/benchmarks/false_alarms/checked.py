"""What the checks report of one correct file."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord, Result
from tests.benchmarks.false_alarms.combinations import Combination


@dataclass(frozen=True, slots=True)
class Pull:
    """How far a value lies from what is expected, in standard errors."""

    name: str
    pull: float


@dataclass(frozen=True, slots=True)
class Checked:
    """Outcomes and pulls of one file. ``verdict`` of a correct file should be ``clean``."""

    combination: str
    number: int
    verdict: str
    outcomes: dict[str, str]
    alarms: tuple[str, ...]
    pulls: tuple[Pull, ...]


def checked(combination: Combination, number: int, folder: Path) -> Checked:
    """Write a file, check all of it, and forget it; what was found before is read from ``folder``."""
    kept = folder / f"{combination.name}-{number}.json".replace(" ", "_").replace("/", "_")
    if kept.exists():
        return _read(kept)
    target = kept.with_suffix(".h5")
    combination.write(number, target)
    try:
        record = check_file(target, CheckOptions(evidence=None)).record
    finally:
        target.unlink()
    found = Checked(
        combination.name,
        number,
        record.verdict,
        {result.check: result.outcome for result in record.results},
        tuple(_alarms(record)),
        tuple(pull for result in record.results for pull in pulls_of(result)),
    )
    kept.write_text(json.dumps(asdict(found)), encoding="utf-8")
    return found


def _alarms(record: FileRecord) -> list[str]:
    alarms = [
        f"{one.code}: {one.message}"
        for result in record.results
        if result.outcome == "failed"
        for one in result.findings
    ]
    return alarms + [f"{one.check} crashed: {one.traceback}" for one in record.results if one.outcome == "crashed"]


def pulls_of(result: Result) -> list[Pull]:
    """Pulls of the values that are Gaussian under the noise model: two-sided, and the worst of nothing."""
    return [
        Pull(f"{result.check} {one.name}", (one.value - one.expected) / one.standard_error)
        for one in result.measurements
        if one.value is not None and one.expected is not None and one.standard_error
        if one.side == "both" and one.tests == 1
    ]


def _read(path: Path) -> Checked:
    values = json.loads(path.read_text(encoding="utf-8"))
    return Checked(
        values["combination"],
        values["number"],
        values["verdict"],
        values["outcomes"],
        tuple(values["alarms"]),
        tuple(Pull(**one) for one in values["pulls"]),
    )
