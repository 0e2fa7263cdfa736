"""The verdict of a file in words, and the measurements that it rests on."""

from collections import Counter
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

from fedora_qa.record.types import FileRecord, Outcome, Verdict
from fedora_qa.record.wording import OUTCOME_WORDS, basis_of_clean, canaries_seen, immaterial_count, why_incomplete

TITLES: Final[dict[Verdict, str]] = {"clean": "Passed", "findings": "Failed", "incomplete": "Incomplete"}


@dataclass(frozen=True, slots=True)
class Share:
    """The checks with one outcome: their number, and their place on a bar of all checks, as shares of it."""

    outcome: Outcome
    word: str
    count: int
    left: float
    width: float


@dataclass(frozen=True, slots=True)
class VerdictText:
    """The verdict, a sentence with its reason, and a sentence on the checks that it rests on."""

    verdict: Verdict
    title: str
    sentence: str
    basis: str
    shares: tuple[Share, ...]


def verdict_of(file: FileRecord) -> VerdictText:
    """Return the verdict of a file in words."""
    outcomes = Counter(result.outcome for result in file.results)
    failed = outcomes["failed"]
    if file.verdict == "incomplete":
        more = f" {checks(failed).capitalize()} failed." if failed else ""
        sentence = f"No verdict can be given: {why_incomplete(file)}.{more}"
    elif file.verdict == "findings":
        causes = len(file.diagnoses)
        named = {0: "no cause could be named", 1: "one probable cause is named"}.get(
            causes, f"{causes} probable causes are named"
        )
        sentence = f"{checks(failed).capitalize()} failed; {named}."
    elif deviations := immaterial_count(file.results):
        are = "1 is" if deviations == 1 else f"{deviations} are"
        sentence = f"No check found a deviation that matters; {are} measurable and not material."
    else:
        sentence = "No check found a deviation from a correct file."
    rests_on = basis_of_clean(file).removeprefix("clean: ")
    if rests_on:
        sentence = f"{sentence} The verdict {rests_on}."

    conclusive = [result for result in file.results if result.outcome in {"passed", "failed", "warned"}]
    if conclusive:
        complete = sum(
            result.coverage.seen >= result.coverage.of for result in conclusive if result.coverage is not None
        )
        extent = "all of them" if complete == len(conclusive) else f"{complete} of them"
        measured = sum(len(result.measurements) for result in conclusive)
        basis = (
            f"It rests on {checks(len(conclusive))} with {measured} measurements; {extent} covered all of their data."
        )
    else:
        basis = f"None of {checks(len(file.results))} came to a verdict." if file.results else "No check was run."
    canaries = canaries_seen(file)
    if canaries:
        basis = f"{basis} {canaries[:1].upper()}{canaries[1:]}."

    present = [outcome for outcome in OUTCOME_WORDS if outcomes[outcome]]
    widths = [outcomes[outcome] / len(file.results) for outcome in present]
    shares = tuple(
        Share(outcome, OUTCOME_WORDS[outcome], outcomes[outcome], left, width)
        for outcome, left, width in zip(present, accumulate(widths, initial=0.0), widths, strict=False)
    )
    return VerdictText(file.verdict, TITLES[file.verdict], sentence, basis, shares)


def checks(count: int) -> str:
    """Return ``1 check``, ``2 checks``."""
    return f"{count} check" if count == 1 else f"{count} checks"
