"""A comparison as tables of text, the same in the terminal, in markdown and in the report."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.comparison.conclusions import conclusions_of
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.types import (
    Comparison,
    Conclusion,
    Design,
    Moved,
    Pair,
    Versions,
)
from fedora_qa.record.latex import LATEX_NEEDS, latex_table
from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.tables import ABSENT, TextTable
from fedora_qa.record.wording import OUTCOME_WORDS, number, with_error

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
            *(f"{reason[:1].upper()}{reason[1:]}." for reason in reasons),
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
