"""A comparison in words and tables: the same in the terminal, in markdown and in the report.

A sentence names a direction only where the mean changed significantly at the level of the comparison. A distribution
may differ with an equal mean; then the sentence states its distance.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import erfc, sqrt
from typing import Final

from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.types import (
    Comparison,
    Conclusion,
    Design,
    Difference,
    Moved,
    Pair,
    StatisticChange,
    Versions,
)
from fedora_qa.record.latex import LATEX_NEEDS, latex_table
from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.tables import ABSENT, TextTable
from fedora_qa.record.wording import OUTCOME_WORDS, capitalised, number, with_error, with_unit

_FLOW: Final = "flow_"

_MOST_STATISTICS: Final = 3
_MOST_RULES: Final = 3

CONCLUSION_WORDS: Final[dict[Conclusion, str]] = {
    "differs": "differs",
    "no_difference_seen": "no difference detected",
    "identical": "identical",
    "not_told": "too few samples",
}
MOVED_WORDS: Final[dict[Moved, str]] = {
    "moved": "moved",
    "within_error": "within its error",
    "changed": "changed, no error known",
}
DESIGN_WORDS: Final[dict[Design, str]] = {
    "versions": "two versions of the same files, moment by moment",
    "sequences": "two sequences",
    "datasets": "two datasets, file by file",
}

_ROWS_SHOWN: Final = 60


@dataclass(frozen=True, slots=True)
class QuantityWords:
    """A quantity in a sentence: its name, and the verb phrase of a subject whose mean is higher, or lower."""

    name: str
    higher: str
    lower: str


_WORDS: Final[Mapping[str, QuantityWords]] = {
    "depth_m": QuantityWords("depth", "has larger depths", "has smaller depths"),
    "luma_dn": QuantityWords("luma", "is brighter", "is darker"),
    "event_rate_per_ms": QuantityWords("event rate", "has more events", "has fewer events"),
    "pixel_interval_ms": QuantityWords(
        "time between events of a pixel", "has longer times between events", "has shorter times between events"
    ),
}


def conclusions_of(comparison: Comparison) -> tuple[str, ...]:
    """Return the conclusions on each subject against the reference, the most serious first; each is a sentence."""
    return tuple(sentence for pair in comparison.pairs for sentence in _of_pair(comparison, pair))


def _of_pair(comparison: Comparison, pair: Pair) -> Iterator[str]:
    reference, name = (comparison.subjects[place].name for place in (pair.before, pair.after))
    sentences = [
        *_changed_findings(name, pair),
        *_changed_distributions(name, reference, pair, comparison.level),
        *_moved_statistics(name, pair),
    ]
    conclusions = [difference.told for difference in pair.differences]
    if not sentences and conclusions:
        if conclusions.count("identical") == len(conclusions):
            yield f"{name} and {reference} have identical distributions."
        elif "no_difference_seen" in conclusions:
            open_count = conclusions.count("not_told")
            rest = f"; {open_count} of {len(conclusions)} distributions have too few independent samples to compare"
            yield f"No difference is detected between {name} and {reference}{rest if open_count else ''}."
        else:
            yield f"Differences between {name} and {reference} cannot be detected: too few samples are independent."
    yield from sentences


def _changed_findings(name: str, pair: Pair) -> Iterator[str]:
    findings = pair.versions.findings if pair.versions else ()
    for change, verb in (("new", "has"), ("gone", "no longer has"), ("changed", "changes")):
        rules = dict.fromkeys(finding.code or finding.check for finding in findings if finding.change == change)
        count = sum(finding.change == change for finding in findings)
        if count:
            what = f"{'new ' if change == 'new' else ''}{'finding' if count == 1 else 'findings'}"
            yield f"{name} {verb} {count} {what}: {_listed(list(rules))}."


def _changed_distributions(name: str, reference: str, pair: Pair, level: float) -> Iterator[str]:
    by_quantity: dict[str, list[Difference]] = {}
    for difference in pair.differences:
        by_quantity.setdefault(difference.quantity, []).append(difference)
    for quantity, compared in by_quantity.items():
        differing = [difference for difference in compared if difference.told == "differs"]
        words = _words_of(quantity)
        # One file may be brighter and another one darker: each direction is a separate sentence.
        for direction in (1, -1, 0):
            some = [difference for difference in differing if _direction(difference, level) == direction]
            if not some:
                continue
            largest = max(some, key=lambda difference: difference.distance)
            what = {1: words.higher, -1: words.lower, 0: f"has another distribution of {words.name}"}[direction]
            where = ""
            if len(compared) > 1:
                where = f" in {len(some)} of {len(compared)} files"
                where += f", most in {largest.file}" if len(some) > 1 else f", {largest.file}"
            yield f"{name} {what}{where}: {_numbers(largest, words, reference, direction)}."


def _numbers(difference: Difference, words: QuantityWords, reference: str, direction: int) -> str:
    means = (
        f"mean {words.name} {number(difference.mean_after)} against "
        f"{with_unit(difference.mean_before, difference.unit)} in {reference}"
    )
    if direction:
        shift = difference.mean_after - difference.mean_before
        return f"{means}, a shift of {with_error(shift, difference.shift_standard_error, difference.unit)}"
    distance = with_error(difference.distance, difference.distance_standard_error, difference.unit)
    return f"the distance is {distance}, with {means}"


def _direction(difference: Difference, level: float) -> int:
    """Return the sign of a shift of the mean whose probability by chance is at most ``level``; else 0."""
    shift, error = difference.mean_after - difference.mean_before, difference.shift_standard_error
    if error is None or shift == 0:
        return 0
    # P(|z| > x) = erfc(x / sqrt 2) of a normal shift; without an error any shift is significant.
    chance = erfc(abs(shift) / (error * sqrt(2))) if error else 0.0
    return (1 if shift > 0 else -1) if chance <= level else 0


def _moved_statistics(name: str, pair: Pair) -> Iterator[str]:
    moved = [change for change in (pair.versions.statistics if pair.versions else ()) if change.moved == "moved"]
    for change in moved[:_MOST_STATISTICS]:
        yield f"{name}, {change.file}: {_moved_words(change)}."
    if len(moved) > _MOST_STATISTICS:
        yield f"{name}: {len(moved) - _MOST_STATISTICS} more statistics changed beyond their errors."


def _moved_words(change: StatisticChange) -> str:
    words = f"{change.statistic} is {number(change.after)} against {number(change.before)}"
    if change.after is None or change.before is None:
        return words
    return f"{words}, a difference of {with_error(change.after - change.before, change.standard_error, '')}"


def _words_of(quantity: str) -> QuantityWords:
    if quantity.startswith(_FLOW):
        rate = quantity.removeprefix(_FLOW).removesuffix("hz")
        return QuantityWords(f"flow at {rate} Hz", f"has larger flow at {rate} Hz", f"has smaller flow at {rate} Hz")
    return _WORDS.get(quantity, QuantityWords(quantity, f"has more {quantity}", f"has less {quantity}"))


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_RULES} more" if len(names) > _MOST_RULES else ""
    return f"{', '.join(names[:_MOST_RULES])}{more}"


@dataclass(frozen=True, slots=True)
class PairTables:
    """The tables of one subject against the reference, with a title and a summary of one line."""

    title: str
    summary: str
    tables: tuple[TextTable, ...]


def headline(comparison: Comparison) -> str:
    """Return how many distributions were compared, and the conclusions, in one line."""
    conclusions = [difference.told for pair in comparison.pairs for difference in pair.differences]
    parts = [
        f"{conclusions.count(kind)} {words}" for kind, words in CONCLUSION_WORDS.items() if conclusions.count(kind)
    ]
    return (
        f"{len(conclusions)} distributions compared: {', '.join(parts)}"
        if conclusions
        else "No distributions to compare"
    )


def false_alarm_sentence(comparison: Comparison) -> str:
    """Return which false-alarm rate all comparisons share."""
    return (
        f"{comparison.tests} comparisons share a false-alarm rate of {comparison.false_alarm_rate:g}: each is made at "
        f"{comparison.level:.2g}."
    )


def pair_tables(comparison: Comparison) -> tuple[PairTables, ...]:
    """Return the tables of each subject against the reference."""
    pairs: list[PairTables] = []
    for pair in comparison.pairs:
        before, after = (comparison.subjects[place].name for place in (pair.before, pair.after))
        tables, parts = [_distances(pair)], [f"Compared as {DESIGN_WORDS[pair.design]}."]
        versions = pair.versions
        if versions:
            tables += _version_tables(versions)
            parts.append(f"{_files(versions.matched)} in both.")
            changes = [finding.change for finding in versions.findings]
            counts = ", ".join(f"{changes.count(kind)} {kind}" for kind in ("new", "gone", "changed"))
            parts.append(
                f"Findings in {_files(versions.checked)} checked in both: {counts}, {versions.unchanged_findings} "
                "unchanged."
                if versions.checked
                else "Findings are not compared: both sides must be records of a check."
            )
            for label, names in (("Files gone", versions.gone), ("New files", versions.new)):
                if names:
                    parts.append(f"{label}: {', '.join(names)}.")
        shown_tables = tuple(source for source in tables if source.rows)
        pairs.append(PairTables(f"{after} against {before}", " ".join(parts), shown_tables))
    return tuple(pairs)


def comparison_to_markdown(comparison: Comparison) -> str:
    """Return a comparison as GitHub-flavoured markdown."""
    parts = ["# Comparison", f"**{escape(headline(comparison))}**. {escape(false_alarm_sentence(comparison))}"]
    parts += [f"- {escape(sentence)}" for sentence in conclusions_of(comparison)]
    parts += [f"- {escape(note)}" for note in comparison.notes]
    for pair in pair_tables(comparison):
        parts += [
            f"## {escape(pair.title)}",
            escape(pair.summary),
            *(table_section(source, 3) for source in pair.tables),
        ]
    parts += ["## Tables of the paper", *(table_section(source, 3) for source in paper_tables(comparison))]
    return "\n\n".join([*parts, f"<sub>{escape(f'{comparison.tool.name} {comparison.tool.version}')}</sub>"]) + "\n"


def tables_to_latex(tables: Iterable[TextTable]) -> str:
    """Return tables as LaTeX, to be put into a paper."""
    parts = [latex_table(source.title, source.head, source.rows, source.note) for source in tables]
    return "\n\n".join([LATEX_NEEDS, *parts]) + "\n"


def _distances(pair: Pair) -> TextTable:
    head = (
        "quantity",
        "unit",
        "mean before",
        "mean after",
        "shift",
        "distance",
        "chance exceeds 1 in 20",
        "chance",
        "answer",
    )
    by_file = any(difference.file for difference in pair.differences)
    rows = tuple(
        (
            *((difference.file,) if by_file else ()),
            difference.quantity,
            difference.unit,
            number(difference.mean_before),
            number(difference.mean_after),
            with_error(difference.mean_after - difference.mean_before, difference.shift_standard_error, ""),
            with_error(difference.distance, difference.distance_standard_error, ""),
            ABSENT if difference.distance_by_chance is None else number(difference.distance_by_chance),
            ABSENT if difference.chance is None else f"{difference.chance:.2g}",
            CONCLUSION_WORDS[difference.told],
        )
        for difference in pair.differences
    )
    reasons = dict.fromkeys(difference.reason for difference in pair.differences if difference.reason)
    note = " ".join(
        [
            "Shift of the mean and Wasserstein distance, with standard errors where enough can be drawn again; chance: "
            "the share of exchanges between both sides that leave them as far apart.",
            *(f"{capitalised(reason)}." for reason in reasons),
        ]
    )
    return TextTable("Distributions", (*(("file",) if by_file else ()), *head), rows, note)


def _files(number: int) -> str:
    return f"{number} file{'' if number == 1 else 's'}"


def _version_tables(versions: Versions) -> Iterator[TextTable]:
    findings = [
        (change.file, change.change, change.code or change.check, change.stream or ABSENT,
         " → ".join(dict.fromkeys(word for word in (change.severity_before, change.severity_after) if word)),
         change.message_after or change.message_before)
        for change in versions.findings
    ]  # fmt: skip
    yield _first_rows("Findings", ("file", "change", "rule", "stream", "severity", "finding"), findings, words=6)
    outcomes = [
        (
            change.file,
            change.check,
            *(ABSENT if word is None else OUTCOME_WORDS[word] for word in (change.before, change.after)),
        )
        for change in versions.outcomes
    ]
    yield _first_rows("Checks that end otherwise", ("file", "check", "before", "after"), outcomes, words=4)
    moved = [
        (
            change.file,
            f"{change.check} {change.name}",
            change.unit,
            number(change.before),
            number(change.after),
            number(change.allowed),
        )
        for change in versions.measurements
    ]
    note = "Two correct versions differ by no more than is allowed, at the false-alarm rate of a check."
    yield _first_rows(
        "Measured values that moved", ("file", "measured", "unit", "before", "after", "allowed"), moved, 3, note
    )
    # Statistics that moved beyond their error come first, because only the first rows are printed.
    statistics = []
    for changed in sorted(versions.statistics, key=lambda item: ("moved", "within_error", "changed").index(item.moved)):
        before, after = changed.before, changed.after
        difference = ABSENT
        if before is not None and after is not None:
            difference = with_error(after - before, changed.standard_error, "")
        statistics.append(
            (
                changed.file,
                changed.statistic,
                MOVED_WORDS[changed.moved],
                ABSENT if before is None else number(before),
                ABSENT if after is None else number(after),
                difference,
                ABSENT if changed.chance is None else f"{changed.chance:.2g}",
            )
        )
    head = ("file", "statistic", "moved", "before", "after", "difference", "chance")
    yield _first_rows("Statistics that are not the same", head, statistics, words=3)


def _first_rows(
    title: str, head: tuple[str, ...], rows: Sequence[tuple[str, ...]], words: int, note: str = ""
) -> TextTable:
    more = f"And {len(rows) - _ROWS_SHOWN} more, in the JSON." if len(rows) > _ROWS_SHOWN else ""
    return TextTable(title, head, tuple(rows[:_ROWS_SHOWN]), " ".join(part for part in (note, more) if part), words)
