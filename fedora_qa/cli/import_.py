"""``fedora-qa import``: a canonical file from a recording."""

from collections.abc import Iterator
from pathlib import Path

import click

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.host import usable_cores
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.outputs import require_new_file
from fedora_qa.cli.progress import progress_bar
from fedora_qa.engine.executors.executor import Task, Worker
from fedora_qa.importing.recording import Kind, Resolution
from fedora_qa.importing.ros_bag import load_topics
from fedora_qa.importing.run import Imported, ImportOptions, import_recording, recognise
from fedora_qa.record.atomic import staging_path
from fedora_qa.record.wording import unobeyed


def run_import(
    source: Path,
    output: Path,
    resolution: Resolution | None,
    topics: Path | None,
    kind: Kind | None,
    allow_backwards: bool,
    compression: int,
    force: bool,
) -> int:
    """Run the command and return its exit code."""
    require_new_file(output, [source, *([topics] if topics else [])], force=force)
    # Before another process is started.
    recognise(source)
    options = ImportOptions(
        resolution, kind, load_topics(topics) if topics else None, allow_backwards, compression, usable_cores()
    )
    with progress_bar(source.name) as bar, staging_path(output) as written:
        imported: Imported = run_isolated(Task(_import, (source, written, options)), source, None, bar)
        written.replace(output)
    for line in import_lines(imported, output):
        click.echo(unobeyed(line))
    return CLEAN


def import_lines(imported: Imported, output: Path) -> Iterator[str]:
    """Yield what was written, in sentences."""
    rows = ", ".join(f"{stream} {count}" for stream, count in imported.rows.items())
    yield f"{output} is written from {imported.format}; rows: {rows}."
    for name, value in imported.facts.items():
        if isinstance(value, int) and value:
            yield f"    {name}: {value}"
    yield from imported.unread


def _import(source: Path, target: Path, options: ImportOptions, worker: Worker) -> Imported:
    return import_recording(source, target, options, worker.progress)
