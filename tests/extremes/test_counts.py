"""Counts and rows beyond int32 and uint32, images of one pixel and of 16 bits, a single sample."""

from pathlib import Path
from typing import Final

import h5py
import numpy as np
import pytest

from fedora_qa.layout.binding import Binding, canonical_rows, rows_together
from fedora_qa.layout.decodable import unwritten_chunks
from fedora_qa.sequence.scan import longest_steps
from tests.extremes.files import alarms, edited, outcomes, record_of, replace_rows
from tests.support.handmade import write_handmade

BORDERS: Final = (2**31, 2**32)
CHUNK_ROWS: Final = 1 << 16
MOTION: Final = ("path/imu/angular_velocity", "path/imu/linear_acceleration", "path/imu/ts",
                 "path/pose/position", "path/pose/orientation", "path/pose/ts")  # fmt: skip


@pytest.fixture(scope="module")
def handmade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_handmade(tmp_path_factory.mktemp("counts") / "clean.h5")


@pytest.mark.parametrize("border", BORDERS, ids=["2^31", "2^32"])
def test_rows_on_both_sides_of_a_border_are_read(border: int, tmp_path: Path) -> None:
    """A sparse stream of events longer than the border: what stands there is read by its row, and counted so."""
    written = np.arange(border - 1000, border + 1000)
    with h5py.File(tmp_path / "sparse.h5", "w") as file:
        stored = file.create_dataset("t", (border + 2 * CHUNK_ROWS,), np.int64, chunks=(CHUNK_ROWS,), fletcher32=True)
        stored[written[0] : written[-1] + 1] = written * 7
        rows = stored.shape[0]
        bound = Binding("path/events/t", "t", rows, (rows,), stored.dtype, ns_per_unit=1000, chunk_rows=CHUNK_ROWS)
        read = canonical_rows(file, bound, border - 5, border + 5, 0)
        assert unwritten_chunks(stored) == (rows // CHUNK_ROWS - 2, rows // CHUNK_ROWS)
    assert read.tolist() == [row * 7000 for row in range(border - 5, border + 5)]
    assert rows_together("path/events/t", 1) * (border // 4096) == border


def test_steps_are_numbered_beyond_int32() -> None:
    """The row of a step is a whole number of any size."""
    start = 2**33
    steps = longest_steps((), start, 0, np.array([10, 5, 2**60], np.int64))
    assert [step.row for step in steps] == [start, start + 1, start + 2]
    assert steps[-1].length_ns == 2**60 - 5


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        (np.array([2**31 - 1, 2**31, 2**32 - 1], np.uint32), [2**31 - 1, 2**31, 2**32 - 1]),
        (np.array([2**31 - 1, -(2**31), -1], np.int32), [2**31 - 1, -(2**31), -1]),
        (np.array([2**63, 2**64 - 1], np.uint64), [2**63 - 1, 2**63 - 1]),
        (np.array([2.0**40, np.nan, np.inf]), [2**40, -1, 2**61]),
    ],
    ids=["uint32", "int32 that wrapped", "uint64", "float64"],
)
def test_counters_keep_what_they_say(stored: np.ndarray, expected: list[int], tmp_path: Path) -> None:
    """Index maps in other types are read as they are, wrapped ones as the negative numbers that they became."""
    with h5py.File(tmp_path / "map.h5", "w") as file:
        file["map"] = stored
        bound = Binding("metadata/rgb_to_event", "map", len(stored), stored.shape, stored.dtype)
        assert canonical_rows(file, bound, 0, len(stored), 0).tolist() == expected


def test_an_index_map_that_wrapped_is_found(handmade: Path, tmp_path: Path) -> None:
    """Right: a map that passed 2^31 in 32 bits points before the first event, and the check says so."""

    def wrap(file: h5py.File) -> None:
        known = file["metadata/rgb_to_event"][()] + 2**31
        replace_rows(file, "metadata/rgb_to_event", known.astype(np.uint32).view(np.int32))

    found = outcomes(record_of(edited(handmade, tmp_path / "wrapped.h5", wrap)))
    assert found["index_maps.rgb"] == "failed"
    assert "crashed" not in found.values()


@pytest.mark.parametrize("bits", [12, 16])
def test_frames_of_more_than_8_bits_are_named(bits: int, handmade: Path, tmp_path: Path) -> None:
    """Right: the layout's frames are of 8 bits; others are a wrong type by name, and no check crashes over them."""

    def widen(file: h5py.File) -> None:
        frames = file["path/rgb"][()].astype(np.uint16) * (2**bits - 1) // 255
        replace_rows(file, "path/rgb", frames)

    record = record_of(edited(handmade, tmp_path / "wide.h5", widen))
    assert outcomes(record)["integrity.layout"] == "failed"
    assert "crashed" not in outcomes(record).values()
    assert any("uint16" in text and "path/rgb" in text for text in alarms(record))


def test_images_of_one_pixel_pass_nothing_that_needs_two(handmade: Path, tmp_path: Path) -> None:
    """Right: no crash, no alarm, and nothing of shape or texture passes."""

    def shrink(file: h5py.File) -> None:
        for key in ("rgb", "depth", "flow/10hz", "flow/25hz", "flow/50hz"):
            replace_rows(file, f"path/{key}", file[f"path/{key}"][:, 10:11, 10:11])
        for name in ("rgb", "depth", "events"):
            camera = file[f"metadata/cameras/{name}"].attrs
            camera["width"] = camera["height"] = 1
            camera["K"] = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        for axis in "xy":
            file[f"path/events/{axis}"][...] = 0

    record = record_of(edited(handmade, tmp_path / "pixel.h5", shrink))
    assert not alarms(record)
    seeing = [
        name for name, outcome in outcomes(record).items() if outcome == "passed" and name.startswith("alignment")
    ]
    assert not seeing


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_a_few_samples_of_motion_are_no_alarm(count: int, handmade: Path, tmp_path: Path) -> None:
    """Right: three samples or fewer of IMU and pose prove nothing of each other, and nothing crashes over them."""

    def keep(file: h5py.File) -> None:
        for key in MOTION:
            replace_rows(file, key, file[key][:count])

    found = outcomes(record_of(edited(handmade, tmp_path / "few.h5", keep)))
    assert "crashed" not in found.values()
    comparing = [name for name in ("imu.rotation", "imu.translation", "imu.timing") if found[name] == "passed"]
    assert not comparing
