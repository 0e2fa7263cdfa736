"""Blocks are decoded once while wanted, and a damaged one costs itself alone."""

from pathlib import Path

import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.engine.windows import WINDOW_NS
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import Sequence, open_sequence


@pytest.mark.parametrize("cache_bytes", [1, 1 << 28])
def test_rows_are_those_of_the_file(park_day: Path, cache_bytes: int) -> None:
    """Whatever the cache, any range of rows is what the file holds."""
    with open_sequence(park_day) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), cache_bytes)
        for key, start, stop in [
            ("path/rgb", 3, 7),
            ("path/events/t", 10, 5000),
            ("path/imu/ts", 0, 1),
            ("path/rgb", 5, 5),
        ]:
            assert np.array_equal(decoder.rows(key, start, stop), sequence.rows(key, start, stop))


def test_each_block_is_decoded_once_while_it_fits(park_day: Path) -> None:
    """Asking again costs nothing."""
    with open_sequence(park_day) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), 1 << 28)
        first = decoder.rows("path/depth", 0, 5)
        decoded = decoder.decoded_bytes
        assert decoded == first.nbytes
        decoder.rows("path/depth", 0, 5)
        assert decoder.decoded_bytes == decoded


def test_event_index_counts_earlier_events(park_day: Path) -> None:
    """The index of a time is the number of events before it."""
    with open_sequence(park_day) as sequence:
        scanned = scan(sequence, WINDOW_NS)
        decoder = BlockDecoder(sequence, scanned, 1 << 28)
        times = decoder.rows("path/events/t", 0, len_of(sequence, "path/events/t"))
        for instant in (-1, 0, int(times[0]), int(times[100]), int(times[100]) + 1, int(times[-1]), int(times[-1]) + 1):
            assert decoder.event_index(instant) == int(np.count_nonzero(times < instant))


def test_damaged_block_is_named_and_the_rest_goes_on(park_day: Path, tmp_path: Path) -> None:
    """One corrupt depth frame: its rows raise, its neighbours decode, and the file is found damaged in that stream."""
    damaged = tmp_path / "damaged.h5"
    plant_fault(park_day, damaged, "corrupt_chunk", "depth", 1.0)
    with open_sequence(damaged) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), 1 << 28)
        unreadable = []
        for frame in range(len_of(sequence, "path/depth")):
            try:
                decoder.rows("path/depth", frame, frame + 1)
            except UnreadableRowsError as error:
                unreadable.append(error.start)
    assert len(unreadable) == 1
    run = check_file(damaged, CheckOptions(select=("integrity", "clocks")))
    assert run.record.verdict == "findings"
    assert [(d.cause, d.stream) for d in run.record.diagnoses] == [("corrupt_chunk", "depth")]
    readable = next(result for result in run.record.results if result.check == "integrity.readable")
    assert readable.findings[0].where.index_start == unreadable[0]


def len_of(sequence: Sequence, key: str) -> int:
    return sequence.layout.bindings[key].rows
