"""Every check, by subject: what was asked, measured, expected, and what would have been seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import FileRecord, Measurement, Outcome, Result
from fedora_qa.record.wording import OUTCOME_WORDS, coverage_words, principal, with_error, with_unit
from fedora_reports.anchors import Anchors
from fedora_reports.detection_power import DetectableCause, PassDetectionPower
from fedora_reports.evidence import Evidence
from fedora_reports.gauges import Gauge, gauge_of
from fedora_reports.maps import Exhibits, exhibits
from fedora_reports.problems import Link

_TITLES: Final = {
    "integrity": "Integrity of the file",
    "metadata": "Metadata",
    "clocks": "Clocks",
    "index_maps": "Index maps",
    "event_stream": "The event stream by itself",
    "event_response": "Events against light",
    "images": "Colour frames",
    "depth": "Depth",
    "flow_photometric": "Flow against frames",
    "flow_geometry": "Flow against depth and pose",
    "flow_rates": "Rates of flow against each other",
    "flow_events": "Events along the flow",
    "pose": "Pose",
    "imu": "IMU against pose",
    "alignment": "Cameras against each other",
}

_OPEN: Final[frozenset[Outcome]] = frozenset({"failed", "crashed", "warned"})
_FARTHEST: Final = 1000.0
_TELLING: Final[frozenset[Outcome]] = frozenset({"passed", "failed", "warned"})


@dataclass(frozen=True, slots=True)
class MeasurementView:
    """One measurement in words, with its gauge."""

    name: str
    value: str
    expected: str
    limit: str
    least_detectable: str
    gauge: Gauge | None


@dataclass(frozen=True, slots=True)
class CheckView:
    """One check: a row that is always seen, and its details.

    ``principal`` is the measurement that lies farthest out; None where the check could not tell. ``nearness`` is how
    far out that is, in limits; of what must be exact 0 or 1000.
    """

    anchor: str
    name: str
    outcome: Outcome
    word: str
    question: str
    coverage: str
    reason: str
    traceback: tuple[str, ...]
    principal: MeasurementView | None
    measurements: tuple[MeasurementView, ...]
    findings: tuple[Link, ...]
    exhibits: Exhibits
    detection_power: tuple[DetectableCause, ...]
    nearness: float

    @property
    def open(self) -> bool:
        """Whether its details are shown at once."""
        return self.outcome in _OPEN


@dataclass(frozen=True, slots=True)
class Subject:
    """The checks of one subject."""

    identifier: str
    title: str
    checks: tuple[CheckView, ...]


def subjects_of(
    file: FileRecord, evidence: Evidence, anchors: Anchors, links: Sequence[Link], detection_power: PassDetectionPower
) -> tuple[Subject, ...]:
    """Return the checks by subject, in the order of the record. ``links`` lead to the findings."""
    by_subject: dict[str, list[CheckView]] = {}
    for k, result in enumerate(file.results):
        view = _check(result, anchors.check(k), evidence, links, detection_power)
        by_subject.setdefault(result.check.split(".", 1)[0], []).append(view)
    return tuple(Subject(name, _title(name), tuple(views)) for name, views in by_subject.items())


def _title(subject: str) -> str:
    return _TITLES.get(subject) or subject.replace("_", " ").capitalize()


def _check(
    result: Result, anchor: str, evidence: Evidence, links: Sequence[Link], detection_power: PassDetectionPower
) -> CheckView:
    main = principal(result) if result.outcome in _TELLING else None
    own = {finding.id for finding in result.findings}
    return CheckView(
        anchor=anchor,
        name=result.check,
        outcome=result.outcome,
        word=OUTCOME_WORDS[result.outcome],
        question=result.question,
        coverage=coverage_words(result.coverage),
        reason=result.reason,
        traceback=tuple(result.traceback.splitlines()),
        principal=None if main is None else _measurement(main),
        measurements=tuple(_measurement(measurement) for measurement in result.measurements),
        findings=tuple(link for link in links if link.word in own),
        exhibits=exhibits(evidence, tuple(evidence.under(result.check))),
        detection_power=detection_power.of(result.check),
        nearness=0.0 if main is None else _nearness(main),
    )


def _nearness(measurement: Measurement) -> float:
    """Return how far out a measurement lies on the side that counts, in limits, at most 1000."""
    if measurement.value is None or measurement.expected is None or measurement.limit is None:
        return 0.0
    deviation = measurement.value - measurement.expected
    counted = {"both": abs(deviation), "upper": max(deviation, 0.0), "lower": max(-deviation, 0.0)}[measurement.side]
    if not math.isfinite(counted) or counted > _FARTHEST * measurement.limit:
        return _FARTHEST
    return counted / measurement.limit if measurement.limit else 0.0


def _measurement(measurement: Measurement) -> MeasurementView:
    return MeasurementView(
        name=measurement.name,
        value=with_error(measurement.value, measurement.standard_error, measurement.unit),
        expected="" if measurement.expected is None else with_unit(measurement.expected, measurement.unit),
        limit=_limit(measurement),
        least_detectable=""
        if measurement.least_detectable is None
        else with_unit(measurement.least_detectable, measurement.unit),
        gauge=gauge_of(measurement),
    )


def _limit(measurement: Measurement) -> str:
    """Return the largest honest deviation, with the side on which it counts."""
    if measurement.limit is None:
        return ""
    if measurement.limit == 0:
        return "exact" if measurement.side == "both" else {"upper": "not above", "lower": "not below"}[measurement.side]
    sign = {"both": "±", "upper": "+", "lower": "−"}[measurement.side]
    return f"{sign}{with_unit(measurement.limit, measurement.unit)}"
