"""No event, one event, and ten million in a millisecond."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.extremes.files import (
    alarms,
    checks_of,
    edited,
    keep_events,
    named,
    outcomes,
    passed,
    record_of,
    replace_events,
)

WITHOUT_INDEX_MAPS = [name for name in checks_of("events") if not name.startswith("index_maps")]
BURST = 10_000_000


@pytest.mark.parametrize("count", [0, 1])
def test_lost_events_are_found(count: int, half_second: Path, tmp_path: Path) -> None:
    """Right: frames that change by more than the thresholds prove that events are missing; nothing of them passes."""
    record = record_of(edited(half_second, tmp_path / "few.h5", lambda file: keep_events(file, count)))
    assert outcomes(record)["event_response.conservation"] == "failed"
    assert "crashed" not in outcomes(record).values()
    assert named(record)[0][0] == "events"
    trivially = {"event_stream.bounds", "event_stream.duplicates"} if count else set()
    assert set(passed(record, WITHOUT_INDEX_MAPS)) <= trivially


@pytest.mark.parametrize("count", [0, 1])
def test_hardly_any_events_at_rest_are_no_fault(count: int, half_second: Path, tmp_path: Path) -> None:
    """Right: without motion, none are due."""

    def rest(file: h5py.File) -> None:
        keep_events(file, count)
        file["path/rgb"][...] = file["path/rgb"][0]
        for name in ("depth", "flow", "imu", "pose"):
            del file[f"path/{name}"]
        del file["path/depth_ts"], file["metadata/depth_to_event"], file["metadata/cameras/depth"]
        for name in ("flow", "imu", "pose"):
            del file[f"metadata/{name}"]

    record = record_of(edited(half_second, tmp_path / "rest.h5", rest))
    assert not alarms(record)


def flood(file: h5py.File) -> None:
    """Add ten million events within a millisecond, each with a pixel and a stamp of its own as far as these go."""
    t, x, y, p = (file[f"path/events/{name}"][:] for name in "txyp")
    camera = file["metadata/cameras/events"].attrs
    width, height = int(camera["width"]), int(camera["height"])
    number = np.arange(BURST)
    where = number % (width * height)
    replace_events(
        file,
        np.concatenate([x, where % width]),
        np.concatenate([y, where // width]),
        np.concatenate([t, 250_000 + number * 1000 // BURST]),
        np.concatenate([p, number // (width * height) % 2]),
    )


def test_ten_million_events_in_a_millisecond(half_second: Path, tmp_path: Path) -> None:
    """Right: such a burst is no sensor's, it is found, and costs neither a crash nor the rest of the file."""
    record = record_of(edited(half_second, tmp_path / "flood.h5", flood), "integrity", "clocks", "event_stream", "imu")
    assert "crashed" not in outcomes(record).values()
    assert named(record)[0] == ("events", "duplicated_samples")
    assert outcomes(record)["imu.timing"] == "passed"
