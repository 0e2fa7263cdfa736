"""The record's types. Field names are relied on by others and never change within a record version."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Final, Literal

RECORD_VERSION: Final = "1.1"

OLDER_RECORD_VERSIONS: Final = ("1.0",)
"""Versions that are read as well: later ones added fields."""

IMMATERIAL: Final = "immaterial"
"""Rule of the findings of deviations that are significant and not material."""

Outcome = Literal["passed", "failed", "warned", "not_applicable", "not_observable", "crashed"]
Severity = Literal["critical", "error", "warning", "info"]
Verdict = Literal["clean", "findings", "incomplete"]
Side = Literal["both", "upper", "lower"]
CanaryOutcome = Literal["seen", "withheld", "silent", "not_planted"]
DiagnosisStatus = Literal["confirmed", "supported", "suggested", "unidentified"]
Scalar = str | int | float | bool | None

GRAVE: Final[frozenset[Severity]] = frozenset({"critical", "error"})
"""Severities of findings that fail a check."""

CHECK_SECONDS: Final = "check "
"""Prefix of the names of those seconds of a run that belong to one check."""

FOLDER: Final = "."
"""The name of the release itself, beside those of its files."""


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
    """A measured number beside that of a correct file.

    ``limit`` is the largest deviation from ``expected`` that a correct file gives at the file's false-alarm rate;
    ``least_detectable`` the least fault that would have been detected with 95% probability, even where the known error
    of the model works against it. ``side`` states which deviations count: a value below what is expected is no fault
    where only the ``upper`` side does. ``tests`` is the number of comparisons of which the value is the worst.
    ``least_detectable`` is that of the place or time where the value is worst; ``least_detectable_range`` that of the
    most sensitive and of the least sensitive one, where the two differ by a factor of two or more.
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
    material: float = 0.0
    """Excess over ``limit`` from which a deviation fails, by the profile of the record; 0: every excess."""
    code: str = ""
    """Of the finding that a deviation would be; empty in records of version 1.0."""
    least_detectable_range: tuple[float, float] | None = None
    effect_px: float | None = None
    """Change of the flow of the file by one unit, px, of a parameter of the flow; None for other measurements."""

    @property
    def allowed(self) -> float | None:
        """The largest deviation that does not fail, in ``unit``; None where there is no limit."""
        return None if self.limit is None else self.limit + self.material

    @property
    def counted_deviation(self) -> float | None:
        """The size of the deviation, 0 on a side that does not count; None without a value or what is expected."""
        if self.value is None or self.expected is None:
            return None
        deviation = self.value - self.expected
        if self.side == "both":
            return abs(deviation)
        return max(deviation if self.side == "upper" else -deviation, 0.0)

    @property
    def exceeds_limit(self) -> bool:
        """Whether the value exceeds its limit, whatever is material; one that is not finite exceeds every limit."""
        if self.value is None:
            return True
        deviation = self.counted_deviation
        return deviation is not None and self.limit is not None and deviation > self.limit


@dataclass(frozen=True, slots=True)
class Coverage:
    """The measured part of a stream."""

    seen: int
    of: int
    unit: str

    @property
    def share(self) -> float:
        """The measured share, 0 to 1; 1 for a stream without rows."""
        # A stream without rows leaves nothing unmeasured; a share of 0 would fall short of every required coverage.
        return self.seen / self.of if self.of else 1.0


@dataclass(frozen=True, slots=True)
class Waived:
    """Who is responsible for a finding that a policy accepts, why, and until which day (ISO 8601)."""

    owner: str
    reason: str
    until: str


@dataclass(frozen=True, slots=True)
class Finding:
    """A rule that was broken: which, how badly, and where; ``waived`` where a gate's policy accepts it.

    ``where`` is the place of the largest deviation. The same rule may be broken at further ``places``, in other rates
    or parts of the stream, for the same cause.
    """

    id: str
    code: str
    severity: Severity
    message: str
    where: Where
    waived: Waived | None = None
    places: tuple[Where, ...] = ()

    @property
    def all_places(self) -> tuple[Where, ...]:
        """Every place, that of the largest deviation first."""
        return (self.where, *self.places)


@dataclass(frozen=True, slots=True)
class Result:
    """The outcome of one check.

    ``reason`` states why it was not applicable, not observable, warned or crashed, and what a passed check cannot
    detect.
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
    """A probable cause, its fitted size, and the findings that it explains.

    ``status`` states how the cause is known. ``confirmed``: with the fault undone, all that it explains is within its
    limits, nothing else exceeds them, and no other proposal does the same. ``supported``: undoing clears most findings,
    or several causes clear them alike, or a check measures the cause itself, which cannot be undone. ``suggested``: the
    cause fits and was not tested. ``unidentified``: no known cause fits.

    ``tried`` describes the faults that were undone, the first that of the cause; ``cleared`` names the findings that
    are within their limits with it undone, measured again in ``windows`` windows. ``confidence`` is the measured
    frequency, 0 to 1, with which diagnoses of that status and cause are right; 0 where none was measured.

    ``after`` names the diagnoses whose faults were undone before this cause was looked for. Findings that these hide
    are findings of no plain run, so that such a cause may explain none.
    """

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
    status: DiagnosisStatus = "suggested"
    tried: tuple[str, ...] = ()
    cleared: tuple[str, ...] = ()
    windows: int = 0
    after: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Canary:
    """Whether a check detected the fault that was planted for it in memory (``seen``).

    ``fault`` describes the fault; ``windows`` is the number of windows that were measured until it was detected, or of
    all that were measured without. ``reason`` states why none was planted, or why a check that passes the file gave no
    outcome with the fault (``withheld``). A check that passed the fault (``silent``) is ``crashed`` among the results.
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
    comparisons: int | None = None
    """How many checks that compare streams with each other came to an outcome; None where that was not counted."""
    uncompared: tuple[str, ...] = ()
    """Streams that none of these checks compared with another one, in alphabetical order."""


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

    @property
    def stage_seconds(self) -> Mapping[str, float]:
        """Seconds by stage. Those of single checks lie within a stage: they are left out, not to be added again."""
        return {name: spent for name, spent in self.seconds.items() if not name.startswith(CHECK_SECONDS)}

    @property
    def check_seconds(self) -> Mapping[str, float]:
        """Seconds by check."""
        of_checks = {name: spent for name, spent in self.seconds.items() if name.startswith(CHECK_SECONDS)}
        return {name.removeprefix(CHECK_SECONDS): spent for name, spent in of_checks.items()}


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
    profile: str = "strict"
    """Of materiality: ``release``, ``training`` or ``strict``, as records of version 1.0 were."""


def gravest_verdict(files: Iterable[FileRecord]) -> Verdict:
    """Return the gravest verdict of files: incomplete before findings before clean."""
    verdicts = {file.verdict for file in files}
    gravest_first: tuple[Verdict, ...] = ("incomplete", "findings", "clean")
    # Without files nothing was tested: incomplete.
    return next((verdict for verdict in gravest_first if verdict in verdicts), "incomplete")


def names_in_release(record: Record) -> tuple[str, ...]:
    """Return the names of the files of a gate's record, with their folders; empty for any other record.

    The release itself comes last, by the name ``FOLDER``.
    """
    if not record.files or not any(result.check.startswith("release.") for result in record.files[-1].results):
        return ()
    *files, release = record.files
    paths = [PurePath(file.path) for file in files]
    if not all(path.is_relative_to(release.path) for path in paths):
        return ()
    return (*(path.relative_to(release.path).as_posix() for path in paths), FOLDER)
