"""Rewriting streams in bounded memory: that of a block, whatever the length of the stream."""

import tracemalloc
from pathlib import Path

import h5py
import hdf5plugin
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.row_order import Unsorted
from fedora_qa.layout.canonical import EVENT_CHUNK_ROWS
from fedora_qa.repairs.repair import repair
from tests.support.handmade import write_handmade
from tests.support.repairs import given_check

EVENTS = 11 << 20
MOST_BYTES = 80 << 20
"""The scan of timestamps holds some nine arrays of 8 MiB, the rewriting some ten of 4 MiB."""


def with_many_events(file: Path) -> Path:
    """Replace the events by millions, one in a thousand of them exchanged with the next; timestamps are 88 MiB."""
    with h5py.File(file, "r+") as opened:
        for name, dtype in (("x", "u2"), ("y", "u2"), ("t", "i8"), ("p", "u1")):
            del opened[f"path/events/{name}"]
            rows = opened.create_dataset(
                f"path/events/{name}", (EVENTS,), dtype, chunks=(EVENT_CHUNK_ROWS,), **hdf5plugin.Blosc("zstd", 1)
            )
            for start in range(0, EVENTS, EVENT_CHUNK_ROWS):
                numbers = np.arange(start, start + EVENT_CHUNK_ROWS)
                numbers[1000:1002] = numbers[1001:999:-1]
                rows[start : start + EVENT_CHUNK_ROWS] = numbers if name == "t" else numbers % 2
    return file


@pytest.mark.parametrize("fault", [ClockShift("events", 2_000_000), Unsorted("events", 0, 2)], ids=["shift", "sort"])
def test_memory_is_that_of_a_block(fault: ReversibleFault, tmp_path: Path) -> None:
    """Timestamps alone are larger than what may be held, and so are all columns."""
    small = write_handmade(tmp_path / "small.h5")
    # What is imported and compiled at the first repair stays in memory.
    repair(small, None, CheckOptions(), quiet, check=given_check(small, fault))
    file = with_many_events(write_handmade(tmp_path / "seq.h5"))
    tracemalloc.start()
    try:
        result = repair(file, tmp_path / "out.h5", CheckOptions(), quiet, check=given_check(file, fault))
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert not result.refusal
    assert 8 * EVENTS > MOST_BYTES > peak_bytes
    with h5py.File(tmp_path / "out.h5") as out:
        assert int(out["path/events/t"][-1]) == EVENTS - 1 - (2000 if isinstance(fault, ClockShift) else 0)
