"""``fedora-qa stats``: the sequence and flow tables of the paper, and tables of images and rates."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from fedora_qa import __version__
from fedora_qa.cli.apart import apart
from fedora_qa.cli.check import PATH, folders_named, require_hdf5
from fedora_qa.cli.output_options import allow_external_option
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.stats_tables import NOTES, StatsTable, tables_of
from fedora_qa.cli.terminal import stdout_console, text
from fedora_qa.config import parse_bytes
from fedora_qa.engine.opening import require_end_of_opening
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.statistics import collect_statistics
from fedora_qa.layout.dialect import Dialect, load_dialect
from fedora_qa.record.atomic import write_text
from fedora_qa.record.markdown import escape, table
from fedora_qa.statistics.collector import Statistics


@click.command(short_help="Print the sequence and flow tables of files.")
@click.argument("files", nargs=-1, required=True, type=PATH)
@click.option("--dialect", metavar="NAME|FILE.toml", help="How the files name and scale things; else recognised.")
@click.option("--memory", metavar="AMOUNT", default="1GB", show_default=True, help="Memory to aim at.")
@allow_external_option
@click.option("--json", "json_path", type=PATH, metavar="OUT", help="Write the numbers.")
@click.option("--markdown", "markdown_path", type=PATH, metavar="OUT", help="Write the tables.")
def stats(
    files: tuple[Path, ...],
    dialect: str | None,
    memory: str,
    allow_external: tuple[str, ...],
    json_path: Path | None,
    markdown_path: Path | None,
) -> int:
    """Print what FILES are like: duration, distance, greatest speeds, event rate, flow, depth, brightness."""
    dialect_read = load_dialect(dialect) if dialect else None
    memory_bytes = parse_bytes(memory)
    Outputs(json_path, markdown_path).require_writable(files)
    require_hdf5(files)
    folders = folders_named(allow_external)
    by_file = {str(path): _statistics_of(path, dialect_read, memory_bytes, folders) for path in files}
    tables = tables_of(by_file)
    if json_path:
        write_text(json_path, _as_json(by_file))
    if markdown_path:
        write_text(markdown_path, _as_markdown(tables))
    console = stdout_console()
    for source in tables:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column(source.head[0], overflow="fold")
        for head in source.head[1:]:
            table.add_column(head, justify="right", overflow="fold")
        for row in source.rows:
            table.add_row(*(text(cell) for cell in row))
        console.print(Text(source.title, style="bold"))
        console.print(table)
        console.print()
    console.print(text(NOTES, "dim"))
    return 0


def _statistics_of(
    path: Path, dialect: Dialect | None, memory_bytes: int, allow_external: tuple[Path, ...]
) -> Statistics:
    with progress_bar(path.name) as report:
        return apart(partial(_counted, path, dialect, memory_bytes, allow_external), path, report)


def _counted(
    path: Path, dialect: Dialect | None, memory_bytes: int, allow_external: tuple[Path, ...], progress: Progress
) -> Statistics:
    require_end_of_opening(path, dialect, allow_external)
    return collect_statistics(path, dialect, memory_bytes, progress, allow_external)


def _as_json(by_file: Mapping[str, Statistics]) -> str:
    tool = {"name": "fedora-qa", "version": __version__}
    files = [{"path": path, "statistics": statistics} for path, statistics in by_file.items()]
    # NaN is no JSON: an error here is better than a document that other parsers refuse.
    return json.dumps({"tool": tool, "files": files}, indent=1, allow_nan=False) + "\n"


def _as_markdown(tables: Sequence[StatsTable]) -> str:
    sections = [f"## {source.title}\n\n{table(source.head, source.rows)}" for source in tables]
    return "\n\n".join([*sections, escape(NOTES)]) + "\n"
