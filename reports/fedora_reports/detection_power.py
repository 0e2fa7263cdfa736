"""What the checks detect: the faults, as a study measured them, and the detection limits of passed checks in a file."""

from collections.abc import Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Outcome, Result
from fedora_qa.record.wording import OUTCOME_WORDS, least_detectable_text, number, with_unit
from fedora_reports.problems import Link


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
    """Return a row for each fault whose best check was run on this file."""
    by_check = {result.check: (result, anchor) for result, anchor in zip(results, anchors, strict=True)}
    rows = []
    for row in detection_power.causes:
        if row.best and row.check in by_check:
            result, anchor = by_check[row.check]
            word = OUTCOME_WORDS[result.outcome]
            rows.append(DetectionPowerRow(row.cause, row.text, row.check, anchor, result.outcome, word))
    return tuple(rows)


@dataclass(frozen=True, slots=True)
class CheckLimit:
    """A passed check, and the deviation of its first measurement from which it would have detected one, in words.

    ``more`` is the number of its other measurements with a limit.
    """

    check: Link
    limit: str
    more: int


@dataclass(frozen=True, slots=True)
class PassLimits:
    """The detection limits of the passed checks of a file.

    ``exact`` are passed checks whose values must be exact: any deviation counts. ``unobserved`` are checks without an
    answer, each with its reason.
    """

    rows: tuple[CheckLimit, ...]
    exact: tuple[Link, ...]
    unobserved: tuple[tuple[Link, str], ...]


def pass_limits_of(results: Sequence[Result], anchors: Sequence[str]) -> PassLimits | None:
    """Return what the passes of a file exclude; None where no check passed."""
    rows, exact, unobserved = list[CheckLimit](), list[Link](), list[tuple[Link, str]]()
    for result, anchor in zip(results, anchors, strict=True):
        link = Link(anchor, result.check)
        if result.outcome in {"not_observable", "crashed"}:
            unobserved.append((link, result.reason))
        if result.outcome != "passed":
            continue
        limits = []
        for measurement in result.measurements:
            least = measurement.least_detectable
            if least is not None and measurement.limit:
                unit = with_unit(least, measurement.unit).removeprefix(number(least))
                limits.append(f"{measurement.name} ≥ {least_detectable_text(measurement)}{unit}")
        if limits:
            rows.append(CheckLimit(link, limits[0], len(limits) - 1))
        elif any(measurement.limit == 0 for measurement in result.measurements):
            exact.append(link)
    return PassLimits(tuple(rows), tuple(exact), tuple(unobserved)) if rows or exact else None
