"""What a repair did, or why it did nothing, as plain data; and whether the repaired file is better.

It is better where what was to be cleared is gone and is measured to be gone, nothing is new, and every check runs. A
correct file may show less than a faulty one: a measurement that only a fault makes possible is not observable without
it. So an outcome may become ``not_observable``, but of the checks that a repair is to clear at least one must measure.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import IMMATERIAL, Diagnosis, FileRecord, Finding, Outcome
from fedora_qa.record.wording import findings_of
from fedora_qa.repairs.write import DatasetChange

_Broken = tuple[str, str | None]
"""Code of a rule, and the stream that breaks it."""

_WITHOUT_ANSWER: Final[frozenset[Outcome]] = frozenset({"crashed", "not_applicable"})
"""Outcomes of a check that did not measure the file at all."""


@dataclass(frozen=True, slots=True)
class RepairStep:
    """A diagnosis whose fault is undone.

    Attributes
    ----------
    diagnosis
        The cause, its size, and how it is known.
    done
        What undoing does, in words.
    fault
        The fault with all its sizes, as its class is written.
    """

    diagnosis: Diagnosis
    done: str
    fault: str


@dataclass(frozen=True, slots=True)
class Omission:
    """A diagnosis that is not repaired, and the reason, as a sentence."""

    diagnosis: Diagnosis
    reason: str


@dataclass(frozen=True, slots=True)
class Repair:
    """The result.

    Attributes
    ----------
    steps
        What was done, or would be done, in order.
    omissions
        The other diagnoses.
    datasets, attributes
        What was altered, or would be: datasets, and attributes as ``path.name = value``.
    beside
        Datasets that the dialect does not describe and that may refer to what was altered; they are not altered.
    refusal
        Why nothing is written, as a sentence; empty where the file is written, or would be.
    before, after
        The records of the file and, where one was made, of the repaired copy, which is judged by the limits alone.
    """

    steps: tuple[RepairStep, ...]
    omissions: tuple[Omission, ...]
    before: FileRecord
    datasets: tuple[DatasetChange, ...] = ()
    attributes: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    refusal: str = ""
    after: FileRecord | None = None


def why_not_better(before: FileRecord, after: FileRecord, steps: Iterable[RepairStep]) -> str:
    """Return why the repaired file is not better than the file, as a sentence; empty where it is.

    Parameters
    ----------
    before
        Record of the file, of any profile.
    after
        Record of the repaired file with the same checks, judged by the limits alone (``strict``).
    steps
        What was done. With each, the findings that it cleared in the trial must be gone, or where none was tried, those
        that it explains.
    """
    old_findings = {finding.id: finding for _, finding in findings_of(before)}
    old, new = _broken(old_findings.values()), _broken(finding for _, finding in findings_of(after))
    outcomes = {result.check: result.outcome for result in after.results}
    for step in steps:
        if step.diagnosis.after and not step.diagnosis.explains:
            # What the faults before it hid would be new, and was a finding of no check of the file.
            continue
        named = step.diagnosis.cleared or step.diagnosis.explains
        wanted = _broken(old_findings[name] for name in named if name in old_findings)
        still = sorted(code for code, stream in wanted & new)
        if still or not wanted:
            kept = f"it still breaks {', '.join(still)}" if still else "it explains no finding of this file"
            return f"Expected {step.diagnosis.id} to clear what it explains, but {kept}."
        checks = {result.check for result, finding in findings_of(before) if finding.id in named}
        if not any(outcomes.get(check) in {"passed", "warned", "failed"} for check in checks):
            unobservable = ", ".join(sorted(checks))
            return f"Expected {step.diagnosis.id} to be cleared, but {unobservable} can no longer be observed."
    # A deviation within the material size is no finding with its own code before, and is one by the limits alone.
    exceeding = {m.code for result in before.results for m in result.measurements if m.exceeds_limit}
    codes_before = {code for code, _ in old}
    added = sorted(code for code, stream in new - old if code in codes_before or code not in exceeding)
    if added:
        return f"Expected nothing new, but the repaired file breaks {', '.join(dict.fromkeys(added))}."
    for result in before.results:
        outcome = outcomes.get(result.check, "crashed")
        if outcome in _WITHOUT_ANSWER and result.outcome not in _WITHOUT_ANSWER:
            return f"Expected {result.check} of the repaired file to measure, but it is {outcome.replace('_', ' ')}."
    return ""


def _broken(findings: Iterable[Finding]) -> set[_Broken]:
    return {(each.code, each.where.stream) for each in findings if not each.code.endswith(f".{IMMATERIAL}")}
