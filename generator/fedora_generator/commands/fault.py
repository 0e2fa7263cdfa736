"""``fedora-generate fault``: plant one fault in a copy of a file."""

import re
from pathlib import Path
from typing import Any

import click

from fedora_generator.completion import CAUSE_NAMES, complete_cause, complete_stream


def _read_region(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int, int, int] | None:
    """Read ``x0,y0,x1,y1``."""
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6})", value)
    if match is None:
        raise click.BadParameter(f"Expected x0,y0,x1,y1 such as 0,0,320,240, got {value!r}")
    left, top, right, bottom = (int(digits) for digits in match.groups())
    return left, top, right, bottom


@click.command(epilog=f"Causes: {', '.join(CAUSE_NAMES)}.")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("cause", shell_complete=complete_cause)
@click.option(
    "--stream",
    shell_complete=complete_stream,
    help="Stream that the fault befalls; events, or the only one that it can befall.",
)
@click.option("--magnitude", type=float, help="Size; positive is too late, or too large. Needed where it has a unit.")
@click.option("--unit", help="Unit of the magnitude; for a time ms unless given.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="For what is placed at random.")
@click.option("--start", "start_s", type=float, help="Confine the fault: seconds after the file's first stamp.")
@click.option("--stop", "stop_s", type=float, help="End of the confinement, not included.")
@click.option(
    "--region",
    callback=_read_region,
    metavar="X0,Y0,X1,Y1",
    help="Confine the fault to this part of the image, the last column and row not included.",
)
@click.option(
    "--direction", "direction_deg", type=float, help="Of a shift of rgb or flow: degrees, clockwise from right."
)
@click.option("--donor", type=click.Path(path_type=Path), help="The file that other_sequence takes the stream from.")
@click.option("--stale-maps", is_flag=True, help="Leave the index maps as they were before the fault.")
@click.option("--force", is_flag=True, help="Replace the output if it exists.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="The faulty copy.")
def fault(**arguments: Any) -> None:
    """Plant CAUSE in a copy of FILE."""
    from fedora_generator.faults.cli import run_fault  # noqa: PLC0415 - loads what reads and writes files

    run_fault(**arguments)
