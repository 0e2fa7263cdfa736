"""What is wrong: causes with the findings that they explain, then the findings that no cause explains."""

from collections.abc import Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Diagnosis, FileRecord, Severity
from fedora_qa.record.wording import cause_sentence, findings_of, place
from fedora_reports.anchors import Anchors
from fedora_reports.evidence import Evidence
from fedora_reports.strip import Strip, place_strip


@dataclass(frozen=True, slots=True)
class Link:
    """A word that leads to another place of the page."""

    anchor: str
    word: str


@dataclass(frozen=True, slots=True)
class FindingView:
    """A finding with the pictures of its worst place."""

    anchor: str
    id: str
    code: str
    severity: Severity
    message: str
    place: str
    check: Link
    pictures: Strip | None

    @property
    def grave(self) -> bool:
        """Whether it counts against the file."""
        return self.severity in {"critical", "error"}


@dataclass(frozen=True, slots=True)
class Cause:
    """A probable cause in one sentence, with the findings that are shown under it and links to all it explains."""

    anchor: str
    id: str
    sentence: str
    name: str
    place: str
    remedy: str
    confidence: str
    findings: tuple[FindingView, ...]
    explains: tuple[Link, ...]


@dataclass(frozen=True, slots=True)
class Problems:
    """Causes, the most probable first; grave findings that none explains; and what is merely unusual."""

    causes: tuple[Cause, ...]
    unexplained: tuple[FindingView, ...]
    remarks: tuple[FindingView, ...]


def problems_of(file: FileRecord, evidence: Evidence, anchors: Anchors) -> Problems:
    """Return each finding once: under the first cause that explains it, or by itself."""
    views = _views(file, evidence, anchors)
    by_id = {view.id: view for view in reversed(views)}
    left = dict.fromkeys(views)
    causes = []
    for k, diagnosis in enumerate(file.diagnoses):
        explained = [by_id[finding] for finding in dict.fromkeys(diagnosis.explains) if finding in by_id]
        shown = [view for view in explained if view in left]
        for view in shown:
            del left[view]
        causes.append(_cause(diagnosis, anchors.diagnosis(k), shown, explained))
    return Problems(
        tuple(causes),
        tuple(view for view in left if view.grave),
        tuple(view for view in left if not view.grave),
    )


def _views(file: FileRecord, evidence: Evidence, anchors: Anchors) -> Sequence[FindingView]:
    return [
        FindingView(
            anchor=anchors.finding(k),
            id=finding.id,
            code=finding.code,
            severity=finding.severity,
            message=finding.message,
            place=place(finding.where),
            check=Link(anchors.check(file.results.index(result)), result.check),
            pictures=place_strip(evidence, finding.id),
        )
        for k, (result, finding) in enumerate(findings_of(file))
    ]


def _cause(diagnosis: Diagnosis, anchor: str, shown: list[FindingView], explained: list[FindingView]) -> Cause:
    sentence = cause_sentence(diagnosis)
    return Cause(
        anchor=anchor,
        id=diagnosis.id,
        sentence=sentence[:1].upper() + sentence[1:],
        name=f"{diagnosis.stream}:{diagnosis.cause}",
        place=place(diagnosis.where),
        remedy=diagnosis.remedy,
        confidence=f"{diagnosis.confidence:.0%}" if diagnosis.confidence else "",
        findings=tuple(shown),
        explains=tuple(Link(view.anchor, view.id) for view in explained),
    )
