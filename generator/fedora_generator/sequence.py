"""``fedora-generate sequence``: generate one sequence, with its progress."""

import time
from dataclasses import replace
from pathlib import Path
from typing import cast

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from fedora_generator.choices import DEFAULT_DURATION_S, Quality
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import whole_us
from fedora_generator.scene import load_scene


def run_sequence(
    scene: str,
    output: Path,
    start: float | None,
    duration: float | None,
    size: tuple[int, int] | None,
    streams: str,
    quality: str,
    seed: int | None,
    force: bool,
) -> None:
    """Run the command."""
    start_time = time.monotonic()
    description = load_scene(scene)
    if start is not None:
        description = description.starting_at(start)
    if duration is None:
        duration = description.remaining_s or DEFAULT_DURATION_S
    if size is not None:
        description = description.with_size(*size)
    if seed is not None:
        description = replace(description, seed=seed)
    request = Request(
        duration_s=duration,
        streams=frozenset(name.strip() for name in streams.split(",") if name.strip()),
        quality=cast(Quality, quality),
    )
    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.percentage:3.0f}%"), TimeRemainingColumn())
    with Progress("{task.description}", *columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(description.name, total=whole_us(request.duration_s))
        summary = generate_sequence(
            description,
            output,
            request,
            overwrite=force,
            progress=lambda time_us: bar.update(task, completed=time_us),
            warn=lambda message: click.echo(f"Warning: {message}", err=True),
        )
    click.echo(
        f"{output}: {summary.frames} frames, {summary.events} events, {summary.size_bytes / 1e6:.1f} MB "
        f"in {time.monotonic() - start_time:.1f} s",
        err=True,
    )
