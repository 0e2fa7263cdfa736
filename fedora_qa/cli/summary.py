"""The summary in the terminal after a check; ``fedora-qa report``, which shows a stored record again.

Checks, findings, causes with remedies, and last the verdict: what a reader needs first stands last, where a terminal
shows it without scrolling.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

import click
from numpy.typing import NDArray
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.console import text
from fedora_qa.cli.outputs import Outputs
from fedora_qa.errors import MisuseError
from fedora_qa.record.ci import record_to_github, silenced
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import Diagnosis, FileRecord, Outcome, Record, Result, Severity, Verdict, gravest_verdict
from fedora_qa.record.wording import (
    OUTCOME_WORDS,
    basis_of_clean,
    canaries_seen,
    cause_sentence,
    check_cells,
    explained_checks,
    findings_of,
    identity,
    number,
    place,
    reasons,
    status_sentence,
    tally,
    unobeyed,
    why_incomplete,
)

_VERDICT_STYLES: Final[Mapping[Verdict, str]] = {
    "clean": "bold green",
    "findings": "bold red",
    "incomplete": "bold magenta",
}
_OUTCOME_STYLES: Final[Mapping[Outcome, str]] = {
    "failed": "bold red",
    "crashed": "bold magenta",
    "warned": "yellow",
    "passed": "green",
    "not_observable": "dim",
    "not_applicable": "dim",
}
_SEVERITY_STYLES: Final[Mapping[Severity, str]] = {
    "critical": "bold red",
    "error": "red",
    "warning": "yellow",
    "info": "dim",
}

_WIDE: Final = 110
"""Columns from which the checks fit into a table of one line each."""
_FINDINGS_SHOWN: Final = 12
_SLOWEST_SHOWN: Final = 3

Detail = Literal["quiet", "normal", "verbose"]
"""``quiet``: a line a file; ``normal``: the passed checks of a subject in one line; ``verbose``: every check with its
numbers."""


def print_record(record: Record, outputs: Outputs, detail: Detail = "normal") -> None:
    """Print the summary, and annotations for GitHub if requested; GitHub obeys no command that a file contains."""
    console = outputs.console()
    if not outputs.summary:
        click.echo(record_to_github(record), nl=False)
        return
    if not outputs.github:
        show_record(console, record, detail)
        return
    # Captured whole, because GitHub obeys commands in any line that is printed outside the silenced part.
    with console.capture() as captured:
        show_record(console, record, detail)
    click.echo(silenced(captured.get()) + record_to_github(record), nl=False, err=console.stderr)


def show_record(console: Console, record: Record, detail: Detail = "normal") -> None:
    """Print the record of one or more files."""
    if detail != "quiet":
        for file in record.files:
            console.print(Group(*_details(file, console.width, detail)))
            if len(record.files) > 1:
                console.print(Group(*_verdict(file), Text()))
        console.print(Group(*(text(line, "dim") for line in _run_lines(record)), Text()))
        if len(record.files) == 1:
            console.print(Group(*_verdict(record.files[0])))
            return
    rows = [(file.verdict, text(file.path), text(_first_words(file))) for file in record.files]
    if console.is_terminal:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
        table.add_column(no_wrap=True)
        table.add_column(overflow="fold")
        table.add_column(overflow="fold")
        for verdict, path, first in rows:
            table.add_row(Text(verdict, style=_VERDICT_STYLES[verdict]), path, first)
        console.print(table)
    else:
        # Programs that read a pipe rely on one line a file, however long.
        verdict_width, path_width = (max((len(row[column]) for row in rows), default=0) for column in (0, 1))
        for verdict, path, first in rows:
            path.pad_right(path_width - len(path))
            console.print(Text(f"{verdict:<{verdict_width}}  ") + path + Text("  ") + first, soft_wrap=True)
    if len(record.files) > 1 and detail != "quiet":
        console.print(Group(Text(), _common_verdict(record.files)))


def run_report(record_path: Path, outputs: Outputs, detail: Detail) -> int:
    """Run the command and return its exit code."""
    # The record and its arrays are inputs, even where no picture is drawn from them.
    outputs.require_writable([record_path, arrays_beside(record_path)])
    record = read_record(record_path)
    arrays: Mapping[str, NDArray[Any]] = {}
    if outputs.html and any(file.evidence for file in record.files):
        try:
            arrays = read_arrays(arrays_beside(record_path))
        except MisuseError as problem:
            # A warning, not misuse: verdict, findings and tables need no arrays.
            click.echo(f"fedora-qa: {unobeyed(str(problem))}; the report is drawn without pictures", err=True)
    outputs.write(record, arrays)
    print_record(record, outputs, detail)
    return 0


def _first_words(file: FileRecord) -> str:
    """Return the first cause of a file, or else why it is incomplete, or the number of checks by outcome."""
    return cause_sentence(file.diagnoses[0]) if file.diagnoses else why_incomplete(file) or tally(file.results)


def _common_verdict(files: Sequence[FileRecord]) -> Text:
    """Return the gravest verdict, how many files have it, and the first of them."""
    gravest = gravest_verdict(files)
    paths = [file.path for file in files if file.verdict == gravest]
    count = f"{len(paths)} of {len(files)}" + ("" if gravest == "clean" else f", first {paths[0]}")
    return Text.assemble((f" {gravest.upper()} ", _VERDICT_STYLES[gravest] + " reverse"), "  ", text(count))


def _run_lines(record: Record) -> Iterator[str]:
    """Yield how the record was made: settings, time, traffic, budget, slowest checks."""
    stages, checks, host = record.run.stage_seconds, record.run.check_seconds, record.run.host
    parts = [
        f"{sum(stages.values()):.1f} s",
        # At one decimal a shorter stage would be printed as 0.0 s.
        *(f"{name} {spent:.1f} s" for name, spent in stages.items() if spent > 0.05),
    ]
    settings = f"effort {record.effort}, profile {record.profile}"
    yield f"{record.tool.name} {record.tool.version}, {settings}: {', '.join(parts)}"
    # Bytes and requests from servers, where files lie behind URLs.
    size = sum(file.size for file in record.files)
    transferred, requests = host.get("transferred_bytes"), host.get("requests")
    if isinstance(transferred, int) and requests:
        yield f"transferred {transferred / 1e6:.1f} of {size / 1e6:.1f} MB in {requests} requests"
    # How far a budget of time has carried; nothing without a budget.
    if reached := host.get("budget_reached"):
        yield f"{record.effort}: {reached}"
    if slowest := sorted(checks, key=lambda name: -checks[name])[:_SLOWEST_SHOWN]:
        yield "slowest checks: " + ", ".join(f"{name} {checks[name]:.1f} s" for name in slowest)


def _verdict(file: FileRecord) -> Iterator[RenderableType]:
    """Yield the verdict of a file and what it rests on."""
    yield text(tally(file.results))
    if basis_of_clean(file):
        yield text(basis_of_clean(file))
    if canaries_seen(file):
        yield text(canaries_seen(file))
    yield text(identity(file), "dim")
    if why_incomplete(file):
        yield text(f"incomplete: {why_incomplete(file)}", _VERDICT_STYLES["incomplete"])
    yield Text.assemble(
        (f" {file.verdict.upper()} ", _VERDICT_STYLES[file.verdict] + " reverse"), "  ", text(file.path)
    )


def _details(file: FileRecord, width: int, detail: Detail) -> Iterator[RenderableType]:
    checks = [*(_checks if detail == "verbose" else _folded_checks)(file.results, width)] if file.results else []
    if checks:
        yield Text("Checks", style="bold")
        yield from checks
        yield Text()
    if reasons(file.results):
        yield from _section("Reasons", [text(reason) for reason in reasons(file.results)])
    if file.inferred:
        # Of declarations only how many each makes: `fedora-qa layout` and the record have them one by one.
        made = [str(v).partition(": ")[0] for name, v in file.inferred.items() if name.startswith("declared.")]
        inferred = [
            f"{name} {number(v) if isinstance(v, float) else v}"
            for name, v in file.inferred.items()
            if not name.startswith("declared.")
        ]
        inferred += [f"{count} declarations by {origin}" for origin, count in Counter(made).items()]
        yield Text.assemble(("Inferred  ", "bold"), text("; ".join(inferred)))
        yield Text()
    findings = findings_of(file)
    if findings:
        blocks: list[RenderableType] = []
        for result, finding in findings[:_FINDINGS_SHOWN]:
            head = Text.assemble(
                (f"{finding.id}  ", "bold"),
                (finding.severity, _SEVERITY_STYLES[finding.severity]),
                "  ",
                text(finding.code or result.check),
            )
            if place(finding.where):
                head.append_text(text(f"  {place(finding.where)}", "dim"))
            blocks.append(Group(head, Padding(text(finding.message), (0, 0, 0, 4), expand=False)))
        if len(findings) > _FINDINGS_SHOWN:
            more = len(findings) - _FINDINGS_SHOWN
            blocks.append(Text(f"... and {more} more: write them all with --json", style="dim"))
        yield from _section("Findings", blocks)
    if file.diagnoses:
        yield from _section("Probable causes", [_diagnosis(diagnosis, file) for diagnosis in file.diagnoses])


def _section(title: str, blocks: Sequence[RenderableType]) -> Iterator[RenderableType]:
    yield Text(title, style="bold")
    for block in blocks:
        yield Padding(block, (0, 0, 0, 2), expand=False)
    yield Text()


def _diagnosis(diagnosis: Diagnosis, file: FileRecord) -> RenderableType:
    head = Text.assemble((f"{diagnosis.id}  ", "bold"), text(cause_sentence(diagnosis), "bold"))
    details = Table.grid(padding=(0, 2))
    details.add_column(style="dim", no_wrap=True)
    details.add_column(overflow="fold")
    details.add_row("cause", text(f"{diagnosis.stream}:{diagnosis.cause}"))
    details.add_row("known by", text(status_sentence(diagnosis)))
    if place(diagnosis.where):
        details.add_row("where", text(place(diagnosis.where)))
    details.add_row("remedy", text(diagnosis.remedy))
    if explained := ", ".join(explained_checks(diagnosis, file)):
        details.add_row("explains", text(f"{explained} ({', '.join(diagnosis.explains)})"))
    return Group(head, Padding(details, (0, 0, 0, 4), expand=False))


def _checks(results: Sequence[Result], width: int) -> Iterator[RenderableType]:
    """Yield a table of the checks, or in a narrow terminal its content as a few short lines for each check."""
    if width >= _WIDE:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for name in ("check", "outcome"):
            table.add_column(name, no_wrap=True)
        table.add_column("measured", overflow="fold")
        for name in ("expected", "sees from"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("coverage", overflow="fold")
        for result in results:
            table.add_row(text(result.check), _outcome(result), *(text(cell) for cell in check_cells(result)))
        yield table
        return
    for result in results:
        measured, expected, least, coverage = check_cells(result)
        parts = [measured, f"expected {expected}" if expected else "", f"sees from {least}" if least else "", coverage]
        yield Text.assemble(_outcome(result), "  ", text(result.check))
        if any(parts):
            yield Padding(text("; ".join(filter(None, parts)), "dim"), (0, 0, 0, 4), expand=False)


def _folded_checks(results: Sequence[Result], width: int) -> Iterator[RenderableType]:
    """Yield the passed checks of each subject in one line, and every other check that applies with its numbers."""
    passed: dict[str, list[str]] = {}
    for result in results:
        subject, _, question = result.check.partition(".")
        if result.outcome == "passed":
            passed.setdefault(subject, []).append(question or subject)
    for subject, questions in passed.items():
        yield Text.assemble(("passed", _OUTCOME_STYLES["passed"]), "  ", text(f"{subject}: {', '.join(questions)}"))
    others = [result for result in results if result.outcome not in {"passed", "not_applicable"}]
    if others:
        # What failed stands last, nearest to its findings.
        yield from _checks(sorted(others, key=lambda result: result.outcome in {"failed", "crashed"}), width)


def _outcome(result: Result) -> Text:
    return Text(OUTCOME_WORDS[result.outcome], style=_OUTCOME_STYLES[result.outcome])
