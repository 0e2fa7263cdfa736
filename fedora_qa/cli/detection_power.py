"""What a passed check rules out, in words, for ``fedora-qa explain`` and reports; needs a published table."""

from dataclasses import dataclass

from fedora_qa.power.detection_power import DetectableCause, DetectionPower, read_detection_power
from fedora_qa.record.power_tables import estimate_words, share_words

TITLE = "Measured power"


def detection_power_text(check: str) -> str:
    """Return what the check was measured to find, a cause a line; empty where nothing has been published."""
    detection_power = read_detection_power()
    if detection_power is None:
        return ""
    # Without the sentence a check that finds nothing surely would look like one that was not measured.
    lines = [(f"{row.cause}: {_found(row)}") for row in detection_power.of(check)] or [
        "No cause that was planted is surely found by it."
    ]
    return "\n".join([*lines, "", _whence(detection_power)])


@dataclass(frozen=True, slots=True)
class FoundInWords:
    """A cause that a check can be relied on to find. ``best``: no other check finds it from a smaller size on."""

    cause: str
    check: str
    words: str
    best: bool


def all_detection_power() -> tuple[tuple[FoundInWords, ...], str]:
    """Return what every check surely finds, and a sentence that states where that was measured; else nothing."""
    detection_power = read_detection_power()
    if detection_power is None:
        return (), ""
    relied_on = [
        row for check in dict.fromkeys(row.check for row in detection_power.found) for row in detection_power.of(check)
    ]
    best: dict[str, DetectableCause] = {}
    for row in relied_on:
        rival = best.setdefault(row.cause, row)
        # Strictly less: between equals the check that stands first stays, so that the page does not depend on chance.
        if _least(row) < _least(rival):
            best[row.cause] = row
    rows_as_text = (FoundInWords(row.cause, row.check, _found(row), best[row.cause] is row) for row in relied_on)
    return tuple(sorted(rows_as_text, key=lambda row: list(best).index(row.cause))), _whence(detection_power)


def _least(row: DetectableCause) -> float:
    """Return the least size that is found; 0 where every size that was tried is found, so that it comes first."""
    return 0.0 if row.at_95.value is None else row.at_95.value


def _found(row: DetectableCause) -> str:
    if row.at_95.value is None:
        return f"found {share_words(row.found)}"
    return f"95% at {estimate_words(row.at_95, row.unit)}"


def _whence(detection_power: DetectionPower) -> str:
    stale = " The code has changed since: make power measures it anew." if detection_power.is_stale() else ""
    files = f"{detection_power.files} short and small files, {detection_power.clean} of them clean"
    return f"Over {files} (fedora-qa power).{stale}"
