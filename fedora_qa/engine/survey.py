"""What is known of a file before its windows are measured: enough for any process to measure any of them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any, Final

from fedora_qa.causes import CAUSES
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.digest import Digest, file_digest
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.outcomes import not_applicable, why_not_applicable
from fedora_qa.engine.plan import Plan, make_plan, sees_every_window
from fedora_qa.engine.prepare import Prepared, prepare, ready_to_measure
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import Accumulator
from fedora_qa.errors import FedoraError, StorageError, UnreadableFileError
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.record.types import Coverage, Diagnosis, FileRecord, Finding, Where
from fedora_qa.sequence.scan import Scan
from fedora_qa.sequence.sequence import OpeningFacts, open_sequence
from fedora_qa.sequence.sequence import Sequence as FileSequence
from fedora_qa.sequence.window import Span
from fedora_qa.statistics.collector import StatisticsCollector
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic
from fedora_qa.storage.version import Version

_READING_CHECK: Final = "integrity.readable"
"""The check that fails on a file which cannot be opened."""


@dataclass(frozen=True, slots=True)
class Survey:
    """A file whose timestamps have been scanned. It holds no open file and no image, so that it can be pickled.

    Attributes
    ----------
    version
        The file must have the same version whenever it is opened later.
    opening_facts
        Layout, declarations and origin, for later openings.
    checks
        All that were selected.
    reasons
        Why a check's question cannot be asked of this file, by check; empty where it can.
    traffic
        Requests to a server, and bytes from it, for the survey.
    """

    path: Place
    version: Version
    digest: Digest
    opening_facts: OpeningFacts
    scanned: Scan
    plan: Plan
    checks: tuple[Check[Any], ...]
    reasons: Mapping[str, str]
    options: CheckOptions
    seconds: Mapping[str, float]
    traffic: Traffic = NO_TRAFFIC

    @property
    def asked(self) -> tuple[Check[Any], ...]:
        """The checks whose question can be asked."""
        return tuple(check for check in self.checks if not self.reasons[check.name])

    @property
    def windows(self) -> tuple[int, ...]:
        """The windows that at least one check gets: those of the plan, or all where some check gets every window."""
        some_see_all = any(sees_every_window(check.needs) for check in self.asked)
        return tuple(range(self.plan.of)) if some_see_all else self.plan.chosen


@dataclass(frozen=True, slots=True)
class OpenSurvey:
    """A surveyed file, open in this process, and the checks and collectors that get its windows.

    ``windows`` are those that at least one check gets, ``chosen`` those of the plan, whose numbers are ``planned``.
    """

    sequence: FileSequence
    ready: Prepared
    windows: tuple[Span, ...]
    chosen: tuple[Span, ...]
    planned: frozenset[int]
    asked: tuple[Check[Any], ...]
    statistics: StatisticsCollector
    keeper: EvidenceCollector | None
    distributions: DistributionsCollector | None

    @property
    def accumulators(self) -> tuple[Accumulator, ...]:
        """The checks, and the collectors beside them."""
        beside = (self.statistics, self.keeper, self.distributions)
        return (*self.asked, *(collector for collector in beside if collector is not None))

    def audience(self, span: Span) -> Sequence[Accumulator]:
        """Return the receivers of a window: all accumulators if it is planned, else checks that get every window."""
        if span.index in self.planned:
            return self.accumulators
        return tuple(check for check in self.asked if sees_every_window(check.needs))


def survey_file(
    path: Place,
    checks: tuple[Check[Any], ...],
    options: CheckOptions,
    progress: Progress,
    opening: AbstractContextManager[None] | None = None,
) -> Survey | FileRun:
    """Scan the timestamps of a file and plan its windows; the file's whole run where HDF5 refuses to open it.

    ``opening`` is entered while the file is opened, for a limit of the time that this takes.

    Raises
    ------
    MisuseError
        There is no such file, or it is not HDF5.
    """
    watch = Stopwatch()
    try:
        with opening or nullcontext(), watch.stage("open"):
            sequence = open_sequence(path, options.dialect, allow_external=options.allow_external)
    except UnreadableFileError as error:
        digest = file_digest(path)
        record = unreadable_record(path, digest, checks, str(error))
        return FileRun(record, seconds=watch.seconds, traffic=digest.traffic)
    with sequence:
        with watch.stage("digest"):
            digest = file_digest(path)
        with watch.stage("stamps"):
            progress("reading stamps", 0, 1)
            ready = prepare(sequence, options.memory_bytes)
    return Survey(
        path=path,
        version=sequence.version,
        digest=digest,
        opening_facts=sequence.opening_facts,
        scanned=ready.scanned,
        plan=make_plan(options.effort, len(ready.spans), ready.scanned.cell_ns, ready.frame_pixels),
        checks=checks,
        reasons={check.name: why_not_applicable(check, ready.facts) for check in checks},
        options=options,
        seconds=watch.seconds,
        traffic=sequence.traffic + digest.traffic,
    )


def unreadable_record(path: Place, digest: Digest, checks: Iterable[Check[Any]], reason: str) -> FileRecord:
    """Return the record of a file that begins like HDF5 and cannot be opened: a failed integrity, and nothing else.

    Parameters
    ----------
    path
        The file.
    digest
        Of its bytes.
    checks
        All that were selected; those other than ``integrity.readable`` are not applicable.
    reason
        The message of HDF5.
    """
    finding = Finding("F1", "integrity.readable.file", "critical", reason, Where())
    # HDF5 compares the stated length of a file with its actual one, and names it truncated; other errors are damage.
    cause = "truncated" if "truncated" in reason else "corrupt_chunk"
    diagnosis = Diagnosis(
        id="D1",
        cause=cause,
        stream="file",
        magnitude=None,
        unit="",
        standard_error=None,
        confidence=1.0 if cause == "truncated" else 0.5,
        where=Where(),
        remedy=CAUSES[cause].remedy,
        explains=("F1",),
    )
    results = []
    for check in checks:
        result = not_applicable(check, "the file cannot be opened")
        if check.name == _READING_CHECK:
            result = replace(result, outcome="failed", reason="", findings=(finding,), coverage=Coverage(0, 1, "files"))
        results.append(result)
    return FileRecord(
        path=str(path),
        size=digest.version.size,
        sha256=digest.sha256,
        digest_kind=digest.kind,
        dialect="",
        inferred={},
        statistics={},
        verdict="findings",
        results=tuple(results),
        diagnoses=(diagnosis,),
    )


@contextmanager
def opened(survey: Survey) -> Iterator[OpenSurvey]:
    """Open a surveyed file again, in whichever process.

    Raises
    ------
    FedoraError
        The file was changed since its survey or while it is open, or a file behind a URL cannot be read.
    """
    path, options, asked = survey.path, survey.options, survey.asked
    # With the facts of the first opening: every process uses the same layout and origin of time.
    with open_sequence(path, options.dialect, survey.opening_facts, options.allow_external) as sequence:
        require_same(survey, sequence.version)
        ready = ready_to_measure(sequence, survey.scanned, options.memory_bytes)
        chosen = tuple(ready.spans[number] for number in survey.plan.chosen)
        # Streams of the checks: where checks are selected, no others are decoded for statistics.
        needed = frozenset(stream for check in asked for stream in check.needs) if options.select else None
        yield OpenSurvey(
            sequence=sequence,
            ready=ready,
            windows=tuple(ready.spans[number] for number in survey.windows),
            chosen=chosen,
            planned=frozenset(survey.plan.chosen),
            asked=asked,
            statistics=StatisticsCollector(needed),
            keeper=EvidenceCollector(ready.spans, chosen, options.evidence, needed) if options.evidence else None,
            distributions=DistributionsCollector(ready.spans, needed) if options.evidence else None,
        )
        # Once more at the end: rows of two versions of a file must not give one record.
        sequence.require_unchanged()


def require_same(survey: Survey, version: Version) -> None:
    """Raise ``FedoraError`` where a file is of another version than when it was surveyed."""
    if version != survey.version:
        raise (StorageError if isinstance(survey.path, RemoteFile) else FedoraError)(
            f"Expected {survey.path} to stay as it is while it is checked, got a change; check it again"
        )
