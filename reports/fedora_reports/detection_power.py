"""Detection power of checks: the faults that each check detects, and its outcome on a file."""

from collections.abc import Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Outcome, Result
from fedora_qa.record.wording import OUTCOME_WORDS


@dataclass(frozen=True, slots=True)
class DetectableCause:
    """A fault that a check detects, and the least detected size in words. ``best``: no check detects a smaller one."""

    cause: str
    check: str
    text: str
    best: bool


@dataclass(frozen=True, slots=True)
class PassDetectionPower:
    """The detectable causes of all checks, and a sentence on the files that they were measured on."""

    causes: tuple[DetectableCause, ...]
    source: str

    def of(self, check: str) -> tuple[DetectableCause, ...]:
        """Return the detectable causes of one check."""
        return tuple(row for row in self.causes if row.check == check)


NOTHING_KNOWN = PassDetectionPower((), "")


@dataclass(frozen=True, slots=True)
class DetectionPowerRow:
    """A fault with the check that detects the least size of it, and the outcome of that check in this file."""

    cause: str
    text: str
    check: str
    anchor: str
    outcome: Outcome
    outcome_word: str


def detection_power_rows(
    detection_power: PassDetectionPower, results: Sequence[Result], anchors: Sequence[str]
) -> tuple[DetectionPowerRow, ...]:
    """Return a row for each fault whose best check was run on this file.

    Parameters
    ----------
    detection_power
        The detectable causes of all checks.
    results
        The results of the file.
    anchors
        The identifier of each result on the page.
    """
    by_check = {result.check: (result, anchor) for result, anchor in zip(results, anchors, strict=True)}
    rows = []
    for row in detection_power.causes:
        if row.best and row.check in by_check:
            result, anchor = by_check[row.check]
            word = OUTCOME_WORDS[result.outcome]
            rows.append(DetectionPowerRow(row.cause, row.text, row.check, anchor, result.outcome, word))
    return tuple(rows)
