"""``fedora-qa import``: a canonical file from a recording."""

import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.options import PATH
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.progress import progress_bar
from fedora_qa.engine.executor import Task
from fedora_qa.engine.worker import Worker
from fedora_qa.errors import MisuseError
from fedora_qa.importing.recognise import recognise
from fedora_qa.importing.recording import Kind, Resolution
from fedora_qa.importing.ros_topics import load_topics
from fedora_qa.importing.run import Imported, ImportOptions, import_recording
from fedora_qa.record.wording import unobeyed

_LARGEST_SIDE = 1 << 14


class ResolutionParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns ``640x480`` into a width and a height."""

    name = "resolution"

    def convert(self, value: str | Resolution, param: click.Parameter | None, ctx: click.Context | None) -> Resolution:
        """Return width and height, px; raises ``MisuseError``."""
        if not isinstance(value, str):
            return value
        sides = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})", value.strip())
        size = (int(sides[1]), int(sides[2])) if sides else (0, 0)
        if not all(0 < side <= _LARGEST_SIDE for side in size):
            raise MisuseError(f"Expected --resolution WxH of 1 to {_LARGEST_SIDE} px each way, got {value!r}")
        return size


@click.command("import")
@click.argument("source", type=PATH)
@click.option("-o", "--output", type=PATH, required=True, metavar="OUT.h5", help="The canonical file.")
@click.option(
    "--resolution", type=ResolutionParam(), metavar="WxH", help="Size of the event camera, where SOURCE lacks it."
)
@click.option(
    "--topics", type=PATH, metavar="FILE.toml", help="Which topic of a bag holds which stream, in a table [topics]."
)
@click.option("--kind", type=click.Choice(["recorded", "synthetic"]), help="Whether sensors made SOURCE.")
@click.option("--allow-backwards", is_flag=True, help="Write timestamps that decrease as they are.")
@click.option("--force", is_flag=True, help="Write over OUT.h5 where it exists.")
def import_(
    source: Path,
    output: Path,
    resolution: Resolution | None,
    topics: Path | None,
    kind: Kind | None,
    allow_backwards: bool,
    force: bool,
) -> int:
    """Write a canonical file from SOURCE, a recording in a format of event cameras.

    SOURCE is a Prophesee recording (EVT2, EVT3 or DAT), AEDAT 4.0, or a bag of ROS 1 or ROS 2. It is only read, in
    blocks. OUT.h5 gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUT.h5 not be written, and nothing is left behind.
    """
    Outputs(own=(output,)).require_writable([source, *([topics] if topics else [])])
    if output.exists():
        # Hard links: two names of one file, neither of which leads to the other.
        if source.exists() and source.samefile(output):
            raise MisuseError(f"Expected an output of its own, got {output}, which is {source}")
        if not force:
            raise MisuseError(f"Expected a new file to write, got {output}, which exists; use --force to write over it")
    # Before another process is started.
    recognise(source)
    options = ImportOptions(resolution, kind, load_topics(topics) if topics else None, allow_backwards)
    # By another process, in a folder that is removed even if that process dies; beside the output, because `replace` is
    # atomic only within one file system.
    with progress_bar(source.name) as bar, TemporaryDirectory(prefix=f".{output.name}.", dir=output.parent) as folder:
        written = Path(folder) / output.name
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


def _import(source: Path, target: Path, options: ImportOptions, worker: Worker) -> Imported:
    return import_recording(source, target, options, worker.progress)
