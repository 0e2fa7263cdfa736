"""The page of a report as values, with verdict, provenance and agreement of streams."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, Final

from numpy.typing import NDArray

from fedora_qa.record.evidence import (
    AGREEMENT,
    DISTRIBUTIONS,
    EVENT_CLOUDS,
    FRUSTA,
    HISTOGRAMS,
    MOMENTS,
    PLACES,
    POINT_CLOUD,
    TIMELINE,
    TRAJECTORY,
    TRIALS,
)
from fedora_qa.record.types import FileRecord, Outcome, Record, Scalar, Verdict, gravest_verdict, names_in_release
from fedora_qa.record.wording import (
    OUTCOME_WORDS,
    basis_of_clean,
    canaries_seen,
    capitalised,
    cause_sentence,
    findings_of,
    identity,
    immaterial_count,
    number,
    tally,
    why_incomplete,
)
from fedora_reports.anchors import Anchors
from fedora_reports.charts import Chart, distributions_of
from fedora_reports.clouds import EventCloud, event_clouds_of
from fedora_reports.detection_power import (
    NOTHING_KNOWN,
    DetectionPowerRow,
    PassDetectionPower,
    PassLimits,
    detection_power_rows,
    pass_limits_of,
)
from fedora_reports.evidence import Evidence, evidence_of
from fedora_reports.flight import Flight, flight_of
from fedora_reports.maps import Exhibits, exhibits
from fedora_reports.problems import Link, Problems, problems_of
from fedora_reports.statistics import Table, all_statistics, paper_tables
from fedora_reports.strip import Strip, pictures_of
from fedora_reports.subjects import Subject, subjects_of
from fedora_reports.timeline import AnchoredFinding, Sparkline, Timeline, sparkline_of, timeline_of

TITLES: Final[dict[Verdict, str]] = {"clean": "Passed", "findings": "Failed", "incomplete": "Incomplete"}


@dataclass(frozen=True, slots=True)
class Share:
    """The checks with one outcome: their number, and their place on a bar of all checks, as shares of it."""

    outcome: Outcome
    word: str
    count: int
    left: float
    width: float


@dataclass(frozen=True, slots=True)
class VerdictText:
    """The verdict, a sentence with its reason, and a sentence on the checks that it rests on."""

    verdict: Verdict
    title: str
    sentence: str
    basis: str
    shares: tuple[Share, ...]


def verdict_of(file: FileRecord) -> VerdictText:
    """Return the verdict of a file in words."""
    outcomes = Counter(result.outcome for result in file.results)
    failed = outcomes["failed"]
    if file.verdict == "incomplete":
        more = f" {checks(failed).capitalize()} failed." if failed else ""
        sentence = f"No verdict can be given: {why_incomplete(file)}.{more}"
    elif file.verdict == "findings":
        causes = len(file.diagnoses)
        named = {0: "no cause could be named", 1: "one probable cause is named"}.get(
            causes, f"{causes} probable causes are named"
        )
        sentence = f"{checks(failed).capitalize()} failed; {named}."
    elif deviations := immaterial_count(file.results):
        are = "1 is" if deviations == 1 else f"{deviations} are"
        sentence = f"No check found a deviation that matters; {are} measurable and not material."
    else:
        sentence = "No check found a deviation from a correct file."
    rests_on = basis_of_clean(file).removeprefix("clean: ")
    if rests_on:
        sentence = f"{sentence} The verdict {rests_on}."

    conclusive = [result for result in file.results if result.outcome in {"passed", "failed", "warned"}]
    if conclusive:
        complete = sum(
            result.coverage.seen >= result.coverage.of for result in conclusive if result.coverage is not None
        )
        extent = "all of them" if complete == len(conclusive) else f"{complete} of them"
        measured = sum(len(result.measurements) for result in conclusive)
        basis = (
            f"It rests on {checks(len(conclusive))} with {measured} measurements; {extent} covered all of their data."
        )
    else:
        basis = f"None of {checks(len(file.results))} came to a verdict." if file.results else "No check was run."
    canaries = canaries_seen(file)
    if canaries:
        basis = f"{basis} {capitalised(canaries)}."

    present = [outcome for outcome in OUTCOME_WORDS if outcomes[outcome]]
    widths = [outcomes[outcome] / len(file.results) for outcome in present]
    shares = tuple(
        Share(outcome, OUTCOME_WORDS[outcome], outcomes[outcome], left, width)
        for outcome, left, width in zip(present, accumulate(widths, initial=0.0), widths, strict=False)
    )
    return VerdictText(file.verdict, TITLES[file.verdict], sentence, basis, shares)


def checks(count: int) -> str:
    """Return ``1 check``, ``2 checks``."""
    return f"{count} check" if count == 1 else f"{count} checks"


@dataclass(frozen=True, slots=True)
class Provenance:
    """Facts as pairs of name and value, and tables."""

    facts: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]


def file_provenance(file: FileRecord, evidence: Evidence) -> Provenance:
    """Return the identity of a file, what was inferred about it, and the arrays that were kept of it."""
    digest = f"{file.sha256}{' (of parts of the file)' if file.digest_kind == 'partial' else ''}"
    facts = [
        ("Path", file.path),
        ("Size", f"{file.size / 1e6:.1f} MB"),
        ("SHA-256", digest),
        ("Dialect", file.dialect or "not recognised"),
        *((f"Inferred: {name.replace('_', ' ')}", _fact(value)) for name, value in file.inferred.items()),
    ]
    tables, rows, size = [], [], 0
    for name in evidence.names():
        array = evidence.arrays[name]
        shape = " × ".join(map(str, array.shape)) or "one number"
        rows.append((name, evidence.title(name), shape, str(array.dtype), f"{array.nbytes / 1e3:.1f}"))
        size += array.nbytes
    if rows:
        note = f"{size / 1e6:.2f} MB before compression."
        tables.append(Table("Evidence", note, ("array", "title", "shape", "type", "kB"), tuple(rows), numeric=False))
    if evidence.missing:
        missing = tuple((name, evidence.title(name)) for name in evidence.missing)
        tables.append(Table("Evidence that is missing", "", ("array", "title"), missing, numeric=False))
    return Provenance(tuple(facts), tuple(tables))


def run_provenance(record: Record) -> Provenance:
    """Return the tool and the configuration of a run, its machine, and the time that it took."""
    facts = [
        ("Made by", f"{record.tool.name} {record.tool.version}, ruleset {record.ruleset_version}"),
        ("Started", record.run.started),
        ("Effort", record.effort or "not stated"),
        ("Profile", record.profile),
        ("Configuration", record.config_digest),
        ("Record version", record.record_version),
    ]
    stages, checks = record.run.stage_seconds, record.run.check_seconds
    slowest = dict(sorted(checks.items(), key=lambda item: -item[1]))
    host = tuple((name.replace("_", " "), _fact(value)) for name, value in record.run.host.items())
    tables = (
        _seconds("Seconds by stage", stages),
        _seconds("Seconds by check", slowest),
        Table("Machine", "", ("fact", "value"), host),
    )
    return Provenance(tuple(facts), tuple(table for table in tables if table.rows))


def _seconds(title: str, spent: Mapping[str, float]) -> Table:
    return Table(title, "", ("part", "seconds"), tuple((name, f"{value:.3f}") for name, value in spent.items()))


def _fact(value: Scalar) -> str:
    return number(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True, slots=True)
class AgreementCell:
    """The checks that compare two streams; none of them failed where the streams agree."""

    passed: int
    failed: int


@dataclass(frozen=True, slots=True)
class Agreement:
    """Streams, and for each of them a row with a cell for each stream; None on the diagonal and where no check is."""

    streams: tuple[str, ...]
    rows: tuple[tuple[AgreementCell | None, ...], ...]


def agreement_of(evidence: Evidence) -> Agreement | None:
    """Return the table of a file; None where no pair of streams was kept."""
    cells: dict[frozenset[str], AgreementCell] = {}
    for name in evidence.under(AGREEMENT):
        counts = evidence.numbers(name, 2)
        pair = name.split("/")[1:]
        if counts is not None and len(pair) == 2:
            cells[frozenset(pair)] = AgreementCell(int(counts[0]), int(counts[1]))
    streams = tuple(sorted({stream for pair in cells for stream in pair}))
    rows = tuple(tuple(cells.get(frozenset((row, column))) for column in streams) for row in streams)
    return Agreement(streams, rows) if streams else None


NO_PRICES: Final[Mapping[str, str]] = MappingProxyType({})
"""Where no price of a fault was measured."""

_KEPT_BY_THE_PASS = (
    MOMENTS,
    PLACES,
    TRIALS,
    AGREEMENT,
    EVENT_CLOUDS,
    FRUSTA,
    POINT_CLOUD,
    TRAJECTORY,
    TIMELINE,
    HISTOGRAMS,
    DISTRIBUTIONS,
)

_LEAK: Final = "release.splits.leak"
"""The rule by which two splits share data."""

_VERDICT_WORDS: Final[Mapping[Verdict, str]] = {
    "incomplete": "incomplete",
    "findings": "with findings",
    "clean": "clean",
}
"""Verdicts of sequences in words, the gravest first."""


@dataclass(frozen=True, slots=True)
class FileSection:
    """All values of one file."""

    anchors: Anchors
    name: str
    path: str
    identity: str
    verdict: VerdictText
    problems: Problems
    agreement: Agreement | None
    timeline: Timeline | None
    strip: Strip | None
    event_clouds: tuple[EventCloud, ...]
    flight: Flight | None
    subjects: tuple[Subject, ...]
    paper: tuple[Table, ...]
    statistics: tuple[Table, ...]
    distributions: tuple[Chart, ...]
    pass_limits: PassLimits | None
    detection_power: tuple[DetectionPowerRow, ...]
    exhibits: Exhibits
    provenance: Provenance
    missing: str


@dataclass(frozen=True, slots=True)
class OverviewRow:
    """One file among several."""

    file: Link
    verdict: Verdict
    word: str
    tally: str
    cause: str
    sparkline: Sparkline | None


@dataclass(frozen=True, slots=True)
class ReleaseVerdict:
    """The verdict of a release: the gravest of its sequences and of its own; and how many have which."""

    name: str
    verdict: Verdict
    title: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Leak:
    """What a sequence shares with one of another split: the finding that states both places."""

    file: Link
    message: str


@dataclass(frozen=True, slots=True)
class Page:
    """The whole report; ``release`` is None where no gate judged one."""

    title: str
    started: str
    tool: str
    effort: str
    profile: str
    release: ReleaseVerdict | None
    overview: tuple[OverviewRow, ...]
    leaks: tuple[Leak, ...]
    overview_tables: tuple[Table, ...]
    files: tuple[FileSection, ...]
    run: Provenance
    detection_power_source: str


def page_of(
    record: Record,
    arrays: Mapping[str, NDArray[Any]],
    detection_power: PassDetectionPower = NOTHING_KNOWN,
    fault_prices: Mapping[str, str] = NO_PRICES,
) -> Page:
    """Return the page of a record.

    Parameters
    ----------
    arrays
        The evidence by name. With several files each name begins with the file's index: ``0/name``.
    detection_power
        The faults that each check detects, where that was measured.
    fault_prices
        What the faults that a check measures cost a learner, by check, where that was measured.
    """
    names = names_of(record)
    release = release_of(record)
    if release:
        title = f"Release {release.name}"
    elif len(record.files) == 1:
        title = names[0]
    else:
        title = f"{len(record.files)} files" if record.files else "No file was checked"
    sections = tuple(_section(record, k, name, arrays, detection_power, fault_prices) for k, name in enumerate(names))
    overview, leaks = list[OverviewRow](), list[Leak]()
    if len(record.files) != 1:
        for file, section in zip(record.files, sections, strict=True):
            link = Link(section.anchors.top, section.name)
            line = sparkline_of(section.timeline) if section.timeline else None
            words = TITLES[file.verdict], tally(file.results), _first_cause(file)
            overview.append(OverviewRow(link, file.verdict, *words, line))
            leaks += [
                Leak(Link(section.anchors.finding(place), section.name), finding.message)
                for place, (_, finding) in enumerate(findings_of(file))
                if finding.code == _LEAK
            ]
    return Page(
        title=title,
        started=record.run.started,
        tool=f"{record.tool.name} {record.tool.version}",
        effort=record.effort,
        profile=record.profile,
        release=release,
        overview=tuple(overview),
        leaks=tuple(leaks),
        overview_tables=paper_tables(record.files, names) if len(record.files) != 1 else (),
        files=sections,
        run=run_provenance(record),
        detection_power_source=detection_power.source,
    )


def names_of(record: Record) -> tuple[str, ...]:
    """Return a name for each file: in a release with its folders, else the shortest that no other file has."""
    in_release = names_in_release(record)
    if in_release:
        return (*in_release[:-1], "the release itself")
    shortest = [PurePath(file.path).name or file.path for file in record.files]
    return tuple(
        name if shortest.count(name) == 1 else file.path for name, file in zip(shortest, record.files, strict=True)
    )


def release_of(record: Record) -> ReleaseVerdict | None:
    """Return the verdict of the release that a gate judged; None where the record is of no gate."""
    if not names_in_release(record):
        return None
    *sequences, release = record.files
    counts = Counter(file.verdict for file in sequences)
    parts = [f"{counts[verdict]} {word}" for verdict, word in _VERDICT_WORDS.items() if counts[verdict]]
    noun = "sequence" if len(sequences) == 1 else "sequences"
    sentence = f"{len(sequences)} {noun}: {', '.join(parts)}. The release itself: {tally(release.results)}."
    verdict = gravest_verdict(record.files)
    return ReleaseVerdict(PurePath(release.path).name or release.path, verdict, TITLES[verdict], sentence)


def _first_cause(file: FileRecord) -> str:
    """Return the most probable cause, else why the verdict is incomplete, else what the first failed check found."""
    if file.diagnoses:
        return cause_sentence(file.diagnoses[0])
    failed = (finding.message for result, finding in findings_of(file) if result.outcome == "failed")
    return why_incomplete(file) or next(failed, "")


def _section(
    record: Record,
    place: int,
    name: str,
    arrays: Mapping[str, NDArray[Any]],
    detection_power: PassDetectionPower,
    fault_prices: Mapping[str, str],
) -> FileSection:
    file, anchors, evidence = record.files[place], Anchors(place), evidence_of(record, place, arrays)
    # A finding has a mark at each of its places.
    findings = [
        AnchoredFinding(replace(finding, where=where), anchors.finding(k), is_further=rank > 0)
        for k, (_, finding) in enumerate(findings_of(file))
        for rank, where in enumerate(finding.all_places)
    ]
    links = [Link(located.anchor, located.finding.id) for located in findings]
    diagnoses = (diagnosis.id for diagnosis in file.diagnoses)
    pictures = pictures_of(evidence, (located.finding.id for located in findings), anchors, diagnoses)
    snapshots = pictures.strip.rows if pictures.strip else ()

    # Arrays that belong neither to the pass nor to a check of this file are drawn by themselves.
    groups = tuple(f"{group}/" for group in (*_KEPT_BY_THE_PASS, *(result.check for result in file.results)))
    others = tuple(name for name in evidence.names() if not name.startswith(groups))

    missing = ""
    if not evidence.titles and not evidence.names():
        missing = "No evidence was kept of this file: there are no pictures, timeline or histograms."
    elif evidence.missing and len(evidence.missing) == len(evidence.titles):
        missing = "The arrays that lay beside the record were not given: there are no pictures, timeline or histograms."
    elif evidence.missing:
        missing = f"{len(evidence.missing)} arrays that lay beside the record are missing; what needs them is left out."

    check_anchors = [anchors.check(k) for k in range(len(file.results))]
    return FileSection(
        anchors=anchors,
        name=name,
        path=file.path,
        identity=identity(file),
        verdict=verdict_of(file),
        problems=problems_of(file, evidence, pictures, anchors),
        agreement=agreement_of(evidence),
        timeline=timeline_of(evidence, findings, snapshots),
        strip=pictures.strip,
        event_clouds=event_clouds_of(evidence),
        flight=flight_of(evidence, findings),
        subjects=subjects_of(file, evidence, anchors, links, detection_power, fault_prices),
        paper=paper_tables((file,), (name,)),
        statistics=all_statistics(file),
        distributions=distributions_of(evidence),
        pass_limits=pass_limits_of(file.results, check_anchors),
        detection_power=detection_power_rows(detection_power, file.results, check_anchors),
        exhibits=exhibits(evidence, others),
        provenance=file_provenance(file, evidence),
        missing=missing,
    )
