"""What a pass is worth: the faults that a check was measured to find, and what became of that check here."""

from collections.abc import Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Outcome, Result
from fedora_qa.record.wording import OUTCOME_WORDS


@dataclass(frozen=True, slots=True)
class DetectableCause:
    """A fault that a check finds, and from which size on, in words. ``best``: no other check finds it smaller."""

    cause: str
    check: str
    words: str
    best: bool


@dataclass(frozen=True, slots=True)
class PassDetectionPower:
    """What was measured of all checks, and in a sentence where that was."""

    found: tuple[DetectableCause, ...]
    whence: str

    def of(self, check: str) -> tuple[DetectableCause, ...]:
        """Return what one check was measured to find."""
        return tuple(row for row in self.found if row.check == check)


NOTHING_KNOWN = PassDetectionPower((), "")


@dataclass(frozen=True, slots=True)
class DetectionPowerRow:
    """A fault, how surely it is found and by which check, and what came of that check in this file."""

    cause: str
    words: str
    check: str
    anchor: str
    outcome: Outcome
    word: str


def detection_power_rows(
    detection_power: PassDetectionPower, results: Sequence[Result], anchors: Sequence[str]
) -> tuple[DetectionPowerRow, ...]:
    """Return a row for each fault whose best check was run on this file."""
    places = {result.check: (result, anchor) for result, anchor in zip(results, anchors, strict=True)}
    rows = []
    for row in detection_power.found:
        if row.best and row.check in places:
            result, anchor = places[row.check]
            word = OUTCOME_WORDS[result.outcome]
            rows.append(DetectionPowerRow(row.cause, row.words, row.check, anchor, result.outcome, word))
    return tuple(rows)
