"""Gate releases of many small sequences on a Dask cluster of this machine, and print what each file costs.

A release is made of links to a few generated sequences, which differ in scene and seed. Each release is gated on a
cluster of its own: a scheduler, and workers, which are processes of their own. A small release before the measured ones
loads libraries and compiled loops in the workers. Nothing has to be installed: the folders of the sources in PYTHONPATH
suffice.
"""

import json
import os
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import click
import dask
import psutil
from distributed import Client, LocalCluster

from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.host import usable_cores
from tests.benchmarks.full_size.measured_run import fedora_qa
from tests.support.sequences import make_sequence

SCENES: Final = ("park-day", "fast-turn", "racetrack", "park-noisy")
WIDTH, HEIGHT, LENGTH_S = 64, 48, 0.3
HEAD: Final = """\
| files | workers | s by the clock | core s a file | of it in workers | in the command | in the scheduler \
| transitions a file | memory of the command | growth of the scheduler |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"""
POLICY: Final = 'ruleset_version = "2"\nfiles = ["**/*.h5"]\nsame_sequence = true\n[check]\nselect = [{}]\n'


@dataclass(frozen=True, slots=True)
class Gated:
    """One gated release.

    Attributes
    ----------
    files, workers
        Number of its sequences, and of processes that measure them.
    wall_s
        Time of the command, start included, s.
    command_cpu_s, workers_cpu_s, scheduler_cpu_s
        Processor time of the command, of the workers, and of the process of the scheduler, s.
    command_bytes, scheduler_growth_bytes
        Largest memory of the command, and by how much the process of the scheduler has grown.
    transitions
        Changes of state that the scheduler has made: some ten for each task.
    """

    files: int
    workers: int
    wall_s: float
    command_cpu_s: float
    workers_cpu_s: float
    scheduler_cpu_s: float
    command_bytes: int
    scheduler_growth_bytes: int
    transitions: int


@click.command()
@click.argument("counts", nargs=-1, type=int)
@click.option("--workers", type=click.IntRange(1), default=usable_cores, help="How many; as many as cores without.")
@click.option("--select", "checks", multiple=True, help="Checks or subjects, to measure the distribution alone.")
def main(counts: tuple[int, ...], workers: int, checks: tuple[str, ...]) -> None:
    """Gate a release for each number of files; 40, 200 and 1000 without any."""
    with TemporaryDirectory() as folder:
        root = Path(folder)
        stock = [make_sequence(root / f"{scene}.h5", scene, LENGTH_S, WIDTH, HEIGHT) for scene in SCENES]
        text = POLICY.format(", ".join(f'"{check}"' for check in checks))
        (root / "policy.toml").write_text(text if checks else text.replace("select = []\n", ""), "utf-8")
        click.echo(HEAD)
        for count in counts or (40, 200, 1000):
            with _cluster(root, workers) as cluster:
                _gate(cluster, _release(root / "warm", stock, 2 * workers), root)
                _print(_gate(cluster, _release(root / f"of-{count}", stock, count), root))


def _print(gated: Gated) -> None:
    each = [seconds / gated.files for seconds in (gated.workers_cpu_s, gated.command_cpu_s, gated.scheduler_cpu_s)]
    parts = " | ".join(f"{1e3 * part:.1f} ms" for part in each)
    click.echo(
        f"| {gated.files} | {gated.workers} | {gated.wall_s:.1f} | {sum(each):.3f} | {parts} "
        f"| {gated.transitions / gated.files:.0f} | {gated.command_bytes / 1e6:.0f} MB "
        f"| {gated.scheduler_growth_bytes / 1e6:.1f} MB |"
    )


def _release(folder: Path, stock: Sequence[Path], count: int) -> Path:
    folder.mkdir(exist_ok=True)
    for number in range(count):
        link = folder / f"{number:06}.h5"
        if not link.exists():
            os.link(stock[number % len(stock)], link)
    return folder


@contextmanager
def _cluster(root: Path, count: int) -> Iterator[LocalCluster]:
    workers = {"n_workers": count, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with (
        dask.config.set({"temporary-directory": str(root)}),
        LocalCluster(**workers, host="127.0.0.1") as cluster,  # type: ignore[no-untyped-call]
    ):
        yield cluster


def _gate(cluster: LocalCluster, release: Path, root: Path) -> Gated:
    """Gate a release in a process of its own; the scheduler runs in this one."""
    here = psutil.Process()
    with Client(cluster, set_as_default=False) as client:  # type: ignore[no-untyped-call]
        workers = [psutil.Process(pid) for pid in client.run(os.getpid).values()]
    transitions = cluster.scheduler.transition_counter
    before, scheduler_s, scheduler_bytes = _cpu_s(workers), _cpu_s([here]), here.memory_info().rss
    record = root / "record.json"
    arguments = ("--policy", str(root / "policy.toml"), "--dask", cluster.scheduler_address, "--json", str(record))
    began = time.perf_counter()
    command = subprocess.Popen(fedora_qa("gate", str(release), *arguments), stdout=subprocess.DEVNULL)
    # With a cluster the command has no processes of its own. Looking at it meanwhile would count for the scheduler.
    _, status, usage = os.wait4(command.pid, 0)
    wall_s, command.returncode = time.perf_counter() - began, os.waitstatus_to_exitcode(status)
    if command.returncode != CLEAN:
        raise click.ClickException(f"Expected exit code {CLEAN} for {release}, got {command.returncode}")
    files = json.loads(record.read_text("utf-8"))["files"]
    return Gated(
        files=len(files) - 1,  # the last one is the release
        workers=len(workers),
        wall_s=wall_s,
        command_cpu_s=usage.ru_utime + usage.ru_stime,
        workers_cpu_s=_cpu_s(workers) - before,
        scheduler_cpu_s=_cpu_s([here]) - scheduler_s,
        command_bytes=usage.ru_maxrss * 1024,  # Linux states KiB
        scheduler_growth_bytes=here.memory_info().rss - scheduler_bytes,
        transitions=cluster.scheduler.transition_counter - transitions,
    )


def _cpu_s(processes: Sequence[psutil.Process]) -> float:
    return sum(times.user + times.system for times in (process.cpu_times() for process in processes))


if __name__ == "__main__":
    main()
