"""The record's types. Field names are relied on by others and never change within a record version."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

RECORD_VERSION: Final = "1.0"

Outcome = Literal["passed", "failed", "warned", "not_applicable", "not_observable", "crashed"]
Severity = Literal["critical", "error", "warning", "info"]
Verdict = Literal["clean", "findings", "incomplete"]
Side = Literal["both", "upper", "lower"]
CanaryOutcome = Literal["seen", "withheld", "silent", "not_planted"]
Scalar = str | int | float | bool | None


@dataclass(frozen=True, slots=True)
class Where:
    """A place in a file; what does not apply is None. Times are on the file's own clock; ranges are half-open.

    ``frame`` counts the images of the stream named, colour frames where that has none. ``pixel`` (column, row) and
    ``tile`` (left, top, right, bottom) are in the stored pixels of the stream named.
    """

    stream: str | None = None
    start_us: float | None = None
    stop_us: float | None = None
    index_start: int | None = None
    index_stop: int | None = None
    frame: int | None = None
    pixel: tuple[int, int] | None = None
    tile: tuple[int, int, int, int] | None = None


@dataclass(frozen=True, slots=True)
class Measurement:
    """A measured number beside what an honest file gives.

    ``limit`` is the largest deviation from ``expected`` that an honest file gives at the file's false-alarm rate;
    ``least_detectable`` the least fault that would have been seen with 95% probability, even where the known error of
    the model works against it. ``side`` says which deviations count: a value below what is expected is fine where only
    the ``upper`` side does. ``tests`` is the number of comparisons that the value is the worst of.
    """

    name: str
    value: float | None
    unit: str
    standard_error: float | None
    expected: float | None
    limit: float | None
    least_detectable: float | None
    side: Side = "both"
    tests: int = 1


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of a stream was seen."""

    seen: int
    of: int
    unit: str

    @property
    def share(self) -> float:
        """Share that was seen, 0 to 1; nothing to see counts as all seen."""
        # A stream without rows leaves nothing unmeasured; a share of 0 would fall short of every required coverage.
        return self.seen / self.of if self.of else 1.0


@dataclass(frozen=True, slots=True)
class Waived:
    """Who answers for a finding that a policy accepts, why, and until which day (ISO 8601)."""

    owner: str
    reason: str
    until: str


@dataclass(frozen=True, slots=True)
class Finding:
    """A rule that was broken: which, how badly, and where; ``waived`` where a gate's policy accepts it."""

    id: str
    code: str
    severity: Severity
    message: str
    where: Where
    waived: Waived | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """The outcome of one check.

    ``reason`` says why it was not applicable, not observable, warned or crashed, and what a pass could not see.
    """

    check: str
    outcome: Outcome
    question: str
    measurements: tuple[Measurement, ...] = ()
    coverage: Coverage | None = None
    findings: tuple[Finding, ...] = ()
    reason: str = ""
    traceback: str = ""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """A probable cause, its fitted size, and the findings that it explains."""

    id: str
    cause: str
    stream: str
    magnitude: float | None
    unit: str
    standard_error: float | None
    confidence: float
    where: Where
    remedy: str
    explains: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Canary:
    """Whether a check saw the fault that was planted for it in memory.

    ``fault`` says what was planted, ``windows`` how many were looked at until it was seen, or in vain; ``reason`` why
    none was planted, or why a check that passes the file ``withheld`` its answer once the fault was in it. A check that
    stayed ``silent``, and passed the fault, is ``crashed`` among the results.
    """

    check: str
    outcome: CanaryOutcome
    fault: str = ""
    windows: int = 0
    reason: str = ""


@dataclass(frozen=True, slots=True)
class FileRecord:
    """Everything that was found about one file."""

    path: str
    size: int
    sha256: str
    digest_kind: Literal["full", "partial"]
    dialect: str
    inferred: Mapping[str, Scalar]
    statistics: Mapping[str, Mapping[str, Scalar]]
    verdict: Verdict
    results: tuple[Result, ...]
    diagnoses: tuple[Diagnosis, ...] = ()
    evidence: Mapping[str, str] = field(default_factory=dict)
    """Title of each array that lies beside the record, by the array's name."""
    canaries: tuple[Canary, ...] = ()
    """One for each check, where canaries were asked for."""


@dataclass(frozen=True, slots=True)
class Tool:
    """What made the record."""

    name: str
    version: str


@dataclass(frozen=True, slots=True)
class Run:
    """Facts of the run; not part of what makes two records equal."""

    started: str
    seconds: Mapping[str, float]
    host: Mapping[str, Scalar]


@dataclass(frozen=True, slots=True)
class Record:
    """The whole document."""

    record_version: str
    ruleset_version: str
    tool: Tool
    config_digest: str
    run: Run
    files: tuple[FileRecord, ...]
    effort: str = ""
