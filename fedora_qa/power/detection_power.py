"""What is published of a study: the faults that each check finds with 95% probability, and how often causes are right.

Both are files of the package, made by ``make power``. The first has the digest of the code that it was measured with.
Where that code has changed since, the table is stale; callers that show it must state so. Diagnosis reads the second.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from fedora_qa.code_digest import PACKAGE, code_digest
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import read_published
from fedora_qa.record.power_study import WHOLE_FILE, Estimate, Power, Share

PUBLISHED: Final = Path(__file__).with_name("published.json")

MEASURED: Final = ("catalogue.py", "checks", "diagnosis", "estimators", "faults", "geometry", "judgement", "views")
"""Folders and files whose code and data decide which faults are found and which causes are named."""


def estimators_digest(package: Path = PACKAGE) -> str:
    """Return the SHA-256 of all sources in ``MEASURED``."""
    return code_digest(MEASURED, package)


@dataclass(frozen=True, slots=True)
class DetectableCause:
    """Power of a check for one cause: the share found over all sizes, and the size found with 95% probability."""

    cause: str
    unit: str
    check: str
    found: Share
    at_95: Estimate


@dataclass(frozen=True, slots=True)
class DetectionPower:
    """The measured power of all checks. ``clean`` and ``false_alarms`` count clean files."""

    estimators_digest: str
    ruleset_version: str
    files: int
    clean: int
    false_alarms: int
    found: tuple[DetectableCause, ...]

    def of(self, check: str) -> tuple[DetectableCause, ...]:
        """Return the causes that a check finds with 95% probability at some size, in the order of the study."""
        # Found with 95% probability from an estimated size on, or at every size of the study.
        return tuple(
            row
            for row in self.found
            if row.check == check
            and (row.at_95.value is not None or (row.found.count == row.found.of and row.found.of > 0))
        )

    def is_stale(self, digest: str | None = None) -> bool:
        """Whether it was measured with other code than that of this installation, or than that of ``digest``."""
        return self.estimators_digest != (digest or estimators_digest())


_ADAPTER: Final = TypeAdapter(DetectionPower)


def detection_power_of(power: Power) -> DetectionPower:
    """Return what is published of a study."""
    return DetectionPower(
        estimators_digest=power.estimators_digest,
        ruleset_version=power.ruleset_version,
        files=power.files,
        clean=power.clean,
        false_alarms=power.false_alarms.files.count,
        found=tuple(
            DetectableCause(detection.cause, detection.unit, detection.check, detection.found, detection.curve.at_95)
            for detection in power.detections
            if detection.check != WHOLE_FILE
        ),
    )


def write_detection_power(detection_power: DetectionPower, target: Path = PUBLISHED) -> None:
    """Write the table, entirely or not at all; one line a check and cause, so that a change can be read."""
    values = _ADAPTER.dump_python(detection_power)
    lines = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in values.pop("found"))
    head = json.dumps(values, indent=1, allow_nan=False).removesuffix("\n}")
    write_text(target, f'{head},\n "found": [\n{lines}\n ]\n}}\n')


def read_detection_power(source: Path = PUBLISHED) -> DetectionPower | None:
    """Read the table; None where none has been published. Raises ``MisuseError`` where the file is damaged."""
    return read_published(source, _ADAPTER, "a table of detection power", "run `make power`")


def write_confidence(power: Power, target: Path) -> None:
    """Write how many diagnoses of each status and cause are right, entirely or not at all; one line a row."""
    rows = [(row.status, row.cause, row.right.count, row.right.of) for row in power.statuses]
    write_text(target, "[\n" + ",\n".join(f"  {json.dumps(row)}" for row in rows) + "\n]\n")
