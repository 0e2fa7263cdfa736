"""Text of docs/full-size.md."""

import os
import time
from collections.abc import Iterator, Mapping
from typing import Final

from tests.benchmarks.full_size.figures import OfEffort, Study
from tests.benchmarks.full_size.machine import DECODING

TARGETS: Final[Mapping[str, float]] = {"quick": 0.2, "standard": 0.5, "full": 1.5}
"""Most time that an effort may take, as a share of decoding the file once; of `quick` and `standard` for 8 s."""

MEMORY_TARGET_BYTES: Final = 2_000_000_000
LENGTH_TARGET: Final = 4.4
JOBS_TARGET: Final = 1.7
CLUSTER_TARGET: Final = 1.15
_SLOWEST: Final = 16
_MOST: Final = 0.5

HEAD: Final = """\
# What checking a full-size file costs

Written by `make bench-files`, {date}, {cores} cores: `park-day` of {width}x{height}, in the canonical codec.

- *Decoding* is the time of plain h5py with one thread, which reads every dataset once from a file in memory. All
  chunks of a dataset are decoded into the same array. *New arrays* decodes each chunk into a new array, as
  `dataset[i]` does. This takes longer, by an amount that depends on how much of it is fresh memory.
- *Time* is that of two processes (`--jobs 2`) without the start. *Start* is the time of the same command for a file
  of 48x36.
- The speed of the machine varies. So decoding, start and check are measured directly one after another, {times}
  times. Ratios are medians of the ratios within such a turn. All other numbers of this table are those of the fastest
  run.

| effort | length, s | start, s | time, s | time / decoding | goal | new arrays | processor, s | memory, MB | decoded |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


FIRST: Final[Mapping[str, tuple[float, float]]] = {
    "flow_events.sharpness": (1.97, 2.06), "flow_photometric.residual": (1.95, 20.2),
    "integrity.readable": (1.09, 1.51), "depth.consistency": (1.02, 12.08), "images.order": (0.76, 0.82),
    "event_response.orientation": (0.66, 0.87), "evidence": (0.61, 0.42), "flow_rates.composition": (0.59, 48.94),
    "integrity.finite": (0.43, 0.55), "event_response.conservation": (0.35, 0.44),
    "event_response.timing": (0.3, 0.37), "images.channels": (0.3, 0.24), "event_response.alignment": (0.3, 0.32),
    "alignment.depth": (0.29, 0.37), "images.repeats": (0.28, 0.3), "alignment.events": (0.22, 0.26),
    "together": (12.51, 108.09),
}  # fmt: skip
"""Seconds by check in the first study, before any optimisation; the slowest sixteen."""

QUICK: Final = """
`quick` has a second goal: to detect nine in ten of the faults that are four times as large as the limits of `full`
([trade](trade.md)). Standard errors grow with the inverse root of the share of windows that is measured. So nine in ten
require at least a sixteenth of the windows, which takes 0.09 where `full` takes 1.5. In files this short, a part of the
time is fixed: timestamps, four segments, judgement.
"""


def page(study: Study) -> Iterator[str]:
    """Yield the page."""
    width, height = study.size
    times = len(study.efforts[0].turns)
    yield HEAD.format(date=time.strftime("%Y-%m-%d"), cores=os.cpu_count(), width=width, height=height, times=times)
    for one in study.efforts:
        yield _effort_row(one)
    yield from _figures(study)
    yield from _machine(study)
    yield from _memories(study)
    yield from _where_time_goes(study)
    yield from _selections(study)


def _effort_row(one: OfEffort) -> str:
    fastest = one.fastest
    return (
        f"| {one.effort} | {one.length_s:g} | {one.start_s:.1f} | {one.work_s:.1f} "
        f"| {one.ratio:.2f} | {TARGETS[one.effort]:g} | {one.ratio_to_new_arrays:.2f} | {fastest.run.cpu_s:.1f} "
        f"| {fastest.run.peak_bytes / 1e6:.0f} "
        f"| {fastest.decoded_bytes / one.turns[0].reading.decoded_bytes:.0%} |\n"
    )


def _figures(study: Study) -> Iterator[str]:
    longest = max(study.readings)
    yield (
        "\nMemory is the largest sum over all processes of their proportional set sizes, sampled twice a "
        f"second (goal: {MEMORY_TARGET_BYTES / 1e6:.0f} MB).\n\n| figure | measured | goal |\n| --- | --- | --- |\n"
    )
    first, last = study.full[0], study.full[-1]
    times_longer = last.length_s / first.length_s
    growth = last.work_s / first.work_s
    asked = LENGTH_TARGET / 4 * times_longer
    yield f"| `full`, time of {times_longer:g} times the length | {growth:.2f} | {asked:.2g} |\n"
    for one in study.full:
        ratio = one.work_s / study.readings[one.length_s].wall_s
        yield f"| `full`, fastest time / fastest decoding, {one.length_s:g} s | {ratio:.1f} | {TARGETS['full']} |\n"
    gain = study.exhaustive.run.wall_s / study.exhaustive_together.run.wall_s
    yield f"| `exhaustive`, one job's time / two jobs', start included | {gain:.2f} | {JOBS_TARGET} |\n"
    gain = study.alone.run.wall_s / study.together.run.wall_s
    busy = study.alone.run.cpu_s / study.alone.run.wall_s
    yield f"| `full`, one job's time / two jobs', start included | {gain:.2f} | |\n"
    yield f"| processors that one job keeps busy, as it has OpenCV's threads for itself | {busy:.2f} | |\n"
    first, later = (
        measured.run.wall_s / study.together.run.wall_s for measured in (study.on_cluster.first, study.on_cluster.later)
    )
    yield f"| Dask's time / two jobs', first check of a cluster, whose workers load all libraries | {first:.2f} | |\n"
    yield f"| Dask's time / two jobs', later checks | {later:.2f} | {CLUSTER_TARGET} |\n"
    for length, reading in study.readings.items():
        kept, new = (reading.decoded_bytes / seconds / 1e6 for seconds in (reading.wall_s, reading.new_arrays_wall_s))
        yield f"| plain decoding of {length:g} s, MB/s (into new arrays) | {kept:.0f} ({new:.0f}) | |\n"
    reading = study.readings[longest]
    speed = reading.decoded_bytes / last.work_s / 1e6
    yield f"| `full`, MB/s of decoded file | {speed:.0f} | |\n"
    for effort, seconds in (("full", study.alone.seconds), ("exhaustive", study.exhaustive.seconds)):
        flow_s = sum(spent for name, spent in seconds.items() if name.startswith("check flow_"))
        all_s = sum(spent for name, spent in seconds.items() if name.startswith("check "))
        yield f"| `{effort}`, ms of one process a flow field, checks of flow | {1e3 * flow_s / study.fields:.1f} | |\n"
        yield f"| `{effort}`, ms of one process a frame, all others | {1e3 * (all_s - flow_s) / study.frames:.1f} | |\n"
    yield QUICK


def _machine(study: Study) -> Iterator[str]:
    machine = study.machine
    yield (
        "\n## Speed of the machine\n\nTwo processes share memory and caches. The figures above hold for a machine with "
        "the speeds of this table. Two\njobs gain at most what two processes gain at the work that takes most of the "
        "time. A process has to wait for\nmemory that it gets from the system for the first time.\n\n"
        "| property of the machine | measured |\n| --- | --- |\n"
    )
    for work, gain in machine.gains.items():
        yield f"| {work}: one process's time / two processes' with half of it each | {gain:.2f} |\n"
    yield f"| memory written for the first time, GB/s | {machine.fresh_bytes_s / 1e9:.1f} |\n"
    yield f"| memory written again, GB/s | {machine.held_bytes_s / 1e9:.1f} |\n"
    alone = 1 / machine.gains[DECODING]
    yield (
        f"\nTwo processes that only decode the file take {alone:.2f} of the time of one. So of the goal of "
        f"{TARGETS['full']:g} for `full`, {TARGETS['full'] - alone:.2f} remain for all checks.\n"
    )


def _memories(study: Study) -> Iterator[str]:
    reading, start_s = study.readings[min(study.readings)], study.full[0].start_s
    yield (
        "\n## Memory against time\n\n`full` on the shortest file with two jobs, by `--memory`. Images that "
        "do not fit are decoded again.\n\n| `--memory` | memory, MB | decoded | processor, s | time, s |\n"
        "| --- | --- | --- | --- | --- |\n"
    )
    for memory, measured in study.memories.items():
        yield (
            f"| {memory} | {measured.run.peak_bytes / 1e6:.0f} | {measured.decoded_bytes / reading.decoded_bytes:.0%} "
            f"| {measured.run.cpu_s:.1f} | {max(measured.run.wall_s - start_s, 0.0):.1f} |\n"
        )


def _where_time_goes(study: Study) -> Iterator[str]:
    yield (
        "\n## Where the time goes\n\nSeconds of one process for the shortest file, the slowest checks first. Decoding "
        "counts for the check that first asks for the data. In brackets: the first study, on a machine of the same "
        "kind, before any optimisation.\n\n| check | `full` | `exhaustive` |\n| --- | --- | --- |\n"
    )
    full, exhaustive = study.alone.seconds, study.exhaustive.seconds
    slowest = sorted((name for name in full if name.startswith("check ")), key=lambda name: -full[name])
    for name in slowest[:_SLOWEST]:
        check = name.removeprefix("check ")
        yield f"| `{check}` | {full[name]:.2f}{_first(check, 0)} | {exhaustive[name]:.2f}{_first(check, 1)} |\n"
    rest = slowest[_SLOWEST:]
    yield f"| all others | {sum(full[name] for name in rest):.2f} | {sum(exhaustive[name] for name in rest):.2f} |\n"
    total = {name: sum(seconds[one] for one in slowest) for name, seconds in (("f", full), ("e", exhaustive))}
    yield f"| together | {total['f']:.2f}{_first('together', 0)} | {total['e']:.2f}{_first('together', 1)} |\n"


def _first(check: str, effort: int) -> str:
    return f" ({FIRST[check][effort]:.2f})" if check in FIRST else ""


def _selections(study: Study) -> Iterator[str]:
    reading = study.readings[min(study.readings)]
    yield (
        "\n## What each subject decodes\n\nOne subject of checks at a time (`--select`), on the shortest file: the "
        "share of its bytes that is decoded, and the streams that the checks read.\n\n"
        "| subject | decoded | time, s | streams |\n| --- | --- | --- | --- |\n"
    )
    for one in study.selections:
        share = one.measured.decoded_bytes / reading.decoded_bytes
        streams = ", ".join(one.needs) or ("all, row by row" if share > _MOST else "timestamps and declarations alone")
        yield f"| `{one.subject}` | {share:.1%} | {one.measured.run.wall_s:.1f} | {streams} |\n"
