"""Every check, by subject: its question, and its measurements against expected value, limit and detection limit."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import FileRecord, Measurement, Outcome
from fedora_qa.record.wording import (
    OUTCOME_WORDS,
    coverage_words,
    least_detectable_text,
    number,
    principal,
    with_error,
    with_unit,
)
from fedora_reports.anchors import Anchors
from fedora_reports.detection_power import DetectableCause, PassDetectionPower
from fedora_reports.evidence import Evidence
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
_CONCLUSIVE: Final[frozenset[Outcome]] = frozenset({"passed", "failed", "warned"})
_FARTHEST: Final = 1000.0
"""Largest distance from the expected value, in limits: the order of checks needs no larger one."""

_REACH: Final = 2.0
"""A gauge reaches this many limits to either side of the expected value."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """Places as shares of the drawing's width, 0 to 1.

    Attributes
    ----------
    band
        Left and right end of the values of a correct file.
    value
        The value; at an end of the drawing where it lies beyond.
    error
        Left and right end of one standard error about the value.
    detection_limit
        The detection limit, on the side that counts; None where it is unknown, below the limit or beyond the drawing.
    beyond
        -1 or 1 where the value lies beyond the drawing's left or right end, else 0.
    counts
        Whether the value lies beyond the limit on a side that counts.
    text
        The deviation in words.
    """

    band: tuple[float, float]
    value: float
    error: tuple[float, float]
    detection_limit: float | None
    beyond: int
    counts: bool
    text: str


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
    """One check: a row that is always visible, and its details.

    ``principal`` is the measurement that lies farthest out; None where the check was not conclusive. ``nearness`` is
    its distance from the expected value, in multiples of what is allowed; 0 or 1000 where nothing is.
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
    fault_price: tuple[str, ...]
    nearness: float

    @property
    def short_name(self) -> str:
        """Its name without the subject."""
        return self.name.partition(".")[2] or self.name

    @property
    def open(self) -> bool:
        """Whether its details are unfolded at first."""
        return self.outcome in _OPEN


@dataclass(frozen=True, slots=True)
class Subject:
    """The checks of one subject."""

    identifier: str
    title: str
    checks: tuple[CheckView, ...]


def subjects_of(
    file: FileRecord,
    evidence: Evidence,
    anchors: Anchors,
    links: Sequence[Link],
    detection_power: PassDetectionPower,
    fault_prices: Mapping[str, str],
) -> tuple[Subject, ...]:
    """Return the checks by subject, in the order of the record.

    Parameters
    ----------
    evidence
        The arrays of the file, those that checks keep among them.
    links
        A link to each finding, by its identifier.
    detection_power
        The faults that each check detects, where that was measured.
    fault_prices
        What the faults that a check measures cost a learner, by check, where that was measured.
    """
    by_subject: dict[str, list[CheckView]] = {}
    for k, result in enumerate(file.results):
        farthest = principal(result) if result.outcome in _CONCLUSIVE else None
        # How far out that lies: on the side that counts, in limits.
        nearness = 0.0
        distance = farthest.counted_deviation if farthest else None
        if farthest and distance is not None and farthest.allowed is not None:
            if not math.isfinite(distance) or distance > _FARTHEST * farthest.allowed:
                nearness = _FARTHEST
            elif farthest.allowed:
                nearness = distance / farthest.allowed
        finding_ids = {finding.id for finding in result.findings}
        view = CheckView(
            anchor=anchors.check(k),
            name=result.check,
            outcome=result.outcome,
            word=OUTCOME_WORDS[result.outcome],
            question=result.question,
            coverage=coverage_words(result.coverage),
            reason=result.reason,
            traceback=tuple(result.traceback.splitlines()),
            principal=None if farthest is None else _measurement(farthest),
            measurements=tuple(_measurement(measurement) for measurement in result.measurements),
            findings=tuple(link for link in links if link.word in finding_ids),
            exhibits=exhibits(evidence, tuple(evidence.under(result.check))),
            detection_power=detection_power.of(result.check),
            fault_price=tuple(filter(None, fault_prices.get(result.check, "").splitlines())),
            nearness=nearness,
        )
        by_subject.setdefault(result.check.split(".", 1)[0], []).append(view)
    return tuple(
        Subject(name, _TITLES.get(name) or name.replace("_", " ").capitalize(), tuple(views))
        for name, views in by_subject.items()
    )


def gauge_of(measurement: Measurement) -> Gauge | None:
    """Return the gauge of a measurement that has a value, an expected value and an allowance above 0; else None."""
    value, expected, limit = measurement.value, measurement.expected, measurement.allowed
    if value is None or expected is None or limit is None or not all(map(math.isfinite, (value, expected, limit))):
        return None
    if limit <= 0:
        return None
    deviation = value / limit - expected / limit
    if not math.isfinite(deviation):
        return None
    error = measurement.standard_error or 0.0
    spread = error / limit if math.isfinite(error) else 0.0
    least = measurement.least_detectable
    detection_limit = None
    if least is not None and math.isfinite(least) and limit <= least <= _REACH * limit:
        detection_limit = _share(-least / limit if measurement.side == "lower" else least / limit)
    return Gauge(
        band=(
            0.0 if measurement.side == "upper" else _share(-1.0),
            1.0 if measurement.side == "lower" else _share(1.0),
        ),
        value=_share(deviation),
        error=(_share(deviation - spread), _share(deviation + spread)),
        detection_limit=detection_limit,
        beyond=0 if abs(deviation) <= _REACH else int(math.copysign(1, deviation)),
        counts=(deviation > 1 and measurement.side != "lower") or (deviation < -1 and measurement.side != "upper"),
        text=f"{abs(deviation):.3g} of what is allowed {'above' if deviation >= 0 else 'below'} the expected value",
    )


def _measurement(measurement: Measurement) -> MeasurementView:
    # The largest deviation of a correct file, with the sign of the side on which it counts.
    limit = ""
    if measurement.limit == 0:
        limit = {"both": "exact", "upper": "not above", "lower": "not below"}[measurement.side]
    elif measurement.limit is not None:
        sign = {"both": "±", "upper": "+", "lower": "−"}[measurement.side]
        limit = f"{sign}{with_unit(measurement.limit, measurement.unit)}"
    if measurement.limit is not None and measurement.material:
        limit = f"{limit}, material from {with_unit(measurement.material, measurement.unit)} more".removeprefix(
            "exact, "
        )
    least = measurement.least_detectable
    unit = "" if least is None else with_unit(least, measurement.unit).removeprefix(number(least))
    return MeasurementView(
        name=measurement.name,
        value=with_error(measurement.value, measurement.standard_error, measurement.unit),
        expected="" if measurement.expected is None else with_unit(measurement.expected, measurement.unit),
        limit=limit,
        least_detectable="" if least is None else f"{least_detectable_text(measurement)}{unit}",
        gauge=gauge_of(measurement),
    )


def _share(deviation: float) -> float:
    """Return the place of a deviation, in limits, on the drawing."""
    return min(max((deviation + _REACH) / (2 * _REACH), 0.0), 1.0)
