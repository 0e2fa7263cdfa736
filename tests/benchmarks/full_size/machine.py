"""What the machine gives, so that other figures can be read: memory, and what a second process gains.

Two processes share memory and its caches, and on rented machines often a core: a check gains no more by a second
process than what it does most.
"""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from tests.benchmarks.full_size.plain_reading import decode

DECODING: Final = "plain decoding"

_TURNS: Final = 3
_FRESH_BYTES: Final = 512 << 20
_COPIED_BYTES: Final = 64 << 20
_COPIES: Final = 20
_IN_CACHE: Final = 2048
_SINES: Final = 50_000


@dataclass(frozen=True, slots=True)
class Machine:
    """What was measured of a machine.

    Attributes
    ----------
    gains
        How much more two processes do than one in the same time, by what they do.
    fresh_bytes_s, held_bytes_s
        Bytes a second that are written to memory for the first time, and again.
    """

    gains: Mapping[str, float]
    fresh_bytes_s: float
    held_bytes_s: float


def measure_machine(path: Path) -> Machine:
    """Measure it; ``path`` is a file to decode."""
    works: Mapping[str, Callable[[Path], object]] = MappingProxyType(
        {"arithmetic in the cache": _compute, "copying memory": _copy, DECODING: decode}
    )
    fresh, held = _fill()
    return Machine({name: _gain(work, path) for name, work in works.items()}, fresh, held)


def _gain(work: Callable[[Path], object], path: Path) -> float:
    seconds = {count: min(_together(count, work, path) for _ in range(_TURNS)) for count in (1, 2)}
    return 2 * seconds[1] / seconds[2]


def _together(count: int, work: Callable[[Path], object], path: Path) -> float:
    """Return the seconds in which so many processes have all done the work, beginning together."""
    context = multiprocessing.get_context("spawn")
    ready, spent = context.Barrier(count), context.SimpleQueue()
    processes = [context.Process(target=_timed, args=(work, path, ready, spent)) for _ in range(count)]
    for process in processes:
        process.start()
    slowest: float = max(spent.get() for _ in processes)
    for process in processes:
        process.join()
    return slowest


def _timed(work: Callable[[Path], object], path: Path, ready: Any, spent: Any) -> None:
    work(path)
    ready.wait()
    began = time.perf_counter()
    work(path)
    spent.put(time.perf_counter() - began)


def _compute(_: Path) -> None:
    values = np.ones(_IN_CACHE)
    for _turn in range(_SINES):
        np.sin(values, out=values)


def _copy(_: Path) -> None:
    source = np.ones(_COPIED_BYTES, np.uint8)
    target = source.copy()
    for _turn in range(_COPIES):
        np.copyto(target, source)


def _fill() -> tuple[float, float]:
    """Return bytes a second that fill fresh memory, and the same memory again."""
    memory = np.empty(_FRESH_BYTES, np.uint8)
    seconds = []
    for value in (1, 2):
        began = time.perf_counter()
        memory.fill(value)
        seconds.append(time.perf_counter() - began)
    return _FRESH_BYTES / seconds[0], _FRESH_BYTES / seconds[1]
