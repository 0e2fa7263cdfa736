"""Stamps at the ends of int64, few frames, and hardly any time."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.record.types import FileRecord
from tests.extremes.files import (
    Edit,
    alarms,
    checks_of,
    edited,
    generated,
    keep_frames,
    named,
    outcomes,
    park,
    passed,
    record_of,
)

ORIGINS_US = {
    "the epoch": 1_726_000_000_000_000,
    "just below 2^53": 2**53 - 250_001,
    "just above 2^53": 2**53 + 1,
    "2^62": 2**62,
    "before zero": -(10**15),
}
"""Beyond 2^53 us every other stamp is lost where float64 holds them."""


def shifted_by(origin_us: int) -> Edit:
    def shift(file: h5py.File) -> None:
        def move(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and name.endswith(("_ts", "/ts", "/t")):
                item[...] = item[...] + origin_us

        file.visititems(move)

    return shift


def measured(record: FileRecord) -> dict[str, list[dict[str, Any]]]:
    """Everything but combs through the clock's zero: another zero makes them others."""
    return {
        result.check: [asdict(one) for one in result.measurements if one.name != "events.partial_grid"]
        for result in record.results
    }


@pytest.fixture(scope="module")
def late_by_2_ms(half_second: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stamps") / "late.h5"
    plant_fault(half_second, path, "time_offset", "imu", 2.0, "ms")
    return path


@pytest.fixture(scope="module")
def from_zero(late_by_2_ms: Path) -> FileRecord:
    """What is found where stamps begin at 0."""
    return record_of(late_by_2_ms)


@pytest.mark.parametrize("origin_us", ORIGINS_US.values(), ids=ORIGINS_US)
def test_no_origin_changes_a_measurement(
    origin_us: int, late_by_2_ms: Path, from_zero: FileRecord, tmp_path: Path
) -> None:
    """Right: every number is that of the file that begins at 0, to the last bit, with its fault and its size."""
    far = record_of(edited(late_by_2_ms, tmp_path / "far.h5", shifted_by(origin_us)))
    assert measured(far) == measured(from_zero)
    assert named(far)[0] == named(from_zero)[0] == ("imu", "time_offset")
    assert far.diagnoses[0].magnitude == from_zero.diagnoses[0].magnitude


def test_float64_timestamps_beyond_2_53_are_said_to_be_coarse(half_second: Path, tmp_path: Path) -> None:
    """Right: stamps that went through float64 microseconds above 2^53 have lost their last bit; never a crash."""

    def through_float64(file: h5py.File) -> None:
        shifted_by(2**53 + 1)(file)
        timestamps = file["path/events/t"]
        timestamps[...] = timestamps[...].astype(np.float64).astype(np.int64)

    record = record_of(edited(half_second, tmp_path / "coarse.h5", through_float64))
    assert "crashed" not in outcomes(record).values()
    assert ("events", "quantised_time") in named(record)


@pytest.mark.parametrize("scene", ["hover", "park-noisy", "fast-turn"])
def test_half_a_second_is_enough_to_be_honest(scene: str, tmp_path: Path) -> None:
    """Right: no alarm; what passes blindly in part says so with numbers."""
    record = record_of(generated(park(scene), tmp_path / "short.h5"))
    assert not alarms(record)
    for result in record.results:
        if result.outcome == "passed" and result.reason:
            assert "detection limit too large" in result.reason


@pytest.mark.parametrize(("count", "cause"), [(0, "missing_stream"), (1, "truncated")], ids=["no frame", "one frame"])
def test_frames_that_are_not_there_are_missed(count: int, cause: str, half_second: Path, tmp_path: Path) -> None:
    """Right: both cameras are named, nothing that compares frames passes; IMU and pose are judged as ever."""
    record = record_of(edited(half_second, tmp_path / "few.h5", lambda file: keep_frames(file, count)))
    assert set(named(record)) == {("rgb", cause), ("depth", cause)}
    one_is_enough = {"index_maps.rgb", "index_maps.depth", "depth.range", "alignment.depth"} if count else set()
    assert set(passed(record, checks_of("rgb", "depth"))) <= one_is_enough
    assert passed(record, ["imu.rotation", "imu.timing"]) == ["imu.rotation", "imu.timing"]
