"""``fedora-generate corpus``: clean and faulty sequences, and the manifest that lists which is which."""

from pathlib import Path
from typing import cast

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from fedora_generator.choices import Quality
from fedora_generator.corpus.build import build_corpus
from fedora_generator.corpus.plan import CorpusOptions, plan_corpus
from fedora_generator.resources import expected_bytes
from fedora_generator.scene import load_scene


def run_corpus(
    folder: Path,
    scenes: tuple[str, ...],
    clean: int,
    causes: tuple[str, ...],
    ladder: int,
    size: tuple[int, int],
    duration_s: float,
    quality: str,
    seed: int,
    trials: int,
    deep: tuple[str, ...],
    deep_trials: int,
    spread: bool,
    off_grid: bool,
    jobs: int,
    dry_run: bool,
    force: bool,
) -> None:
    """Run the command."""
    if not scenes:
        raise click.UsageError("Expected at least one scene, got none; see `fedora-generate scenes`")
    selected_scenes = tuple(load_scene(name).with_size(*size) for name in scenes)
    if len({scene.name for scene in selected_scenes}) < len(selected_scenes):
        raise click.UsageError("Expected scenes of different names, got one name twice; files are called after them")
    if deep and not trials:
        raise click.UsageError("Expected --trials with --deep, got none; give the trials of the other causes")
    if off_grid and not trials:
        raise click.UsageError("Expected --trials with --off-grid, got none; give the trials of each cause")
    options = CorpusOptions(
        clean=clean,
        causes=causes,
        ladder=ladder,
        duration_s=duration_s,
        quality=cast(Quality, quality),
        seed=seed,
        trials=trials,
        deep=deep,
        deep_trials=deep_trials,
        spread=spread,
        off_grid=off_grid,
    )
    if dry_run:
        # Files and bytes by kind, a line each, and in all.
        sizes = {scene.name: expected_bytes(scene, duration_s) for scene in selected_scenes}
        rows: dict[str, list[int]] = {}
        for planned in plan_corpus(options, selected_scenes):
            for kind in (planned.file.split("/", 1)[0], "all"):
                row = rows.setdefault(kind, [0, 0])
                row[0] += 1
                row[1] += sizes[planned.scene]
        rows["all"] = rows.pop("all")
        click.echo(f"{'kind':<10} {'files':>6} {'MB, about':>10}")
        for kind, (files, size_bytes) in rows.items():
            click.echo(f"{kind:<10} {files:>6} {size_bytes / 1e6:>10.1f}")
        return
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("")
        manifest = build_corpus(
            folder,
            options,
            selected_scenes,
            jobs=jobs,
            force=force,
            report=lambda done, planned, file: bar.update(task, completed=done, total=planned, description=file),
        )
    click.echo(f"{manifest}", err=True)
