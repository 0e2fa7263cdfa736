"""Events that the generator makes of a file's own frames, against a naive simulator."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.faults import FaultError, plant_fault
from tests.generator.tiny_sequence import write_tiny_sequence
from tests.support.naive_events import naive_events

CAUSE = ("interpolated_frames", "events")


@pytest.fixture
def clean(tmp_path: Path) -> Path:
    path = tmp_path / "clean.h5"
    write_tiny_sequence(path)
    return path


def table_of(path: Path) -> np.ndarray:
    """Rows t, y, x, p."""
    with h5py.File(path) as file:
        return np.stack([file[f"path/events/{name}"][...].astype(np.int64) for name in "tyxp"], axis=1)


def expected_of(path: Path) -> np.ndarray:
    """Rows t, y, x, p by the naive simulator, of frames that have the size of the sensor."""
    with h5py.File(path) as file:
        sensor, colour = (file[f"metadata/cameras/{name}"].attrs for name in ("events", "rgb"))
        assert (sensor["width"], sensor["height"]) == (colour["width"], colour["height"])
        luma = file["path/rgb"][...] @ np.array([0.299, 0.587, 0.114])
        thresholds = (float(file["metadata/events"].attrs[f"threshold_{side}"]) for side in ("on", "off"))
        events = naive_events(list(luma), file["path/rgb_ts"][...].tolist(), *thresholds)
    return np.stack([events.times_ns // 1000, events.y, events.x, events.p], axis=1).astype(np.int64)


def test_events_are_those_of_a_naive_simulator(clean: Path, tmp_path: Path) -> None:
    """The same crossings, to a microsecond of rounding; nothing is left of the events before."""
    plant_fault(clean, tmp_path / "faulty.h5", *CAUSE)
    planted, expected = table_of(tmp_path / "faulty.h5"), expected_of(clean)
    by_pixel = [table[np.lexsort((table[:, 0], table[:, 2], table[:, 1]))] for table in (planted, expected)]
    np.testing.assert_array_equal(by_pixel[0][:, 1:], by_pixel[1][:, 1:])
    assert np.abs(by_pixel[0][:, 0] - by_pixel[1][:, 0]).max() <= 1


def test_an_interval_is_from_frame_to_frame(clean: Path, tmp_path: Path) -> None:
    """Events outside of the frames of 0.1 to 0.3 s stay."""
    plant_fault(clean, tmp_path / "faulty.h5", *CAUSE, start_s=0.1, stop_s=0.3)
    before, after = table_of(clean), table_of(tmp_path / "faulty.h5")

    def outside(table: np.ndarray) -> np.ndarray:
        return table[(table[:, 0] <= 100_000) | (table[:, 0] > 280_000)]

    np.testing.assert_array_equal(outside(after), outside(before))
    assert len(after) != len(before)


def test_packets_and_linear_sensors(clean: Path, tmp_path: Path) -> None:
    """Timestamps are multiples of the packet; a linear sensor needs steps."""
    with h5py.File(clean, "r+") as file:
        file["metadata/events"].attrs["packet_interval_us"] = 200
    plant_fault(clean, tmp_path / "packets.h5", *CAUSE)
    assert not np.any(table_of(tmp_path / "packets.h5")[:, 0] % 200)
    with h5py.File(clean, "r+") as file:
        file["metadata/events"].attrs["model"] = "linear"
        file["metadata/events"].attrs["threshold_on"] = file["metadata/events"].attrs["threshold_off"] = 15.0
    with pytest.raises(FaultError, match="steps"):
        plant_fault(clean, tmp_path / "linear.h5", *CAUSE)
    with h5py.File(clean, "r+") as file:
        times = file["path/events/t"]
        times[...] = -(-times[...] // 1000) * 1000
    plant_fault(clean, tmp_path / "linear.h5", *CAUSE)
    table = table_of(tmp_path / "linear.h5")
    assert not np.any(table[:, 0] % 1000)
    assert len(np.unique(table[:, :3], axis=0)) == len(table)
