"""The faults that each check detects, in words, for ``fedora-qa explain`` and reports; from the published table."""

from typing import TYPE_CHECKING

from fedora_qa.power.detection_power import DetectableCause as MeasuredCause
from fedora_qa.power.detection_power import DetectionPower, read_detection_power
from fedora_qa.record.power_tables import estimate_words, share_words

if TYPE_CHECKING:
    from fedora_reports.detection_power import PassDetectionPower

TITLE = "Measured power"


def detection_power_text(check: str) -> str:
    """Return the causes that a check was measured to find, a cause a line; empty where no table is published."""
    detection_power = read_detection_power()
    if detection_power is None:
        return ""
    # Without the sentence a check that finds no cause reliably would look like one that was not measured.
    lines = [f"{row.cause}: {_share_or_size(row)}" for row in detection_power.of(check)] or [
        "No cause that was planted is found reliably by it."
    ]
    return "\n".join([*lines, "", _source_sentence(detection_power)])


def pass_detection_power() -> "PassDetectionPower":
    """Return the causes that each check can be relied on to find, as reports show them; none without a table."""
    # Reports import nothing but records: the measured power is handed over in their own types.
    from fedora_reports.detection_power import (  # noqa: PLC0415 - an extra
        NOTHING_KNOWN,
        DetectableCause,
        PassDetectionPower,
    )

    detection_power = read_detection_power()
    if detection_power is None:
        return NOTHING_KNOWN
    relied_on = [
        row for check in dict.fromkeys(row.check for row in detection_power.found) for row in detection_power.of(check)
    ]
    best: dict[str, MeasuredCause] = {}
    for row in relied_on:
        rival = best.setdefault(row.cause, row)
        # Strictly less: of equals the first check stays, so that the page is always the same.
        if _least(row) < _least(rival):
            best[row.cause] = row
    causes = (DetectableCause(row.cause, row.check, _share_or_size(row), best[row.cause] is row) for row in relied_on)
    by_cause = sorted(causes, key=lambda row: list(best).index(row.cause))
    return PassDetectionPower(tuple(by_cause), _source_sentence(detection_power))


def _least(row: MeasuredCause) -> float:
    """Return the least size that is found; 0 where every size that was tried is found, so that it comes first."""
    return 0.0 if row.at_95.value is None else row.at_95.value


def _share_or_size(row: MeasuredCause) -> str:
    if row.at_95.value is None:
        return f"found {share_words(row.found)}"
    return f"95% at {estimate_words(row.at_95, row.unit)}"


def _source_sentence(detection_power: DetectionPower) -> str:
    stale = " The code has changed since: make power measures it anew." if detection_power.is_stale() else ""
    files = f"{detection_power.files} short and small files, {detection_power.clean} of them clean"
    return f"Over {files} (fedora-qa power).{stale}"
