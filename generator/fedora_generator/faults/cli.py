"""``fedora-generate fault``: plant one fault in a copy of a file."""

from pathlib import Path

import click

from fedora_generator.errors import OutputError
from fedora_generator.faults.fault import Region
from fedora_generator.faults.plant import plant_fault
from fedora_generator.faults.table import usual_stream


def run_fault(
    file: Path,
    cause: str,
    stream: str | None,
    magnitude: float | None,
    unit: str | None,
    seed: int,
    start_s: float | None,
    stop_s: float | None,
    region: Region | None,
    direction_deg: float | None,
    donor: Path | None,
    stale_maps: bool,
    force: bool,
    output: Path,
) -> None:
    """Run the command."""
    if output.exists() and not force:
        raise OutputError(f"Expected a new file, got {output}, which exists; choose another name or use --force")
    result = plant_fault(
        file,
        output,
        cause,
        stream or usual_stream(cause),
        magnitude=magnitude,
        unit=unit,
        seed=seed,
        start_s=start_s,
        stop_s=stop_s,
        region=region,
        direction_deg=direction_deg,
        donor=donor,
        consistent_maps=not stale_maps,
    )
    size = f" {result.magnitude:g} {result.unit}" if result.unit else ""
    click.echo(f"{output}: {result.stream}:{result.cause}{size}", err=True)
