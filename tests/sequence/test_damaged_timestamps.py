"""One absurd timestamp is a fault of its own stream alone."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.layout.canonical import DATASETS, TIMESTAMPS_OF
from fedora_qa.record.types import FileRecord
from fedora_qa.sequence.facts import clock_of, has_place
from fedora_qa.sequence.sequence import open_sequence
from tests.support.handmade import write_handmade

EPOCH_US = 1_726_000_000_000_000
LEAST, LARGEST = np.iinfo(np.int64).min, np.iinfo(np.int64).max


def damaged(path: Path, key: str, row: int, value: float, origin_us: int = 0) -> Path:
    """Write the handmade file on another clock, with one timestamp damaged; NaN makes its dataset float64."""
    with h5py.File(write_handmade(path), "r+") as file:
        for spec in (spec for spec in DATASETS.values() if spec.is_timestamps and spec.key in file):
            file[spec.key][...] += origin_us
        rows = file[key][()].astype(np.float64 if np.isnan(value) else np.int64)
        rows[row] = value
        del file[key]
        file[key] = rows
    return path


def accused(record: FileRecord) -> set[str]:
    """The streams with a finding, without the index maps, which follow from events and frames."""
    failed = [finding for result in record.results if result.outcome == "failed" for finding in result.findings]
    return {finding.where.stream or "" for finding in failed}


@pytest.mark.parametrize("value", [LEAST, LARGEST, np.nan, 0.0, -1.0], ids=["least", "largest", "NaN", "0", "-1"])
@pytest.mark.parametrize("stream", sorted(TIMESTAMPS_OF))
def test_no_first_timestamp_moves_the_origin(stream: str, value: float, tmp_path: Path) -> None:
    """The origin is that of the other streams, whichever stream begins with an absurd timestamp."""
    with open_sequence(damaged(tmp_path / "first.h5", TIMESTAMPS_OF[stream], 0, value, EPOCH_US)) as sequence:
        assert sequence.origin_ns == EPOCH_US * 1000


@pytest.mark.parametrize("row", [0, 2], ids=["first", "middle"])
@pytest.mark.parametrize(
    "value", [LEAST, LARGEST, np.nan, 0.0, 2.0 * EPOCH_US], ids=["least", "largest", "NaN", "0", "2080"]
)
@pytest.mark.parametrize("stream", ["events", "imu", "pose", "rgb"])
def test_no_other_stream_is_accused(stream: str, value: float, row: int, tmp_path: Path) -> None:
    """The stream is named, for a value that is none, and the others pass all that needs timestamps alone."""
    path = damaged(tmp_path / "one.h5", TIMESTAMPS_OF[stream], row, value, EPOCH_US)
    options = CheckOptions(select=("integrity", "clocks", "index_maps"), evidence=None)
    record = check_file(path, options).record
    assert not [result.reason for result in record.results if result.outcome == "crashed"]
    maps = {"rgb_to_event"} if stream == "rgb" else set()
    assert {stream} <= accused(record) <= {stream} | maps
    assert (stream, "nan_in_stream") in {(diagnosis.stream, diagnosis.cause) for diagnosis in record.diagnoses}
    assert {diagnosis.cause for diagnosis in record.diagnoses} <= {"nan_in_stream", "wrong_dtype", "index_off_by_one"}


def test_a_clock_without_a_place_in_time_does_not_advance() -> None:
    """Where no timestamp is finite, none advances; where some are, the latest of these counts."""
    assert not np.any(clock_of(np.full(4, LEAST // 4), None).advancing)
    times_ns = np.array([-(2**61), 10, 2**61, 5, 20], np.int64)
    clock = clock_of(times_ns, None)
    assert clock.advancing.tolist() == [False, True, False, False, True]
    assert clock.envelope_ns.tolist() == [10, 10, 10, 10, 20]


@pytest.mark.parametrize("row", [0, 25, 50])
@pytest.mark.parametrize("far_ns", [-(10**18), -2_100_000_000_000, 2_100_000_000_000, 10**18])
def test_one_timestamp_far_from_the_others_has_no_place(row: int, far_ns: int) -> None:
    """Half an hour from a second of frames, or 30 years."""
    times_ns = np.arange(51) * 20_000_000
    times_ns[row] += far_ns
    assert np.flatnonzero(~has_place(clock_of(times_ns, None).times_ns)).tolist() == [row]


@pytest.mark.parametrize(("rows", "far_ns"), [(slice(20, 23), 10**18), (slice(30, None), -(10**18)), (20, 10**9)])
def test_a_part_on_another_clock_and_a_late_timestamp_have_a_place(rows: slice | int, far_ns: int) -> None:
    """Three successive timestamps are those of a clock, and one that is late by a second is not absurd."""
    times_ns = np.arange(51) * 20_000_000
    times_ns[rows] += far_ns
    assert has_place(clock_of(times_ns, None).times_ns).all()
