"""What checking full-size files costs: ``make bench-files`` writes docs/full-size.md.

Files of 1440x1080 in the canonical codec, of four lengths, are generated once (a minute or two for each second of them)
and kept in out/full-size. The time of an effort is told as a ratio to what one thread of plain h5py needs to decode the
same file right before.
"""

import json
import sys
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, get_args

import click
import dask
import h5py
from dask.distributed import LocalCluster

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.engine.options import Effort
from fedora_qa.layout.canonical import FLOW_STREAMS
from tests.benchmarks.full_size.figures import OfEffort, OnCluster, Reading, Selection, Statistic, Study, Turn
from tests.benchmarks.full_size.machine import measure_machine
from tests.benchmarks.full_size.measured_run import Run, fedora_qa, run_measured
from tests.benchmarks.full_size.page import page
from tests.support.all_checks import CHECKS

ROOT: Final = Path(__file__).parents[3]
TARGET: Final = ROOT / "docs" / "full-size.md"
KEPT: Final = ROOT / "out" / "full-size"

SCENE: Final = "park-day"
SIZE: Final = (1440, 1080)
TINY: Final = (48, 36)
TINY_S: Final = 0.4
LENGTHS_S: Final = (1.0, 2.0, 4.0, 8.0)
JOBS: Final = 2
TIMES: Final = 3
"""Everything is measured so often but for selections and memories, efforts with start and decoding right before."""

WORKERS: Final = {
    "MALLOC_MMAP_THRESHOLD_": 32 << 20,
    "MALLOC_TRIM_THRESHOLD_": 256 << 20,
    **dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), 1),
}
"""Environment of the workers of a cluster: memory as docs/jobs.md says, threads as Dask has them."""
MEMORIES: Final = ("1GB", "1.3GB", "2GB")


@click.command()
@click.option("--lengths", default=",".join(f"{length:g}" for length in LENGTHS_S), show_default=True)
@click.option("--size", default="x".join(map(str, SIZE)), show_default=True)
@click.option("--times", type=click.IntRange(min=1), default=TIMES, show_default=True, help="Turns of each effort.")
def main(lengths: str, size: str, times: int) -> None:
    """Generate what is not there, measure, and write docs/full-size.md."""
    width, height = map(int, size.split("x"))
    paths = {length: full_size_sequence(length, (width, height)) for length in map(float, lengths.split(","))}
    tiny = full_size_sequence(TINY_S, TINY)
    shortest = next(iter(paths.values()))
    run_measured(fedora_qa("check", str(tiny)))  # compiled, for good
    efforts = [effort for effort in get_args(Effort) if effort != "exhaustive"]
    exhaustive = _by_jobs(shortest, "exhaustive", times)
    full = _by_jobs(shortest, "full", times)
    on_cluster = _check_on_cluster(shortest, times)
    study = Study(
        size=(width, height),
        efforts=[
            OfEffort(effort, length, [_turn(tiny, path, effort) for _ in range(times)])
            for effort in efforts
            for length, path in paths.items()
        ],
        machine=measure_machine(shortest),
        exhaustive=exhaustive[1],
        exhaustive_together=exhaustive[JOBS],
        alone=full[1],
        together=full[JOBS],
        on_cluster=on_cluster,
        memories={memory: _check(shortest, "full", JOBS, "--memory", memory) for memory in MEMORIES},
        selections=list(_selections(shortest)),
        fields=sum(_rows(shortest, f"path/{stream}") for stream in FLOW_STREAMS),
        frames=_rows(shortest, "path/rgb"),
    )
    text = "".join(page(study))
    TARGET.write_text(text, encoding="utf-8")
    click.echo(text)


def full_size_sequence(length_s: float, size: tuple[int, int] = SIZE) -> Path:
    """Return a clean sequence in out/full-size, generated if it is not there."""
    target = KEPT / f"{SCENE}-{size[0]}x{size[1]}-{length_s:g}s.h5"
    if not target.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        scene = load_scene(SCENE).with_size(*size)
        generate_sequence(scene, target, Request(duration_s=length_s, quality="draft"))
    return target


def _rows(path: Path, dataset: str) -> int:
    with h5py.File(path) as file:
        return len(file[dataset])


def _read(path: Path) -> Reading:
    """Decode a file by plain h5py in a process of its own."""
    with TemporaryDirectory() as folder:
        said = Path(folder) / "said.json"
        command = f"from tests.benchmarks.full_size.plain_reading import main; main({str(path)!r}, {str(said)!r})"
        _succeed(run_measured([sys.executable, "-c", command]), path)
        return Reading(**json.loads(said.read_text(encoding="utf-8")))


def _turn(tiny: Path, path: Path, effort: str) -> Turn:
    """Measure the start of a check, plain decoding of a file, and its check, right after one another."""
    return Turn(start=_check(tiny, effort), reading=_read(path), measured=_check(path, effort))


def _check(path: Path, effort: str, jobs: int = JOBS, *options: str) -> Statistic:
    """Check a file as a user would, and return what it took with what its record says of it."""
    return _measured(path, "--effort", effort, "--jobs", str(jobs), *options)


def _by_jobs(path: Path, effort: str, times: int) -> dict[int, Statistic]:
    """Check a file by one job and by two in turns, and return the fastest of each."""
    turns = [{jobs: _check(path, effort, jobs) for jobs in (1, JOBS)} for _ in range(times)]
    return {jobs: _fastest(turn[jobs] for turn in turns) for jobs in (1, JOBS)}


def _fastest(every: Iterable[Statistic]) -> Statistic:
    return min(every, key=lambda one: one.run.wall_s)


def _check_on_cluster(path: Path, times: int) -> OnCluster:
    """Check a file on one cluster of as many processes: once, and some times more, as a cluster outlives its checks."""
    processes: dict[str, Any] = {"n_workers": JOBS, "threads_per_worker": 1, "dashboard_address": None}
    with dask.config.set({"distributed.nanny.pre-spawn-environ": WORKERS}), LocalCluster(**processes) as cluster:
        options = ("--effort", "full", "--dask", cluster.scheduler_address)
        first, *later = (_measured(path, *options) for _ in range(1 + times))
    return OnCluster(first, _fastest(later))


def _measured(path: Path, *options: str, codes: Collection[int] = (CLEAN,)) -> Statistic:
    with TemporaryDirectory() as folder:
        record = Path(folder) / "record.json"
        run = _succeed(run_measured(fedora_qa("check", str(path), "--json", str(record), *options)), path, codes)
        said: dict[str, Any] = json.loads(record.read_text(encoding="utf-8"))["run"]
    return Statistic(run=run, seconds=said["seconds"], decoded_bytes=said["host"]["decoded_bytes"])


def _selections(path: Path) -> Iterator[Selection]:
    """Check one subject after the other: what is decoded for it, and which streams its checks ask for."""
    for subject in dict.fromkeys(check.name.split(".")[0] for check in CHECKS):
        needs = {need for check in CHECKS if check.name.startswith(f"{subject}.") for need in check.needs}
        measured = _measured(
            path, "--select", subject, codes=(CLEAN, INCOMPLETE)
        )  # few streams leave some unobservable
        yield Selection(subject, tuple(sorted(needs)), measured)


def _succeed(run: Run, path: Path, codes: Collection[int] = (CLEAN,)) -> Run:
    """Return the run; raises ``RuntimeError`` at another exit code, so that no failure is timed as success."""
    if run.code not in codes:
        raise RuntimeError(f"Expected exit code {' or '.join(map(str, codes))} for {path}, got {run.code}")
    return run


if __name__ == "__main__":
    main()
