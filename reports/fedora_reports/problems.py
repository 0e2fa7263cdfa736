"""What is wrong: causes, the findings that they explain, and what is merely unusual."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Diagnosis, FileRecord, Finding, Severity
from fedora_qa.record.wording import cause_sentence, findings_of, place
from fedora_reports.anchors import Anchors
from fedora_reports.strip import Pictures, Place, Row


@dataclass(frozen=True, slots=True)
class Link:
    """A word that leads to another place of the page."""

    anchor: str
    word: str


@dataclass(frozen=True, slots=True)
class FindingView:
    """A finding with the pictures of its worst place; without them, ``nearest`` leads to the moment nearest in time."""

    anchor: str
    id: str
    code: str
    severity: Severity
    message: str
    place: str
    stream: str
    start_us: float | None
    check: Link
    causes: tuple[Link, ...]
    pictures: Place | None
    nearest: Link | None

    @property
    def grave(self) -> bool:
        """Whether it counts against the file."""
        return self.severity in {"critical", "error"}


@dataclass(frozen=True, slots=True)
class Cause:
    """A probable cause in one sentence, with links to the findings that it explains."""

    anchor: str
    id: str
    sentence: str
    name: str
    place: str
    remedy: str
    confidence: str
    explains: tuple[Link, ...]


@dataclass(frozen=True, slots=True)
class Problems:
    """Causes, the most probable first; findings that count against the file; and what is merely unusual."""

    causes: tuple[Cause, ...]
    findings: tuple[FindingView, ...]
    remarks: tuple[FindingView, ...]


def problems_of(file: FileRecord, pictures: Pictures, anchors: Anchors) -> Problems:
    """Return each finding once, with links to the causes that explain it."""
    by_finding: dict[str, list[Link]] = {}
    for k, diagnosis in enumerate(file.diagnoses):
        for finding in dict.fromkeys(diagnosis.explains):
            by_finding.setdefault(finding, []).append(Link(anchors.diagnosis(k), diagnosis.id))
    views = _views(file, pictures, by_finding, anchors)
    by_id = {view.id: view for view in reversed(views)}
    return Problems(
        tuple(_cause(diagnosis, anchors.diagnosis(k), by_id) for k, diagnosis in enumerate(file.diagnoses)),
        tuple(view for view in views if view.grave),
        tuple(view for view in views if not view.grave),
    )


def _views(
    file: FileRecord, pictures: Pictures, by_finding: Mapping[str, Sequence[Link]], anchors: Anchors
) -> list[FindingView]:
    check_anchors = {id(result): anchors.check(k) for k, result in enumerate(file.results)}
    moments = pictures.strip.rows if pictures.strip else ()
    return [
        FindingView(
            anchor=anchors.finding(k),
            id=finding.id,
            code=finding.code,
            severity=finding.severity,
            message=finding.message,
            place=place(finding.where),
            stream=finding.where.stream or "",
            start_us=finding.where.start_us,
            check=Link(check_anchors[id(result)], result.check),
            causes=tuple(by_finding.get(finding.id, ())),
            pictures=pictures.places.get(finding.id),
            nearest=None if finding.id in pictures.places else _nearest(finding, moments),
        )
        for k, (result, finding) in enumerate(findings_of(file))
    ]


def _nearest(finding: Finding, moments: Sequence[Row]) -> Link | None:
    """Return the moment nearest to where a finding begins; None where either has no time."""
    start_us = finding.where.start_us
    timed = [(row.time_us, row) for row in moments if row.time_us is not None]
    if start_us is None or not timed:
        return None
    _, row = min(timed, key=lambda pair: abs(pair[0] - start_us))
    return Link(row.anchor, row.time)


def _cause(diagnosis: Diagnosis, anchor: str, by_id: Mapping[str, FindingView]) -> Cause:
    explained = [by_id[finding] for finding in dict.fromkeys(diagnosis.explains) if finding in by_id]
    return Cause(
        anchor=anchor,
        id=diagnosis.id,
        sentence=cause_sentence(diagnosis),
        name=f"{diagnosis.stream}:{diagnosis.cause}",
        place=place(diagnosis.where),
        remedy=diagnosis.remedy,
        confidence=f"{diagnosis.confidence:.0%}" if diagnosis.confidence else "",
        explains=tuple(Link(view.anchor, view.id) for view in explained),
    )
