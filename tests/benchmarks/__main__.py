"""Measures, and writes the tables: ``python -m tests.benchmarks``, about three minutes on one core."""

import os
import platform
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.benchmarks.event_throughput import dense_sinusoid, measure, sparse_edge
from tests.benchmarks.timing_page import scenes, walls

TARGET: Final = Path(__file__).parents[2] / "docs" / "benchmarks.md"
PLOT: Final = TARGET.with_name("event-timing.svg")
HEIGHT, WIDTH, FRAMES, RUNS = 480, 640, 81, 9

THROUGHPUT: Final = """\
## Event kernel

The kernel turns log frames into events. It is measured with one thread, {width}x{height}, C = 0.2, and 1000 frames
(float64) a second; it returns whole events in order. The reference (`tests/benchmarks/plain_scan_kernels.py`) is the
simplest correct compiled scan: a loop over all pixels and their crossings, with keys sorted by NumPy. Both process
the same frames, ten at a time in turn, and must return identical events. A row is one run of {frames} frames, with
medians over the frames of thread time. The ratio matters most, which is the median of the ratios of single frames:
both spend most of their time on reading memory, which other work on the machine uses as well.

These changes made the kernel faster:

- the middles of the quiet intervals in float32 beside the reference levels: 12 bytes are read of a quiet pixel
  instead of 16;
- half the comparisons, with half-widths of the intervals;
- prefetching the crossings of a band of rows while the next band is compared;
- computing the timestamps of all crossings of a band together;
- unsigned indices, and no views of rows;
- sorting and decoding in one call.

These did not, or made one movie faster and the other slower:

- the upper half of the reference's bits instead of a middle: as little memory, but more arithmetic;
- one interval for 64 quiet pixels (sparse +8%, dense -7%);
- prefetching the signals, which the processor does already;
- scattering events into columns while sorting;
- thresholds packed into one array.

| movie | events a frame | kernel, frames/s | kernel, M events/s | reference, frames/s | ratio |
| --- | --- | --- | --- | --- | --- |
"""


def main() -> None:
    """Write docs/benchmarks.md and print it."""
    text = "# Benchmarks\n\nWritten by `make bench`.\n\n" + "".join(
        [*_facts(), *_throughput(), "\n", *walls(PLOT), *scenes()]
    )
    TARGET.write_text(text, encoding="utf-8")
    print(text)


def _facts() -> Iterator[str]:
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    yield f"{time.strftime('%Y-%m-%d')}, {platform.machine()}, {os.cpu_count()} cores, "
    yield f"Python {platform.python_version()}; load averages at the start: {load}.\n\n"


def _throughput() -> Iterator[str]:
    yield THROUGHPUT.format(width=WIDTH, height=HEIGHT, frames=FRAMES)
    for name, movie in (("dense sinusoid", dense_sinusoid), ("sparse edge", sparse_edge)):
        measure(movie, 9, 48, 64)  # compiles
        for _ in range(RUNS):
            found = measure(movie, FRAMES, HEIGHT, WIDTH)
            yield (
                f"| {name} | {found.events:.0f} | {1 / found.comparator_s:.0f} "
                f"| {found.events / found.comparator_s / 1e6:.1f} | {1 / found.plain_s:.0f} | {found.ratio:.2f} |\n"
            )


if __name__ == "__main__":
    main()
