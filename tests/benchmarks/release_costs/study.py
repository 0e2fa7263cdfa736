"""What releases cost to check: ``make bench-releases`` writes docs/release-costs.md.

Two sources of two lengths each, generated once: files of 1440x1080 in the canonical format (out/full-size), and folders
in the layout of DSEC with frames of 1440x1080 at 20 Hz, disparity and flow at 10 Hz (out/dsec-like).
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final

import click

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import RateOptions
from fedora_generator.scene import load_scene
from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.engine.options import Effort
from tests.benchmarks.full_size.measured_run import Run, fedora_qa, run_measured
from tests.benchmarks.full_size.plain_reading import decode
from tests.benchmarks.full_size.study import JOBS, ROOT, full_size_sequence
from tests.benchmarks.release_costs.costs import Measured
from tests.benchmarks.release_costs.folder_reading import decode_folder, reading_s
from tests.benchmarks.release_costs.page import Source, page
from tests.support.dsec_folder import write_dsec_folder, write_side_metadata

TARGET: Final = ROOT / "docs" / "release-costs.md"
KEPT: Final = ROOT / "out" / "dsec-like"
EFFORTS: Final[tuple[Effort, ...]] = ("quick", "standard", "full")
FILE_LENGTHS_S: Final = (4.0, 8.0)
FOLDER_LENGTHS_S: Final = (4.0, 20.0)
TURNS: Final = 3

DSEC_RATES: Final = RateOptions(frames_hz=20.0, depth_hz=50.0, flow_hz=(10.0,))
"""The writer of the folder keeps every fifth depth frame: 10 Hz."""

BASELINE_M: Final = 0.2
"""Points nearer than 1 m have a disparity of 256 px or more, which does not fit into 16 bits. The nearest point of the
scene is 2.7 m away."""


@click.command()
def main() -> None:
    """Generate what is not there, measure, and write docs/release-costs.md."""
    files = {length_s: full_size_sequence(length_s) for length_s in FILE_LENGTHS_S}
    folders = {length_s: dsec_like(length_s) for length_s in FOLDER_LENGTHS_S}
    metadata = write_side_metadata(KEPT / "side.toml")
    of_files = {effort: [_check(path, length_s, effort) for length_s, path in files.items()] for effort in EFFORTS}
    of_folders = {
        effort: [_check(path, length_s, effort, "--metadata", str(metadata)) for length_s, path in folders.items()]
        for effort in EFFORTS
    }
    text = "".join(
        page(
            Source("FEDORA, 1440x1080, canonical codec", of_files),
            Source("like DSEC, frames of 1440x1080", of_folders),
            {length_s: reading_s(path) for length_s, path in folders.items()},
        )
    )
    TARGET.write_text(text, encoding="utf-8")
    click.echo(text)


def dsec_like(length_s: float) -> Path:
    """Return a folder in the layout of DSEC, generated if it is not there."""
    folder = KEPT / f"{length_s:g}s"
    if not folder.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        scene = replace(load_scene("park-day"), rates=DSEC_RATES)
        with TemporaryDirectory(dir=KEPT) as temporary:
            source = Path(temporary) / "source.h5"
            generate_sequence(scene, source, Request(duration_s=length_s, quality="draft"))
            write_dsec_folder(source, Path(temporary) / "folder", BASELINE_M).rename(folder)
    return folder


def _check(path: Path, length_s: float, effort: Effort, *options: str) -> Measured:
    """Check a sequence several times as a user would; medians."""
    runs, decoded_bytes = [], 0
    for _ in range(TURNS):
        run, record = _measured(path, "--effort", effort, "--jobs", str(JOBS), *options)
        runs.append(run)
        decoded_bytes = record["run"]["host"]["decoded_bytes"]
    share = decoded_bytes / (decode_folder(path) if path.is_dir() else decode(path))
    return Measured(
        length_s=length_s,
        cpu_s=median(run.cpu_s for run in runs),
        wall_s=median(run.wall_s for run in runs),
        read_bytes=share * _bytes_on_disk(path),
    )


def _measured(path: Path, *options: str) -> tuple[Run, Mapping[str, Any]]:
    with TemporaryDirectory() as folder:
        target = Path(folder) / "record.json"
        run = run_measured(fedora_qa("check", str(path), "--json", str(target), *options))
        if run.code != CLEAN:
            raise RuntimeError(f"Expected exit code {CLEAN} for {path}, got {run.code}")
        return run, json.loads(target.read_text(encoding="utf-8"))


def _bytes_on_disk(path: Path) -> int:
    paths = path.rglob("*") if path.is_dir() else [path]
    return sum(each.stat().st_size for each in paths if each.is_file())


if __name__ == "__main__":
    main()
