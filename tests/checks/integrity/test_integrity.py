"""The file itself: layout and stored bytes."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.handmade import write_handmade


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The handmade file, to be altered."""
    return write_handmade(tmp_path / "hand.h5")


def damage(path: Path, key: str, chunks: list[int]) -> None:
    """Overwrite the middle of stored chunks."""
    with h5py.File(path) as file:
        infos = [file[key].id.get_chunk_info(chunk) for chunk in chunks]
    with path.open("r+b") as raw:
        for info in infos:
            raw.seek(info.byte_offset + info.size // 2)
            raw.write(b"\xde\xad\xbe\xef")


def test_clean_file(path: Path) -> None:
    """The handmade file passes, and all of it was seen."""
    for name in ("integrity.layout", "integrity.readable", "integrity.finite"):
        result = run_check(path, name)
        assert result.outcome == "passed", result
        assert result.coverage is not None
        assert result.coverage.seen == result.coverage.of > 0
        assert all(m.value == 0 for m in result.measurements)


def test_layout_problem_is_critical_and_diagnosed(path: Path) -> None:
    """A declared stream that is not there fails, and the diagnosis names it."""
    with h5py.File(path, "r+") as file:
        del file["path/imu"]
    result = run_check(path, "integrity.layout")
    assert (result.outcome, rules(result)) == ("failed", ["missing_stream"])
    assert result.findings[0].severity == "critical"
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream) == ("missing_stream", "imu")


def test_same_fault_of_every_rate_is_one_of_the_flow(path: Path) -> None:
    """Three rates in a wrong type are one finding and one diagnosis of the flow; a single rate is named itself."""
    with h5py.File(path, "r+") as file:
        for rate in ("10hz", "25hz", "50hz"):
            values = file[f"path/flow/{rate}"][()].astype(np.float16)
            del file[f"path/flow/{rate}"]
            file[f"path/flow/{rate}"] = values
    (diagnosis,) = diagnoses_of(path, "integrity.layout")
    assert (diagnosis.cause, diagnosis.stream, len(diagnosis.explains)) == ("wrong_dtype", "flow", 1)
    (finding,) = (each for each in run_check(path, "integrity.layout").findings if each.id in diagnosis.explains)
    assert {where.stream for where in finding.all_places} == {"flow/10hz", "flow/25hz", "flow/50hz"}
    write_handmade(path)
    with h5py.File(path, "r+") as file:
        values = file["path/flow/25hz"][()].astype(np.float16)
        del file["path/flow/25hz"]
        file["path/flow/25hz"] = values
    (diagnosis,) = diagnoses_of(path, "integrity.layout")
    assert (diagnosis.cause, diagnosis.stream) == ("wrong_dtype", "flow/25hz")


@pytest.mark.parametrize(
    ("key", "chunks", "stream", "rows"),
    [
        ("path/depth", [2, 4], "depth", (2, 5)),
        ("path/rgb", [0], "rgb", (0, 1)),
        ("path/flow/50hz", [4], "flow/50hz", (4, 5)),
        ("path/events/x", [0], "events", (0, 77)),
        ("path/pose/position", [0], "pose", (0, 21)),
        ("metadata/rgb_to_event", [0], "rgb_to_event", (0, 6)),
    ],
)
def test_damaged_chunks_are_counted_and_located(
    path: Path, key: str, chunks: list[int], stream: str, rows: tuple[int, int]
) -> None:
    """Each damaged chunk is one finding's count, with the rows it holds; every other stream stays readable."""
    damage(path, key, chunks)
    result = run_check(path, "integrity.readable")
    counts = {m.name: m.value for m in result.measurements if m.value}
    assert counts == {f"{stream}.unreadable_chunks": len(chunks)}
    where = result.findings[0].where
    assert (where.stream, where.index_start, where.index_stop) == (stream, *rows)
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("corrupt_chunk", stream, len(chunks))


@pytest.mark.parametrize("key", ["path/imu/ts", "path/depth_ts", "path/events/t"])
def test_damaged_timestamps_are_found(path: Path, key: str) -> None:
    """A stream whose stamps cannot be read has no place in time, and is found all the same."""
    damage(path, key, [0])
    result = run_check(path, "integrity.readable")
    assert result.outcome == "failed"
    assert {finding.where.stream for finding in result.findings} == {key.split("/")[1].removesuffix("_ts")}


def test_every_timestamp_damaged(tmp_path: Path) -> None:
    """A file without one readable stamp has no windows at all; that is a finding, not silence."""
    path = tmp_path / "pose.h5"
    with h5py.File(write_handmade(path), "r+") as file:
        del file["path"]
        file.create_dataset("path/pose/ts", data=np.arange(21), chunks=(21,), fletcher32=True)
        file["path/pose/position"] = np.zeros((21, 3))
        file["path/pose/orientation"] = np.tile([0.0, 0.0, 0.0, 1.0], (21, 1))
    damage(path, "path/pose/ts", [0])
    result = run_check(path, "integrity.readable")
    assert (result.outcome, rules(result)) == ("failed", ["stamps"])


def stored_again(path: Path, key: str, chunks: tuple[int, ...]) -> None:
    """Store a dataset in chunks of another shape."""
    with h5py.File(path, "r+") as file:
        values, attributes = file[key][()], dict(file[key].attrs)
        del file[key]
        file.create_dataset(key, data=values, chunks=chunks, fletcher32=True).attrs.update(attributes)


def test_small_chunks_are_counted_one_by_one(path: Path) -> None:
    """Events in chunks of ten rows: each chunk counts, although 4096 rows are decoded together."""
    before = run_check(path, "integrity.readable").coverage
    stored_again(path, "path/events/x", (10,))
    after = run_check(path, "integrity.readable").coverage
    assert before is not None
    assert after is not None
    assert (after.seen - before.seen, after.of - before.of) == (7, 7)  # 77 events: eight chunks in place of one
    damage(path, "path/events/x", [2, 7])
    result = run_check(path, "integrity.readable")
    assert [m.value for m in result.measurements if m.name == "events.unreadable_chunks"] == [2]
    assert "2 chunks of events (17 rows)" in result.findings[0].message
    assert (result.findings[0].where.index_start, result.findings[0].where.index_stop) == (20, 77)


def test_tiles_of_images_are_counted_one_by_one(path: Path) -> None:
    """Frames of 27 x 36 in tiles of 9 x 12: nine chunks a frame, of which three are damaged, in two frames."""
    before = run_check(path, "integrity.readable").coverage
    stored_again(path, "path/rgb", (1, 9, 12, 3))
    after = run_check(path, "integrity.readable").coverage
    assert before is not None
    assert after is not None
    assert (after.seen - before.seen, after.of - before.of) == (6 * 8, 6 * 8)
    damage(path, "path/rgb", [10, 11, 40])
    result = run_check(path, "integrity.readable")
    assert [m.value for m in result.measurements if m.name == "rgb.unreadable_chunks"] == [3]
    assert "3 chunks of rgb (2 rows)" in result.findings[0].message
