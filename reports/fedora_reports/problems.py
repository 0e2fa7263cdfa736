"""The problems of a file: causes, the findings that they explain, and remarks, which do not count against the file."""

from collections.abc import Mapping
from dataclasses import dataclass

from fedora_qa.record.types import GRAVE, FileRecord, Severity
from fedora_qa.record.wording import cause_sentence, findings_of, place, status_sentence
from fedora_reports.anchors import Anchors
from fedora_reports.evidence import Evidence
from fedora_reports.strip import Pictures, WorstLocation
from fedora_reports.trials import TrialView, trial_of


@dataclass(frozen=True, slots=True)
class Link:
    """A link to another place of the page."""

    anchor: str
    word: str


@dataclass(frozen=True, slots=True)
class FindingView:
    """A finding with the pictures of its worst place; without them ``nearest`` leads to the next snapshot in time."""

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
    pictures: WorstLocation | None
    nearest: Link | None

    @property
    def grave(self) -> bool:
        """Whether the finding counts against the file."""
        return self.severity in GRAVE


@dataclass(frozen=True, slots=True)
class Cause:
    """A probable cause in one sentence, with links to the findings that it explains."""

    anchor: str
    id: str
    sentence: str
    name: str
    place: str
    remedy: str
    known_by: str
    explains: tuple[Link, ...]
    trial: TrialView | None


@dataclass(frozen=True, slots=True)
class Problems:
    """Causes, the most probable first; findings that count against the file; and remarks, which do not.

    ``opening`` is the anchor of the finding by which the first cause has its size; empty without a cause.
    """

    causes: tuple[Cause, ...]
    findings: tuple[FindingView, ...]
    remarks: tuple[FindingView, ...]
    opening: str


def problems_of(file: FileRecord, evidence: Evidence, pictures: Pictures, anchors: Anchors) -> Problems:
    """Return each finding once, with links to the causes that explain it."""
    causes_of: dict[str, list[Link]] = {}
    for k, diagnosis in enumerate(file.diagnoses):
        for finding_id in dict.fromkeys(diagnosis.explains):
            causes_of.setdefault(finding_id, []).append(Link(anchors.diagnosis(k), diagnosis.id))

    check_anchors = {id(result): anchors.check(k) for k, result in enumerate(file.results)}
    snapshots = [(row.time_us, row) for row in pictures.strip.rows if row.time_us is not None] if pictures.strip else []
    views = []
    for k, (result, finding) in enumerate(findings_of(file)):
        located, start_us = pictures.worst_locations.get(finding.id), finding.where.start_us
        nearest = None
        if located is None and start_us is not None and snapshots:
            distances_us = [abs(time_us - start_us) for time_us, _ in snapshots]
            _, row = snapshots[distances_us.index(min(distances_us))]
            nearest = Link(row.anchor, row.time)
        view = FindingView(
            anchor=anchors.finding(k),
            id=finding.id,
            code=finding.code,
            severity=finding.severity,
            message=finding.message,
            place=place(finding.where),
            stream=finding.where.stream or "",
            start_us=start_us,
            check=Link(check_anchors[id(result)], result.check),
            causes=tuple(causes_of.get(finding.id, ())),
            pictures=located,
            nearest=nearest,
        )
        views.append(view)

    by_id = {view.id: view for view in reversed(views)}  # of findings with one identifier the first
    causes = []
    for k, diagnosis in enumerate(file.diagnoses):
        explained = [by_id[finding_id] for finding_id in dict.fromkeys(diagnosis.explains) if finding_id in by_id]
        cause = Cause(
            anchor=anchors.diagnosis(k),
            id=diagnosis.id,
            sentence=cause_sentence(diagnosis),
            name=f"{diagnosis.stream}:{diagnosis.cause}",
            place=place(diagnosis.where),
            remedy=diagnosis.remedy,
            known_by=status_sentence(diagnosis),
            explains=tuple(Link(view.anchor, view.id) for view in explained),
            trial=trial_of(evidence, diagnosis.id, pictures.trials.get(diagnosis.id)),
        )
        causes.append(cause)
    return Problems(
        tuple(causes),
        tuple(view for view in views if view.grave),
        tuple(view for view in views if not view.grave),
        _opening(file, by_id),
    )


def _opening(file: FileRecord, by_id: Mapping[str, FindingView]) -> str:
    if not file.diagnoses:
        return ""
    first = file.diagnoses[0]
    explained = [finding for _, finding in findings_of(file) if finding.id in first.explains]
    best = next((finding for finding in explained if first.where in finding.all_places), *explained[:1] or (None,))
    return by_id[best.id].anchor if best else ""
