"""The page of a report as values: the template shows them and computes nothing."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from fedora_qa.record.evidence import (
    AGREEMENT,
    DISTRIBUTIONS,
    HISTOGRAMS,
    MOMENTS,
    PLACES,
    TIMELINE,
    TRAJECTORY,
    TRIALS,
)
from fedora_qa.record.types import Record, Verdict
from fedora_qa.record.wording import cause_sentence, findings_of, identity, tally
from fedora_reports.agreement import Agreement, agreement_of
from fedora_reports.anchors import Anchors
from fedora_reports.charts import Chart, distributions_of
from fedora_reports.detection_power import NOTHING_KNOWN, DetectionPowerRow, PassDetectionPower, detection_power_rows
from fedora_reports.evidence import evidence_of
from fedora_reports.flight import Flight, flight_of
from fedora_reports.maps import Exhibits, exhibits
from fedora_reports.problems import Link, Problems, problems_of
from fedora_reports.provenance import Provenance, file_provenance, run_provenance
from fedora_reports.statistics import Table, all_statistics, paper_tables, short_name
from fedora_reports.strip import Strip, pictures_of
from fedora_reports.subjects import Subject, subjects_of
from fedora_reports.timeline import AnchoredFinding, Timeline, timeline_of
from fedora_reports.verdict import TITLES, VerdictText, verdict_of

_KEPT_BY_THE_PASS = (MOMENTS, PLACES, TRIALS, AGREEMENT, TRAJECTORY, TIMELINE, HISTOGRAMS, DISTRIBUTIONS)


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
    flight: Flight | None
    subjects: tuple[Subject, ...]
    paper: tuple[Table, ...]
    statistics: tuple[Table, ...]
    distributions: tuple[Chart, ...]
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


@dataclass(frozen=True, slots=True)
class Page:
    """The whole report."""

    title: str
    started: str
    tool: str
    effort: str
    profile: str
    overview: tuple[OverviewRow, ...]
    overview_tables: tuple[Table, ...]
    files: tuple[FileSection, ...]
    run: Provenance
    detection_power_source: str


def page_of(
    record: Record, arrays: Mapping[str, NDArray[Any]], detection_power: PassDetectionPower = NOTHING_KNOWN
) -> Page:
    """Return the page of a record.

    Parameters
    ----------
    record
        The results of one or several files.
    arrays
        The evidence by name. With several files each name begins with the file's index: ``0/name``.
    detection_power
        The faults that each check detects, where that was measured.
    """
    if len(record.files) == 1:
        title = short_name(record.files[0], record.files)
    else:
        title = f"{len(record.files)} files" if record.files else "No file was checked"
    overview = []
    if len(record.files) != 1:
        for k, file in enumerate(record.files):
            link = Link(Anchors(k).top, short_name(file, record.files))
            cause = cause_sentence(file.diagnoses[0]) if file.diagnoses else ""
            overview.append(OverviewRow(link, file.verdict, TITLES[file.verdict], tally(file.results), cause))
    return Page(
        title=title,
        started=record.run.started,
        tool=f"{record.tool.name} {record.tool.version}",
        effort=record.effort,
        profile=record.profile,
        overview=tuple(overview),
        overview_tables=paper_tables(record.files) if len(record.files) != 1 else (),
        files=tuple(_section(record, k, arrays, detection_power) for k in range(len(record.files))),
        run=run_provenance(record),
        detection_power_source=detection_power.source,
    )


def _section(
    record: Record, place: int, arrays: Mapping[str, NDArray[Any]], detection_power: PassDetectionPower
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

    return FileSection(
        anchors=anchors,
        name=short_name(file, record.files),
        path=file.path,
        identity=identity(file),
        verdict=verdict_of(file),
        problems=problems_of(file, evidence, pictures, anchors),
        agreement=agreement_of(evidence),
        timeline=timeline_of(evidence, findings, snapshots),
        strip=pictures.strip,
        flight=flight_of(evidence, findings),
        subjects=subjects_of(file, evidence, anchors, links, detection_power),
        paper=paper_tables((file,)),
        statistics=all_statistics(file),
        distributions=distributions_of(evidence),
        detection_power=detection_power_rows(
            detection_power, file.results, [anchors.check(k) for k in range(len(file.results))]
        ),
        exhibits=exhibits(evidence, others),
        provenance=file_provenance(file, evidence),
        missing=missing,
    )
