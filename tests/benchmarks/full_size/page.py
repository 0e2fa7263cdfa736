"""Text of docs/full-size.md."""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from tests.benchmarks.full_size.measured_run import Run

TARGETS: Final = {"quick": 0.05, "standard": 0.5, "full": 1.5}
"""Most time that an effort may take, as a share of decoding the file once."""

MEMORY_TARGET_BYTES: Final = 1_000_000_000
LENGTH_TARGET: Final = 4.4
JOBS_TARGET: Final = 1.7
CLUSTER_TARGET: Final = 1.15
_SLOWEST: Final = 16

HEAD: Final = """\
# What checking a full-size file costs

Written by `make bench-files`, {date}, {cores} cores: `park-day` of {width}x{height}, in the canonical codec. Decoding
is by plain h5py, one thread, every dataset once, the file in memory. An effort's time is that of two processes
(`--jobs 2`), less the start: what the same command takes on a file of 48x36. Each is the fastest of three; all other
figures are of single runs.

| effort | length, s | start, s | time, s | time / decoding | asked | processor, s | memory, MB | decoded |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


@dataclass(frozen=True, slots=True)
class Reading:
    """What plain reading took, and how much it decoded."""

    decoded_bytes: int
    wall_s: float
    cpu_s: float


@dataclass(frozen=True, slots=True)
class Measured:
    """A check of one file: what it took, seconds by stage and check as its record says, and bytes decoded."""

    run: Run
    seconds: Mapping[str, float]
    decoded_bytes: int
    length_s: float = 0.0

    @property
    def wall_s(self) -> float:
        """Seconds that passed."""
        return self.run.wall_s


@dataclass(frozen=True, slots=True)
class OnCluster:
    """Two checks of one file on one cluster: the first, for which its workers load everything, and a later one."""

    first: Measured
    later: Measured


@dataclass(frozen=True, slots=True)
class Selection:
    """One subject alone, and the streams that its checks ask for."""

    subject: str
    needs: tuple[str, ...]
    measured: Measured


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that was measured."""

    size: tuple[int, int]
    readings: Mapping[float, Reading]
    start_s: Mapping[str, float]
    efforts: Sequence[Measured]
    exhaustive: Measured
    exhaustive_together: Measured
    alone: Measured
    together: Measured
    on_cluster: OnCluster
    memories: Mapping[str, Measured]
    selections: Sequence[Selection]

    def of_effort(self, effort: str) -> Sequence[Measured]:
        """Return an effort's checks, the shortest file first."""
        count = len(self.readings)
        first = list(self.start_s).index(effort) * count
        return self.efforts[first : first + count]

    def work_s(self, effort: str, measured: Measured) -> float:
        """Return what a check took beside its start, s."""
        return max(measured.run.wall_s - self.start_s[effort], 0.0)


def page(study: Study) -> Iterator[str]:
    """Yield the page."""
    width, height = study.size
    yield HEAD.format(date=time.strftime("%Y-%m-%d"), cores=os.cpu_count(), width=width, height=height)
    for effort in study.start_s:
        for measured in study.of_effort(effort):
            yield _effort_row(study, effort, measured)
    yield from _figures(study)
    yield from _memories(study)
    yield from _where_time_goes(study)
    yield from _selections(study)


def _effort_row(study: Study, effort: str, measured: Measured) -> str:
    reading = study.readings[measured.length_s]
    work_s = study.work_s(effort, measured)
    return (
        f"| {effort} | {measured.length_s:g} | {study.start_s[effort]:.1f} | {work_s:.1f} "
        f"| {work_s / reading.wall_s:.2f} | {TARGETS[effort]:g} | {measured.run.cpu_s:.1f} "
        f"| {measured.run.peak_bytes / 1e6:.0f} | {measured.decoded_bytes / reading.decoded_bytes:.0%} |\n"
    )


def _figures(study: Study) -> Iterator[str]:
    longest = max(study.readings)
    yield (
        "\nMemory is the largest sum over all processes of their proportional set sizes, looked at twice a "
        f"second (asked: {MEMORY_TARGET_BYTES / 1e6:.0f} MB).\n\n| figure | measured | asked |\n| --- | --- | --- |\n"
    )
    first, *_, last = study.of_effort("full")
    times_longer = last.length_s / first.length_s
    growth = study.work_s("full", last) / study.work_s("full", first)
    asked = LENGTH_TARGET / 4 * times_longer
    yield f"| `full`, time of {times_longer:g} times the length | {growth:.2f} | {asked:.2g} |\n"
    gain = study.exhaustive.run.wall_s / study.exhaustive_together.run.wall_s
    yield f"| `exhaustive`, one job's time / two jobs', start included | {gain:.2f} | {JOBS_TARGET} |\n"
    gain = study.alone.run.wall_s / study.together.run.wall_s
    busy = study.alone.run.cpu_s / study.alone.run.wall_s
    yield f"| `full`, one job's time / two jobs', start included | {gain:.2f} | |\n"
    yield f"| processors that one job keeps busy, as it has OpenCV's threads for itself | {busy:.2f} | |\n"
    first, later = (
        measured.run.wall_s / study.together.run.wall_s for measured in (study.on_cluster.first, study.on_cluster.later)
    )
    yield f"| Dask's time / two jobs', first check of a cluster, whose workers load all | {first:.2f} | |\n"
    yield f"| Dask's time / two jobs', later checks | {later:.2f} | {CLUSTER_TARGET} |\n"
    reading = study.readings[longest]
    yield f"| plain decoding, MB/s | {reading.decoded_bytes / reading.wall_s / 1e6:.0f} | |\n"
    speed = reading.decoded_bytes / study.work_s("full", last) / 1e6
    yield f"| `full`, MB/s of decoded file | {speed:.0f} | |\n"


def _memories(study: Study) -> Iterator[str]:
    reading = study.readings[min(study.readings)]
    yield (
        "\n## Memory against time\n\n`full` on the shortest file with two jobs, by `--memory`. Images for which "
        "there is no room are decoded again.\n\n| `--memory` | memory, MB | decoded | processor, s | time, s |\n"
        "| --- | --- | --- | --- | --- |\n"
    )
    for memory, measured in study.memories.items():
        yield (
            f"| {memory} | {measured.run.peak_bytes / 1e6:.0f} | {measured.decoded_bytes / reading.decoded_bytes:.0%} "
            f"| {measured.run.cpu_s:.1f} | {study.work_s('full', measured):.1f} |\n"
        )


def _where_time_goes(study: Study) -> Iterator[str]:
    yield (
        "\n## Where the time goes\n\nSeconds of one process for the shortest file, the slowest checks first. What is "
        "decoded counts for the check that asks first.\n\n| check | `full` | `exhaustive` |\n| --- | --- | --- |\n"
    )
    full, exhaustive = study.alone.seconds, study.exhaustive.seconds
    slowest = sorted((name for name in full if name.startswith("check ")), key=lambda name: -full[name])
    for name in slowest[:_SLOWEST]:
        yield f"| `{name.removeprefix('check ')}` | {full[name]:.2f} | {exhaustive[name]:.2f} |\n"
    rest = slowest[_SLOWEST:]
    yield f"| all others | {sum(full[name] for name in rest):.2f} | {sum(exhaustive[name] for name in rest):.2f} |\n"
    total = {name: sum(seconds[one] for one in slowest) for name, seconds in (("f", full), ("e", exhaustive))}
    yield f"| together | {total['f']:.2f} | {total['e']:.2f} |\n"


def _selections(study: Study) -> Iterator[str]:
    reading = study.readings[min(study.readings)]
    yield (
        "\n## What is decoded for what\n\nOne subject of checks at a time (`--select`), on the shortest file: share of "
        "its bytes that is decoded, and the streams that the checks ask for.\n\n"
        "| subject | decoded | time, s | streams |\n| --- | --- | --- | --- |\n"
    )
    for one in study.selections:
        share = one.measured.decoded_bytes / reading.decoded_bytes
        streams = ", ".join(one.needs) or "stamps and declarations alone"
        yield f"| `{one.subject}` | {share:.1%} | {one.measured.run.wall_s:.1f} | {streams} |\n"
