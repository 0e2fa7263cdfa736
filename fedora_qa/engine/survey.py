"""What is known of a file before its windows are measured: enough for any process to measure any of them."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Final
from uuid import uuid4

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.measure import Accumulator
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.outcomes import unreadable_record, unrecognised_record, why_not_applicable
from fedora_qa.engine.plan import Plan, cut_windows, make_plan, sees_every_window, window_length_ns
from fedora_qa.engine.progress import Progress, Stopwatch
from fedora_qa.errors import FedoraError, StorageError, UnreadableFileError
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import OpeningFacts, SequenceRows, open_sequence
from fedora_qa.sequence.sequence import Sequence as FileSequence
from fedora_qa.sequence.window import Span
from fedora_qa.statistics.collector import StatisticsCollector
from fedora_qa.storage.digest import Digest, file_digest
from fedora_qa.storage.folder import Version
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.server import NO_TRAFFIC, Traffic
from fedora_qa.views.storage_steps import stored_steps

_EXPECTED_BYTES_PER_PIXEL: Final = 130
"""Bytes that a process holds beside leased arrays, for each pixel of a frame: states of checks, temporary arrays of one
check, views of a window. With it two processes take 1.49 to 1.60 GB of 1.4 GB, and 1.10 GB of 1 GB, for 8 s of
1440x1080; with 90, 1.57 and 1.25 GB; with 150, 1.45 and 1.05 GB, but they decode a fifth more, and twice as much."""

_LEAST_LEASED_SHARE: Final = 0.25
"""Share of the memory that leased arrays may always fill."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A sequence ready to be measured: its windows, and the decoder of the rows that they lease.

    Attributes
    ----------
    frame_pixels
        Of the largest images; None without any.
    """

    scanned: Scan
    spans: tuple[Span, ...]
    decoder: BlockDecoder
    frame_pixels: int | None

    @property
    def facts(self) -> Facts:
        """What the scan of the timestamps gave."""
        return self.scanned.facts


def prepare(sequence: SequenceRows, memory_bytes: int, streams: Collection[str] | None = None) -> Prepared:
    """Scan the timestamps of an open sequence, or of a view of one, infer how values are stored, and cut its windows.

    ``streams`` are those whose values are looked at; None: all.
    """
    scanned = scan(sequence, window_length_ns(sequence))
    facts = scanned.facts
    wanted = [
        stream for stream in facts.streams if streams is None or not {stream, stream.split("/")[0]}.isdisjoint(streams)
    ]
    scanned = replace(scanned, facts=replace(facts, steps=stored_steps(sequence, facts, wanted)))
    return ready_to_measure(sequence, scanned, memory_bytes)


def ready_to_measure(sequence: SequenceRows, scanned: Scan, memory_bytes: int) -> Prepared:
    """Cut the windows of an open sequence whose timestamps have been scanned."""
    pixels = frame_pixels(sequence.layout)
    beside = _EXPECTED_BYTES_PER_PIXEL * (pixels or 0)
    leased = max(memory_bytes - beside, int(_LEAST_LEASED_SHARE * memory_bytes))
    return Prepared(scanned, cut_windows(scanned), BlockDecoder(sequence, scanned, leased), pixels)


def frame_pixels(layout: Layout) -> int | None:
    """Return the pixels of the largest images of a file; None without any."""
    shapes = [binding.shape for key, binding in layout.bindings.items() if spec_of(key).is_image]
    # Axes of images: row of the dataset, height, width and, of colour images, channels.
    return max((height * width for _, height, width, *_ in shapes), default=None)


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
    view
        Makes the view of the sequence that is measured, such as one with a fault undone; None: the file as it is.
    token
        By it a process recognises the file that it keeps open.
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
    view: Callable[[SequenceRows], SequenceRows] | None = None
    token: str = field(default_factory=lambda: uuid4().hex)

    @property
    def asked(self) -> tuple[Check[Any], ...]:
        """The checks whose question can be asked."""
        return tuple(check for check in self.checks if not self.reasons[check.name])

    @property
    def windows(self) -> tuple[int, ...]:
        """The windows that at least one check gets: those of the plan, or all where some check gets every window."""
        some_get_all = any(sees_every_window(check.needs) for check in self.asked)
        return tuple(range(self.plan.of)) if some_get_all else self.plan.chosen


def survey_of(
    path: Place,
    checks: tuple[Check[Any], ...],
    options: CheckOptions,
    progress: Progress,
    view: Callable[[SequenceRows], SequenceRows] | None = None,
) -> Survey | FileRun:
    """Scan the timestamps of a file and plan its windows; the whole run of a file that is refused or not recognised.

    Raises
    ------
    MisuseError
        There is no such file, or it is not HDF5.
    """
    watch = Stopwatch()
    try:
        with watch.stage("open"):
            sequence = open_sequence(path, options.dialect, allow_external=options.allow_external)
    except UnreadableFileError as error:
        digest = file_digest(path)
        record = unreadable_record(path, digest, checks, str(error))
        return FileRun(record, seconds=watch.seconds, traffic=digest.traffic)
    with sequence:
        with watch.stage("digest"):
            digest = file_digest(path)
        if not sequence.layout.is_recognised:
            record = unrecognised_record(path, digest, checks)
            return FileRun(record, seconds=watch.seconds, traffic=sequence.traffic + digest.traffic)
        with watch.stage("stamps"):
            progress("reading stamps", 0, 1)
            # Where checks are selected, no values of other streams are decoded.
            streams = frozenset(stream for check in checks for stream in (*check.needs, *check.looks_at))
            needed = streams if options.select else None
            ready = prepare(view(sequence) if view else sequence, options.memory_bytes, needed)
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
        view=view,
    )


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
    evidence: EvidenceCollector | None
    distributions: DistributionsCollector | None

    @property
    def accumulators(self) -> tuple[Accumulator, ...]:
        """The checks, and the collectors beside them."""
        beside = (self.statistics, self.evidence, self.distributions)
        return (*self.asked, *(collector for collector in beside if collector is not None))

    @property
    def steady(self) -> tuple[Check[Any], ...]:
        """The checks that get every window, whatever the plan."""
        return tuple(check for check in self.asked if sees_every_window(check.needs))

    def audience(self, span: Span) -> Sequence[Accumulator]:
        """Return the receivers of a window: all accumulators if it is planned, else checks that get every window."""
        return self.accumulators if span.index in self.planned else self.steady


@contextmanager
def opened(survey: Survey) -> Iterator[OpenSurvey]:
    """Open a surveyed file again, in whichever process.

    Raises
    ------
    FedoraError
        The file was changed since its survey or while it is open, or a file behind a URL cannot be read.
    """
    options = survey.options
    # With the facts of the first opening: every process uses the same layout and origin of time.
    with open_sequence(survey.path, options.dialect, survey.opening_facts, options.allow_external) as sequence:
        require_same(survey, sequence.version)
        rows = survey.view(sequence) if survey.view else sequence
        yield open_survey_of(survey, sequence, ready_to_measure(rows, survey.scanned, options.memory_bytes))
        # Once more at the end: rows of two versions of a file must not give one record.
        sequence.require_unchanged()


def open_survey_of(survey: Survey, sequence: FileSequence, ready: Prepared) -> OpenSurvey:
    """Return an open file with the checks and collectors that get its windows by the plan of a survey."""
    options, asked = survey.options, survey.asked
    chosen = tuple(ready.spans[number] for number in survey.plan.chosen)
    # Streams of the checks: where checks are selected, no others are decoded for statistics.
    needed = frozenset(stream for check in asked for stream in check.needs) if options.select else None
    return OpenSurvey(
        sequence=sequence,
        ready=ready,
        windows=tuple(ready.spans[number] for number in survey.windows),
        chosen=chosen,
        planned=frozenset(survey.plan.chosen),
        asked=asked,
        statistics=StatisticsCollector(needed),
        evidence=EvidenceCollector(ready.spans, chosen, options.evidence, needed) if options.evidence else None,
        distributions=DistributionsCollector(ready.spans, needed) if options.evidence else None,
    )


def require_same(survey: Survey, version: Version) -> None:
    """Raise ``FedoraError`` where a file is of another version than when it was surveyed."""
    if version != survey.version:
        raise (StorageError if isinstance(survey.path, RemoteFile) else FedoraError)(
            f"Expected {survey.path} to stay as it is while it is checked, got a change; check it again"
        )
