"""The document of a comparison. Programs rely on the names of fields: they never change within a version.

*Before* is the first subject, the reference, and *after* the subject that is compared with it. Unknown values are None.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import Outcome, Scalar, Severity, Tool

COMPARISON_VERSION: Final = "1.0"

Design = Literal["versions", "sequences", "datasets"]
Conclusion = Literal["differs", "no_difference_seen", "identical", "not_told"]
Moved = Literal["moved", "within_error", "changed"]
Change = Literal["new", "gone", "changed"]


@dataclass(frozen=True, slots=True)
class ComparedFile:
    """One file: its name among those it was given with, and its statistics; ``verdict`` is None where not checked."""

    name: str
    path: str
    statistics: Mapping[str, Mapping[str, Scalar]]
    verdict: str | None


@dataclass(frozen=True, slots=True)
class Subject:
    """The files that one argument named: a file, a folder of files, or a record of some."""

    name: str
    files: tuple[ComparedFile, ...]


@dataclass(frozen=True, slots=True)
class Overlay:
    """The distribution of one quantity in every subject: shares (n) in the bins of ``edges`` (n + 1), None if unknown.

    ``meaning`` states what is counted, with its unit.
    """

    quantity: str
    meaning: str
    unit: str
    edges: tuple[float, ...]
    shares: tuple[tuple[float, ...] | None, ...]


@dataclass(frozen=True, slots=True)
class Difference:
    """How far two distributions lie apart.

    ``distance`` is the Wasserstein distance of order 1, in ``unit``. Chance alone exceeds ``distance_by_chance`` once
    in twenty, and gives a distance as large as this with probability ``chance``. ``units`` counts, on each side, the
    units of an exchange: blocks of time, segments or files. ``file`` is empty where whole subjects are compared.
    """

    file: str
    quantity: str
    unit: str
    mean_before: float
    mean_after: float
    shift_standard_error: float | None
    distance: float
    distance_standard_error: float | None
    distance_by_chance: float | None
    chance: float | None
    units: tuple[int, int]
    told: Conclusion
    reason: str = ""


@dataclass(frozen=True, slots=True)
class StatisticChange:
    """A statistic of a file in two versions, named ``group.name``; ``standard_error`` is that of the difference.

    ``changed``: it differs, and no error is known with which the difference could be compared.
    """

    file: str
    statistic: str
    before: float | None
    after: float | None
    standard_error: float | None
    chance: float | None
    moved: Moved


@dataclass(frozen=True, slots=True)
class FindingChange:
    """A finding that is new, gone, or changed: its severity did, or what its check measured moved beyond its limit."""

    file: str
    change: Change
    check: str
    code: str
    stream: str
    severity_before: Severity | None
    severity_after: Severity | None
    message_before: str
    message_after: str


@dataclass(frozen=True, slots=True)
class OutcomeChange:
    """A check that ends otherwise than before; None where only one version has it."""

    file: str
    check: str
    before: Outcome | None
    after: Outcome | None


@dataclass(frozen=True, slots=True)
class MeasurementChange:
    """A measured value that moved by more than ``allowed``, the limit for two correct versions of the file."""

    file: str
    check: str
    name: str
    unit: str
    before: float
    after: float
    allowed: float


@dataclass(frozen=True, slots=True)
class Versions:
    """What changed from one version of files to the other. ``gone`` and ``new`` are names of files.

    ``checked`` counts the files that were checked in both, so that their findings could be compared.
    """

    matched: int
    checked: int
    gone: tuple[str, ...]
    new: tuple[str, ...]
    findings: tuple[FindingChange, ...]
    unchanged_findings: int
    outcomes: tuple[OutcomeChange, ...]
    measurements: tuple[MeasurementChange, ...]
    statistics: tuple[StatisticChange, ...]


@dataclass(frozen=True, slots=True)
class Pair:
    """One subject compared with the reference, the first; both by their place among the subjects."""

    before: int
    after: int
    design: Design
    differences: tuple[Difference, ...]
    versions: Versions | None


@dataclass(frozen=True, slots=True)
class Published:
    """A row of a published table, to be read beside the tables of this comparison; ``values`` are as printed."""

    table: Literal["datasets", "sequences", "flow", "disparity"]
    name: str
    values: Mapping[str, Scalar]
    source: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """The whole document. ``tests`` comparisons share one false-alarm rate: each is made at ``level``."""

    comparison_version: str
    tool: Tool
    false_alarm_rate: float
    tests: int
    level: float
    subjects: tuple[Subject, ...]
    overlays: tuple[Overlay, ...]
    pairs: tuple[Pair, ...]
    published: tuple[Published, ...]
    notes: tuple[str, ...]


COMPARISON: Final = DocumentKind(
    name="comparison",
    noun="a comparison",
    version=COMPARISON_VERSION,
    adapter=TypeAdapter(Comparison),
    written_by="fedora-qa compare --json",
    again="compare again with this version",
)
