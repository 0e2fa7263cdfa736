"""``fedora-qa compare``: sequences, datasets, or two versions of a release side by side."""

from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from fedora_qa.cli.arrays import arrays_beside
from fedora_qa.cli.check import PATH, folders_named
from fedora_qa.cli.compared import read_sources, sources_of
from fedora_qa.cli.output_options import allow_external_option
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.terminal import stdout_console, text
from fedora_qa.comparison.compare import DEFAULT_FALSE_ALARM_RATE
from fedora_qa.comparison.compare import compare as compare_subjects
from fedora_qa.comparison.json_io import comparison_to_json
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.tables import comparison_to_markdown, headline, how_it_is_told, pair_tables
from fedora_qa.comparison.text_table import SOURCE, TextTable
from fedora_qa.comparison.types import Design
from fedora_qa.config import parse_bytes
from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.record.atomic import write_text


@click.command(short_help="Hold sequences, datasets or two versions against each other.")
@click.argument("given", nargs=-1, required=True, type=PATH, metavar="A B...")
@click.option(
    "--as",
    "design",
    type=click.Choice(["versions", "sequences", "datasets"]),
    help="What they are to each other; versions where files have the same names, else what they hold.",
)
@click.option(
    "--false-alarm-rate",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=DEFAULT_FALSE_ALARM_RATE,
    show_default=True,
    help="How often anything at all may be said to differ that does not.",
)
@click.option("--dialect", metavar="NAME|FILE.toml", help="How the files name and scale things; else recognised.")
@click.option("--memory", metavar="AMOUNT", default="1GB", show_default=True, help="Memory to aim at.")
@allow_external_option
@click.option("--json", "json_path", type=PATH, metavar="OUT", help="Write every number.")
@click.option("--html", "html_path", type=PATH, metavar="OUT", help="Write tables and plots, in one HTML file.")
@click.option("--markdown", "markdown_path", type=PATH, metavar="OUT", help="Write the tables.")
def compare(
    given: tuple[Path, ...],
    design: Design | None,
    false_alarm_rate: float,
    dialect: str | None,
    memory: str,
    allow_external: tuple[str, ...],
    json_path: Path | None,
    html_path: Path | None,
    markdown_path: Path | None,
) -> int:
    """Hold B and the others against A: sequences, folders of them, or records that `check --json` wrote.

    Files are measured; records are read, with the arrays beside them, and their findings compared. Exit codes: 0
    compared, whatever came of it; 2 misuse.
    """
    if len(given) < 2:
        raise MisuseError(f"Expected two or more things to compare, got {len(given)}")
    dialect_read = load_dialect(dialect) if dialect else None
    memory_bytes = parse_bytes(memory)
    sources = sources_of(given, dialect_read)
    read = [path for source in sources for path in source.paths]
    # The arrays beside each record are inputs as well: no output may overwrite them.
    Outputs(json_path, markdown_path, html_path).require_writable([*read, *map(arrays_beside, read)])
    comparison = compare_subjects(
        read_sources(sources, dialect_read, memory_bytes, folders_named(allow_external)), design, false_alarm_rate
    )
    if json_path:
        write_text(json_path, comparison_to_json(comparison))
    if markdown_path:
        write_text(markdown_path, comparison_to_markdown(comparison))
    if html_path:
        from fedora_reports.comparison import render_comparison  # noqa: PLC0415 - an extra

        write_text(html_path, render_comparison(comparison))
    console = stdout_console()
    for table in paper_tables(comparison):
        _show_table(table)
    for pair in pair_tables(comparison):
        console.print(text(pair.title, "bold underline"))
        console.print(text(pair.summary))
        console.print()
        for table in pair.tables:
            _show_table(table)
    for note in comparison.notes:
        console.print(text(note, "yellow"))
    console.print(text(headline(comparison), "bold"))
    console.print(text(how_it_is_told(comparison), "dim"))
    return 0


def _show_table(source: TextTable) -> None:
    console = stdout_console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for place, head in enumerate(source.head):
        # Numbers are aligned on the right so that their digits stand below each other; words on the left.
        table.add_column(head, justify="left" if place < source.words or head == SOURCE else "right", overflow="fold")
    for row in source.rows:
        table.add_row(*(text(cell) for cell in row))
    console.print(Text(source.title, style="bold"))
    console.print(table)
    if source.note:
        console.print(text(source.note, "dim"))
    console.print()
