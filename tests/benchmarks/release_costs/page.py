"""Text of docs/release-costs.md."""

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from tests.benchmarks.release_costs.costs import DSEC, PAPER, SIMULATED, Dataset, Measured, UnitCost, unit_costs

USD_PER_CORE_H: Final = 0.05
"""Assumed. Clouds list 0.03 to 0.06 USD for an hour of a virtual core on demand."""

CONNECTION_BYTES_S: Final = 50_000_000
"""Assumed for one connection to an object store, as in docs/remote.md."""

NETWORKS_BIT_S: Final = (1e9, 10e9, 25e9)

HEAD: Final = """\
# What a release costs to check

Written by `make bench-releases`, {date}, {cores} cores. Each source was checked at two lengths, with two jobs and as a
command: the median of three runs, start included. A line through both lengths gives what a sequence costs and what a
second of it costs. The tables below multiply these figures; nothing of that length was checked.

| source | effort | length, s | time, s | core seconds | core s a second of sequence | MB read a second of sequence |
| --- | --- | --- | --- | --- | --- | --- |
"""

DATASETS: Final = """
## Datasets

Money is that of the cores alone, at {price:g} USD an hour of a core, which is assumed: put in your own price.

| dataset | effort | core hours | hours on 16 cores | USD | TB read |
| --- | --- | --- | --- | --- | --- |
"""

BOTTLENECK: Final = """
## Where reading limits

A core that checks needs so many bytes a second. A connection to an object store is assumed to give
{connection:.0f} MB/s.

| source | effort | MB/s that keep one core busy | connections a core | {networks} |
| --- | --- | --- | --- | {rules} |
"""

AFTER: Final = """
Each job reads through one connection at a time and waits for it. From an object store a check therefore takes as many
times longer as the column *connections a core* states, unless it runs with as many times more jobs than cores. The
columns at the right state how many cores a network keeps busy; more cores wait for the network. On one machine with a
local disk the cores are the limit.
"""

FOLDER: Final = """
## A folder against plain reading

The folder like DSEC's: the time of a check with two jobs, start included, over that of decoding the same images by
OpenCV and the same datasets by h5py in one thread. Asked: 1.5 for `full`.

| length, s | decoding, s | {efforts} |
| --- | --- | {rules} |
"""


@dataclass(frozen=True, slots=True)
class Source:
    """A kind of sequence, and its checks by effort."""

    name: str
    measured: Mapping[str, Sequence[Measured]]


def page(files: Source, folders: Source, folder_reading_s: Mapping[float, float]) -> Iterator[str]:
    """Yield the page. ``folder_reading_s`` is the time of decoding a folder by its length, s."""
    yield HEAD.format(date=time.strftime("%Y-%m-%d"), cores=os.cpu_count())
    costs = {source.name: unit_costs(source.measured) for source in (files, folders)}
    for source in (files, folders):
        yield from _source(source, costs[source.name])
    yield DATASETS.format(price=USD_PER_CORE_H)
    for dataset, source in ((PAPER, files), (DSEC, folders), (SIMULATED, files)):
        yield from _dataset(dataset, costs[source.name])
    networks = " | ".join(f"cores that {bit_s / 1e9:g} Gbit/s keep busy" for bit_s in NETWORKS_BIT_S)
    yield BOTTLENECK.format(
        connection=CONNECTION_BYTES_S / 1e6, networks=networks, rules=" | ".join("---" for _ in NETWORKS_BIT_S)
    )
    for source in (files, folders):
        yield from _bottleneck(source.name, costs[source.name])
    yield AFTER
    yield from _folder(folders, folder_reading_s)


def _source(source: Source, costs: Mapping[str, UnitCost]) -> Iterator[str]:
    for effort, every in source.measured.items():
        cost = costs[effort]
        for each in every:
            yield (
                f"| {source.name} | {effort} | {each.length_s:g} | {each.wall_s:.1f} | {each.cpu_s:.1f} "
                f"| {cost.cpu_s_per_s:.2f} | {cost.read_bytes_per_s / 1e6:.0f} |\n"
            )


def _dataset(dataset: Dataset, costs: Mapping[str, UnitCost]) -> Iterator[str]:
    for effort, cost in costs.items():
        core_h = cost.core_h(dataset)
        yield (
            f"| {dataset.name}, {dataset.length_s / 60:.0f} min | {effort} | {core_h:.2g} | {core_h / 16:.2g} "
            f"| {USD_PER_CORE_H * core_h:.2g} | {cost.read_bytes(dataset) / 1e12:.2g} |\n"
        )


def _bottleneck(name: str, costs: Mapping[str, UnitCost]) -> Iterator[str]:
    for effort, cost in costs.items():
        cores = " | ".join(f"{bit_s / 8 / cost.bytes_per_core_s:.0f}" for bit_s in NETWORKS_BIT_S)
        yield (
            f"| {name} | {effort} | {cost.bytes_per_core_s / 1e6:.0f} "
            f"| {cost.bytes_per_core_s / CONNECTION_BYTES_S:.1f} | {cores} |\n"
        )


def _folder(folders: Source, folder_reading_s: Mapping[float, float]) -> Iterator[str]:
    efforts = list(folders.measured)
    yield FOLDER.format(
        efforts=" | ".join(f"`{effort}`" for effort in efforts), rules=" | ".join("---" for _ in efforts)
    )
    for place, (length_s, decoding_s) in enumerate(folder_reading_s.items()):
        ratios = " | ".join(f"{folders.measured[effort][place].wall_s / decoding_s:.2f}" for effort in efforts)
        yield f"| {length_s:g} | {decoding_s:.1f} | {ratios} |\n"
