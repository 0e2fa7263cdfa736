"""The record as markdown, for a pull request. All text that comes from a file is escaped."""

import re
from collections.abc import Iterable

from fedora_qa.record.tables import TextTable
from fedora_qa.record.types import FileRecord, Record
from fedora_qa.record.wording import (
    OUTCOME_WORDS,
    basis_of_clean,
    canaries_seen,
    cause_sentence,
    check_cells,
    explained_checks,
    findings_of,
    headline,
    identity,
    place,
    printable,
    reasons,
    status_sentence,
    tally,
    why_incomplete,
)

# Includes `$` (formulas), `~` (strikethrough) and `#` (issues) of GitHub, beside the marks of CommonMark.
_SPECIAL = re.compile(r"([\\`*_\[\]<>|~#&$])")
# GitHub turns bare `https://` and `www.` into links.
_LINK = re.compile(r"(:)(?=//)|(?<=www)(\.)")


def record_to_markdown(record: Record) -> str:
    """Return the record as GitHub-flavoured markdown."""
    effort = f", effort {record.effort}" if record.effort else ""
    rules = f"ruleset {record.ruleset_version}, profile {record.profile}"
    foot = f"{record.tool.name} {record.tool.version}, {rules}{effort}"
    sections = [_file_section(file) for file in record.files]
    overview: list[str] = []
    if len(record.files) > 1:
        columns = ("file", "verdict", "checks", "most probable cause")
        rows = [
            (file.path, file.verdict, tally(file.results), *map(cause_sentence, file.diagnoses[:1]))
            for file in record.files
        ]
        overview = [table(columns, (row + ("",) * (len(columns) - len(row)) for row in rows))]
    return "\n\n".join([*overview, *sections, f"<sub>{escape(foot)}</sub>"]) + "\n"


def escape(text: str) -> str:
    """Return text that markdown shows as it is: no markup, HTML, link, or mention of a person."""
    escaped = _SPECIAL.sub(r"\\\1", printable(text))
    escaped = _LINK.sub(lambda match: "\\" + match[0], escaped)
    # GitHub has no escape for a mention; a character of no width after the sign breaks the name.
    return escaped.replace("@", "@\N{ZERO WIDTH SPACE}")


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a markdown table; cells are escaped."""
    head = tuple(head)
    lines = [_row(head), _row("---" for _ in head)]
    return "\n".join([*lines, *(_row(escape(cell) for cell in row) for row in rows)])


def table_section(source: TextTable, level: int = 2) -> str:
    """Return a table of text below its title, a heading of a level, and above its note."""
    heading = f"{'#' * level} {escape(source.title)}"
    return f"{heading}\n\n{table(source.head, source.rows)}\n\n{escape(source.note)}".rstrip()


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _file_section(file: FileRecord) -> str:
    head = [
        f"**{escape(headline(file))}**",
        escape(why_incomplete(file)),
        escape(basis_of_clean(file)),
        escape(canaries_seen(file)),
        escape(identity(file)),
    ]
    parts = [f"## {escape(file.path)}", "  \n".join(line for line in head if line)]
    causes: list[str] = []
    for diagnosis in file.diagnoses:
        explains = ", ".join((*explained_checks(diagnosis, file), *diagnosis.explains))
        where = place(diagnosis.where)
        causes += [
            f"- **{escape(cause_sentence(diagnosis))}**",
            f"  - cause: {escape(f'{diagnosis.stream}:{diagnosis.cause}')}",
            f"  - known by: {escape(status_sentence(diagnosis))}",
            *([f"  - where: {escape(where)}"] if where else []),
            f"  - remedy: {escape(diagnosis.remedy)}",
            *([f"  - explains: {escape(explains)}"] if explains else []),
        ]
    if causes:
        parts += ["### Probable causes", "\n".join(causes)]
    findings = findings_of(file)
    if findings:
        lines = [(f.id, f.severity, f.code, f.message, place(f.where)) for _, f in findings]
        parts += ["### Findings", table(("id", "severity", "rule", "finding", "where"), lines)]
    columns = ("check", "outcome", "measured", "expected", "sees from", "coverage")
    rows = [(result.check, OUTCOME_WORDS[result.outcome], *check_cells(result)) for result in file.results]
    parts += ["### Checks", table(columns, rows)]
    if reasons(file.results):
        parts.append("\n".join(f"- {escape(reason)}" for reason in reasons(file.results)))
    return "\n\n".join(parts)
