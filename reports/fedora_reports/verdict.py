"""The verdict of a file in words, and what it rests on."""

from collections import Counter
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

from fedora_qa.record.types import FileRecord, Outcome, Result, Verdict
from fedora_qa.record.wording import OUTCOME_WORDS, canaries_seen, why_incomplete

TITLES: Final[dict[Verdict, str]] = {"clean": "Clean", "findings": "Findings", "incomplete": "Incomplete"}


@dataclass(frozen=True, slots=True)
class Share:
    """How many checks had one outcome, and where they lie on a bar of all; ``left`` and ``width`` are shares."""

    outcome: Outcome
    word: str
    count: int
    left: float
    width: float


@dataclass(frozen=True, slots=True)
class VerdictWords:
    """The verdict, one sentence that says why, and what was looked at."""

    verdict: Verdict
    title: str
    sentence: str
    rests_on: str
    shares: tuple[Share, ...]


def verdict_of(file: FileRecord) -> VerdictWords:
    """Return the verdict of a file in words."""
    canaries = canaries_seen(file)
    rests_on = (
        f"{_rests_on(file.results)} {canaries[:1].upper()}{canaries[1:]}." if canaries else _rests_on(file.results)
    )
    return VerdictWords(file.verdict, TITLES[file.verdict], _sentence(file), rests_on, _shares(file))


def checks(count: int) -> str:
    """Return ``1 check``, ``2 checks``."""
    return f"{count} check" if count == 1 else f"{count} checks"


def _sentence(file: FileRecord) -> str:
    failed = sum(result.outcome == "failed" for result in file.results)
    if file.verdict == "incomplete":
        more = f" {checks(failed).capitalize()} failed." if failed else ""
        return f"No verdict can be given: {why_incomplete(file)}.{more}"
    if file.verdict == "findings":
        causes = len(file.diagnoses)
        named = {0: "no cause could be named", 1: "one probable cause is named"}.get(
            causes, f"{causes} probable causes are named"
        )
        return f"{checks(failed).capitalize()} failed; {named}."
    return "Nothing that was looked at differs from what an honest file gives."


def _rests_on(results: tuple[Result, ...]) -> str:
    conclusive = [result for result in results if result.outcome in {"passed", "failed", "warned"}]
    covered = [result.coverage for result in conclusive if result.coverage is not None]
    whole = sum(coverage.seen >= coverage.of for coverage in covered)
    measured = sum(len(result.measurements) for result in conclusive)
    if not conclusive:
        return f"None of {checks(len(results))} could tell anything." if results else "No check was run."
    extent = "all of them" if whole == len(conclusive) else f"{whole} of them"
    return f"It rests on {checks(len(conclusive))} with {measured} measurements; {extent} saw all that they asked for."


def _shares(file: FileRecord) -> tuple[Share, ...]:
    counts = Counter(result.outcome for result in file.results)
    present = [outcome for outcome in OUTCOME_WORDS if counts[outcome]]
    ends = list(accumulate((counts[outcome] / len(file.results) for outcome in present), initial=0.0))
    return tuple(
        Share(outcome, OUTCOME_WORDS[outcome], counts[outcome], left, counts[outcome] / len(file.results))
        for outcome, left in zip(present, ends, strict=False)
    )
