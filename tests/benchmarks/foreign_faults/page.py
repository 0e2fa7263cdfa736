"""The page of the study."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, get_args

from scipy.stats import binomtest

from fedora_qa.record.types import DiagnosisStatus
from tests.benchmarks.foreign.scenes import Size
from tests.benchmarks.foreign_faults.kind import LAST_ROUND, Kind
from tests.benchmarks.foreign_faults.outcome import Outcome

CONFIDENCE: Final = 0.95
ORDINALS: Final = (
    "first", "second", "third", "fourth", "fifth", "sixth",
    "seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth",
)  # fmt: skip
"""Of rounds."""

HEAD: Final = """\
# Real faults planted by other code

Written by `make study-named-foreign`, {date}: {files} files with {kinds} kinds of faults, over {scenes},
{width}x{height} pixels, {duration:g} s, {seeds} sequence(s) of a scene. `tests/benchmarks/foreign_faults` shares no
code, place or size with the faults that the generator plants. Sizes are log-uniform within the range of their kind. A
third of the first round and all of the second to seventh were held out until 2026-11-27, and the eighth to twelfth
until 2026-11-28; they have been looked at since. [What each round gave before](measured.md#held-out-rounds) is stated
apart. Kinds of the last round, the {last_round}, stand in rows of their own, and no outcome of theirs is listed.

Kinds of the first five rounds were made up, each round unlike those before it. Those of the sixth follow public reports
of faults, in the proportion in which they were met: 65 of 68 cite an issue or a pull request. Those of the seventh to
tenth are mistakes that are made where data of simulators, recordings and other formats are ported. Those of the
eleventh follow public reports again, and each cites one. Those of the twelfth are the causes of the tool themselves,
each planted by code that knows only the page of the cause.

- *Found*: at least one check failed.
- *Named first*: the first diagnosis has the right cause and stream. The share is of the files that were found.
- *No name*: none of the tool's causes describes the fault. To name none is then right.
- *Two faults*: named first if the first diagnosis is one of the two. *All with a name* and *whole-file* include them.

| kinds | | kinds | files | found | share | named first | share | true share, {confidence:.0%} | first or second |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""

TABLE: Final = """
## {title}

| kind | real pipeline | size | place | true cause | files | found | named first | {second} | named instead |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""

BY_STATUS: Final = """
## How often each status is right

First diagnoses of all files that name a cause, by their status.

| kinds | status | diagnoses | right | share | true share, {confidence:.0%} |
| --- | --- | --- | --- | --- | --- |
"""

Files = Mapping[str, Sequence[Outcome]]
"""Outcomes by the name of their kind."""


def page(kinds: Sequence[Kind], outcomes: Sequence[Outcome], size: Size) -> Iterator[str]:
    """Text of docs/named-foreign.md, of the kinds that were looked at."""
    files = {kind.name: [outcome for outcome in outcomes if outcome.kind == kind.name] for kind in kinds}
    yield HEAD.format(
        date=time.strftime("%Y-%m-%d"),
        files=len(outcomes),
        kinds=len(kinds),
        scenes=", ".join(dict.fromkeys(outcome.scene for outcome in outcomes)),
        seeds=len({outcome.seed for outcome in outcomes}),
        width=size.width,
        height=size.height,
        duration=size.duration_s,
        confidence=CONFIDENCE,
        last_round=ORDINALS[LAST_ROUND - 1],
    )
    groups = {
        "looked at": [kind for kind in kinds if not kind.held_out],
        "held out": [kind for kind in kinds if kind.held_out],
    }
    for title, group in groups.items():
        yield from _totals(title, group, files)
    yield "\nGoal: 90% of the faults that are found are named first.\n"
    for title, group in groups.items():
        for suffix, rows in {
            "": [kind for kind in group if kind.truth and not kind.composite],
            ", two faults": [kind for kind in group if kind.composite],
            ", no name": [kind for kind in group if not kind.truth],
        }.items():
            if rows:
                second = "both named" if suffix == ", two faults" else "second"
                yield TABLE.format(title=title.capitalize() + suffix, second=second)
                # Whoever reads the page must not see how held-out kinds fail.
                yield from (_row(kind, None if kind.held_out else files[kind.name]) for kind in rows)
    yield BY_STATUS.format(confidence=CONFIDENCE)
    for title, group in groups.items():
        yield from _by_status(title, group, files)
    yield from _debatable(kinds)
    crashes = [f"- {x.kind}, {x.scene}, seed {x.seed}: {', '.join(x.crashed)}\n" for x in outcomes if x.crashed]
    if crashes:
        yield "\n## Crashed checks\n\n"
        yield from crashes


def _totals(title: str, kinds: Sequence[Kind], files: Files) -> Iterator[str]:
    for name, chosen in {
        "all with a name": [kind for kind in kinds if kind.truth],
        "whole-file": [kind for kind in kinds if kind.truth and not kind.local],
        "local": [kind for kind in kinds if kind.truth and kind.local],
        "two faults": [kind for kind in kinds if kind.composite],
        "no name": [kind for kind in kinds if not kind.truth],
    }.items():
        count = sum(len(files[kind.name]) for kind in chosen)
        detected = [(kind, outcome) for kind in chosen for outcome in files[kind.name] if outcome.is_found]
        if not detected:
            continue
        first = sum(outcome.is_first_right(kind) for kind, outcome in detected)
        either = sum(outcome.is_first_right(kind) or outcome.is_second_right(kind) for kind, outcome in detected)
        # Clopper and Pearson, Biometrika 26, 1934.
        bounds = binomtest(first, len(detected)).proportion_ci(CONFIDENCE, method="exact")
        yield (
            f"| {title} | {name} | {len(chosen)} | {count} | {len(detected)} | {len(detected) / count:.0%} | {first} "
            f"| {first / len(detected):.0%} | {bounds.low:.0%} to {bounds.high:.0%} | {either / len(detected):.0%} |\n"
        )


def _row(kind: Kind, outcomes: Sequence[Outcome] | None) -> str:
    """Return the row of a kind; without outcomes the columns of these are empty."""
    size = "" if kind.size is None else f"{kind.size.low:g} to {kind.size.high:g} {kind.size.unit}"
    truth = (" and " if kind.composite else " or ").join(kind.truth) or "none"
    described = f"| {kind.name} | {kind.pipeline} | {size} | {'local' if kind.local else 'whole'} | {truth} "
    if outcomes is None:
        return f"{described}| | | | | |\n"
    detected = [outcome for outcome in outcomes if outcome.is_found]
    first = sum(outcome.is_first_right(kind) for outcome in detected)
    second = sum(
        outcome.are_all_named(kind) if kind.composite else outcome.is_second_right(kind) for outcome in detected
    )
    instead = Counter(
        outcome.diagnoses[0].name if outcome.diagnoses else "nothing"
        for outcome in detected
        if not outcome.is_first_right(kind)
    )
    named = ", ".join(f"{name} {count}" for name, count in instead.most_common())
    return f"{described}| {len(outcomes)} | {len(detected)} | {first} | {second} | {named} |\n"


def _by_status(title: str, kinds: Sequence[Kind], files: Files) -> Iterator[str]:
    stated = [
        (outcome.first.status, outcome.is_first_right(kind))
        for kind in kinds
        for outcome in files[kind.name]
        if outcome.first is not None
    ]
    for status in get_args(DiagnosisStatus):
        right = [is_right for stated_status, is_right in stated if stated_status == status]
        if right:
            bounds = binomtest(sum(right), len(right)).proportion_ci(CONFIDENCE, method="exact")
            yield (
                f"| {title} | {status} | {len(right)} | {sum(right)} | {sum(right) / len(right):.0%} "
                f"| {bounds.low:.0%} to {bounds.high:.0%} |\n"
            )


def _debatable(kinds: Sequence[Kind]) -> Iterator[str]:
    disputed = [kind for kind in kinds if kind.debatable]
    if disputed:
        yield "\n## Truths that may be disputed\n\n"
    yield from (f"- {kind.name} ({' or '.join(kind.truth) or 'none'}): {kind.debatable}.\n" for kind in disputed)
