"""Members of compound types are read, and written, as datasets of their own."""

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError, UnreadableRowsError
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.row_order import Unsorted
from fedora_qa.layout.binding import canonical_rows, raw_rows
from fedora_qa.layout.describe import describe
from fedora_qa.layout.dialect import Dialect, load_dialect
from fedora_qa.layout.draft_file import draft_dialect
from fedora_qa.layout.folder import OpenFolder, matched_folder
from fedora_qa.layout.resolve import Layout, resolve
from fedora_qa.repairs.repair import repair
from tests.support.repairs import given_check

EVENTS = np.dtype([("x", "<u2"), ("y", "<u2"), ("t", ">i8"), ("p", "?")])
SAMPLES = np.dtype([("time", "f8"), ("gyro", "f4", (3,)), ("ax", "f8"), ("ay", "f4"), ("az", "f4"), ("source", "S4")])
DIALECT = """
name = "tables"
[datasets]
"path/events/x" = { path = "events", members = ["x"] }
"path/events/y" = { path = "events", members = ["y"] }
"path/events/t" = { path = "events", members = ["t"], time_unit = "ns" }
"path/events/p" = { path = "events", members = ["p"] }
"path/imu/ts" = { path = "imu", members = ["time"], time_unit = "s" }
"path/imu/angular_velocity" = { path = "imu", members = ["gyro"], value_unit = "deg/s" }
"path/imu/linear_acceleration" = { path = "imu", members = ["ax", "ay", "az"] }
"""


def write_tables(path: Path, **storage: Any) -> Path:
    """Events and samples of an IMU, a table each."""
    random = np.random.default_rng(3)
    events = np.zeros(1000, EVENTS)
    for name, stop in (("x", 90), ("y", 68), ("p", 2)):
        events[name] = random.integers(0, stop, len(events))
    events["t"] = 1_753_000_000_000_000_000 + 1000 * np.arange(len(events))
    samples = np.zeros(200, SAMPLES)
    samples["time"] = np.arange(len(samples)) / 128
    samples["gyro"] = random.normal(size=(len(samples), 3))
    for name in ("ax", "ay", "az"):
        samples[name] = 9.8 * (name == "az") + random.normal(size=len(samples))
    with h5py.File(path, "w") as file:
        file.create_dataset("events", data=events, **storage)
        file.create_dataset("imu", data=samples)
    return path


def dialect_of(folder: Path, text: str = DIALECT) -> Dialect:
    path = folder / "tables.toml"
    path.write_text(text, "utf-8")
    return load_dialect(path)


def replace_events(path: Path, values: np.ndarray) -> None:
    with h5py.File(path, "r+") as file:
        del file["events"]
        file["events"] = values


@pytest.mark.parametrize("storage", [{}, {"chunks": (256,), "compression": "gzip", "fletcher32": True}])
def test_members_are_read_as_datasets(tmp_path: Path, storage: dict[str, Any]) -> None:
    """Each window of rows has the values of the member, in canonical units and without loss."""
    path = write_tables(tmp_path / "tables.h5", **storage)
    with h5py.File(path) as file:
        layout = resolve(file, dialect_of(tmp_path))
        stored = {name: file[name][()] for name in ("events", "imu")}
        assert layout.problems == ()
        assert layout.streams == {"events", "imu"}
        read = {key: canonical_rows(file, each, 100, 150, 0) for key, each in layout.bindings.items()}
    for name in ("x", "y", "p"):
        np.testing.assert_array_equal(read[f"path/events/{name}"], stored["events"][name][100:150])
    assert read["path/events/t"].tolist() == stored["events"]["t"][100:150].tolist()
    np.testing.assert_array_equal(read["path/imu/ts"], np.rint(stored["imu"]["time"][100:150] * 1e9))
    np.testing.assert_allclose(read["path/imu/angular_velocity"], np.deg2rad(stored["imu"]["gyro"][100:150]), rtol=1e-6)
    for axis, name in enumerate(("ax", "ay", "az")):
        np.testing.assert_array_equal(read["path/imu/linear_acceleration"][:, axis], stored["imu"][name][100:150])


def test_other_members_take_no_memory(tmp_path: Path) -> None:
    """A window of one member has the bytes of that member."""
    path = write_tables(tmp_path / "tables.h5")
    with h5py.File(path) as file:
        binding = resolve(file, dialect_of(tmp_path)).bindings["path/events/p"]
        rows = raw_rows(file, binding, 0, 1000)
    assert rows.base is None or rows.base.nbytes == 1000


def test_columns_choose_from_a_member(tmp_path: Path) -> None:
    """A member that is an array may hold gyroscope and accelerometer."""
    path = tmp_path / "samples.h5"
    table = np.zeros(5, [("t", "i8"), ("values", "f4", (6,))])
    table["t"], table["values"] = np.arange(5) * 1000, np.arange(30).reshape(5, 6)
    with h5py.File(path, "w") as file:
        file["imu"] = table
    text = (
        'name = "six"\n[datasets]\n"path/imu/ts" = { path = "imu", members = ["t"] }\n'
        '"path/imu/angular_velocity" = { path = "imu", members = ["values"], columns = [3, 4, 5] }\n'
        '"path/imu/linear_acceleration" = { path = "imu", members = ["values"], columns = [2, 1, 0] }\n'
    )
    with h5py.File(path) as file:
        layout = resolve(file, dialect_of(tmp_path, text))
        force = canonical_rows(file, layout.bindings["path/imu/linear_acceleration"], 1, 2, 0)
    assert layout.problems == ()
    assert force.tolist() == [[8, 7, 6]]


@pytest.mark.parametrize(
    ("dtype", "code", "message"),
    [
        (
            [("x", "u2"), ("yy", "u2"), ("t", "i8"), ("p", "u1")],
            "missing_stream",
            "a member y of events.*members x, yy",
        ),
        ("u2", "wrong_dtype", "events of a compound type with the member x, got uint16"),
        ([("x", "u2"), ("y", "S4"), ("t", "i8"), ("p", "u1")], "wrong_dtype", r"events \(the member y\) as uint16"),
        ([("x", "u2"), ("y", "u2", (2,)), ("t", "i8"), ("p", "u1")], "wrong_shape", r"the member y.*\(4, 2\)"),
        (
            [("x", [("a", "u2")]), ("y", "u2"), ("t", "i8"), ("p", "u1")],
            "wrong_dtype",
            "member x of events as numbers, got",
        ),
    ],
    ids=["no member", "not compound", "text", "array", "compound in compound"],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, dtype: Any, code: str, message: str) -> None:
    """One sentence with the member, and the stream is absent."""
    path = write_tables(tmp_path / "tables.h5")
    replace_events(path, np.zeros(4, dtype))
    with h5py.File(path) as file:
        layout = resolve(file, dialect_of(tmp_path))
    (problem,) = layout.problems
    assert problem.code == f"integrity.layout.{code}"
    assert re.search(message, problem.message)
    assert layout.streams == {"imu"}


def test_ragged_members_are_refused(tmp_path: Path) -> None:
    """HDF5 follows their addresses; members beside them are not read either."""
    path = write_tables(tmp_path / "tables.h5")
    with h5py.File(path, "r+") as file:
        del file["events"]
        file.create_dataset("events", (4,), np.dtype([*EVENTS.descr, ("note", h5py.string_dtype())]))
        layout = resolve(file, dialect_of(tmp_path))
        text = draft_dialect(file, "drafted")
    assert "texts of any length" in layout.absent["events"]
    assert "path/events" not in text


def test_members_of_several_kinds_are_not_one_vector(tmp_path: Path) -> None:
    """Whole numbers beside floating-point numbers have no common type without loss."""
    path = write_tables(tmp_path / "tables.h5")
    text = DIALECT.replace('["ax", "ay", "az"]', '["ax", "ay", "source"]')
    with h5py.File(path) as file:
        (problem,) = resolve(file, dialect_of(tmp_path, text)).problems
    assert "single numbers of one kind, got ax as float64, ay as float32, source as |S4" in problem.message


def test_members_of_other_formats_are_misuse(tmp_path: Path) -> None:
    """Text has columns."""
    text = 'name = "x"\n[files]\ntimes = "t.txt"\n[datasets]\n"path/rgb_ts" = { file = "times", members = ["t"] }\n'
    with pytest.raises(MisuseError, match=r"datasets.path/rgb_ts.members: .* got a role of text; use columns"):
        dialect_of(tmp_path, text)


def test_a_damaged_chunk_is_named_for_each_member(tmp_path: Path) -> None:
    """The rows of other chunks are read."""
    path = write_tables(tmp_path / "tables.h5", chunks=(256,), compression="gzip")
    with h5py.File(path) as file:
        place = file["events"].id.get_chunk_info(1)
    with path.open("r+b") as raw:
        raw.seek(place.byte_offset + 8)
        raw.write(b"\xff" * 16)
    with h5py.File(path) as file:
        binding = resolve(file, dialect_of(tmp_path)).bindings["path/events/y"]
        assert len(raw_rows(file, binding, 0, 256)) == 256
        with pytest.raises(UnreadableRowsError) as raised:
            raw_rows(file, binding, 0, 1000)
    assert raised.value.chunks == (1,)


def test_a_draft_names_the_members(tmp_path: Path) -> None:
    """The draft reads the file from which it was drafted; members that nothing uses are listed."""
    path = write_tables(tmp_path / "tables.h5")
    with h5py.File(path) as file:
        text = draft_dialect(file, "drafted")
    layout, unknown = described(path, dialect_of(tmp_path, text))
    assert layout.problems == ()
    assert layout.streams == {"events", "imu"}
    assert layout.bindings["path/imu/linear_acceleration"].members == ("ax", "ay", "az")
    assert layout.bindings["path/events/t"].ns_per_unit == 1000
    assert "#   source of imu" not in text  # no number
    assert unknown == ("source of imu",)


def described(path: Path, dialect: Dialect) -> tuple[Layout, tuple[str, ...]]:
    with h5py.File(path) as file:
        layout = resolve(file, dialect)
        return layout, describe(file, layout).unused


@pytest.mark.parametrize("names", [("x", "y", "timestamp", "polarity"), ("X", "Y", "T", "P"), ("xs", "ys", "ts", "ps")])
def test_other_names_of_events_are_guessed(tmp_path: Path, names: tuple[str, ...]) -> None:
    """Names that public layouts have for the parts of an event."""
    path = write_tables(tmp_path / "tables.h5")
    with h5py.File(path) as file:
        events = file["events"][()]
    renamed = events.astype(np.dtype([(name, EVENTS[old]) for name, old in zip(names, EVENTS.names, strict=True)]))
    replace_events(path, renamed)
    with h5py.File(path) as file:
        layout = resolve(file, dialect_of(tmp_path, draft_dialect(file, "drafted")))
    assert "events" in layout.streams
    assert [layout.bindings[f"path/events/{part}"].members for part in "xytp"] == [(name,) for name in names]


def test_parts_of_a_quaternion_are_no_position(tmp_path: Path) -> None:
    """Four members of unit length are an orientation, in the order of their names."""
    path = tmp_path / "poses.h5"
    table = np.zeros(9, [(name, "f8") for name in ("t", "qw", "qx", "qy", "qz", "x", "y", "z")])
    table["t"], table["qw"], table["y"] = np.arange(9) * 0.01, 1.0, 4.0
    with h5py.File(path, "w") as file:
        file["poses"] = table
        layout = resolve(file, dialect_of(tmp_path, draft_dialect(file, "drafted")))
        assert layout.streams == {"pose"}
        assert canonical_rows(file, layout.bindings["path/pose/orientation"], 0, 1, 0).tolist() == [[0, 0, 0, 1]]
        assert canonical_rows(file, layout.bindings["path/pose/position"], 0, 1, 0).tolist() == [[0, 4, 0]]


def test_members_in_a_folder(tmp_path: Path) -> None:
    """A role of HDF5 has members as a file by itself has."""
    (tmp_path / "flight").mkdir()
    write_tables(tmp_path / "flight" / "tables.h5")
    text = DIALECT.replace("[datasets]", '[files]\ntables = "*.h5"\n[datasets]').replace(
        "{ path", '{ file = "tables", path'
    )
    matched = matched_folder(tmp_path / "flight", dialect_of(tmp_path, text))
    assert matched is not None
    folder = OpenFolder(matched)
    layout = resolve(folder)
    folder.close()
    assert layout.streams == {"events", "imu"}


def test_a_repair_writes_one_member(tmp_path: Path) -> None:
    """All other members keep their bytes, padding and byte order included."""
    path = write_tables(tmp_path / "tables.h5", chunks=(256,), compression="gzip")
    options = CheckOptions(dialect=dialect_of(tmp_path))
    out = tmp_path / "out.h5"
    result = repair(path, out, options, quiet, check=given_check(path, ClockShift("events", 2.5e6)))
    assert not result.refusal
    with h5py.File(path) as old, h5py.File(out) as new:
        assert new["events"].dtype == old["events"].dtype
        for name in ("x", "y", "p"):
            np.testing.assert_array_equal(new["events"][name], old["events"][name])
        np.testing.assert_array_equal(new["events"]["t"], old["events"]["t"] - 2_500_000)
        np.testing.assert_array_equal(new["imu"][()], old["imu"][()])


def test_rows_with_members_without_a_place_are_not_moved(tmp_path: Path) -> None:
    """They would stay behind."""
    path = write_tables(tmp_path / "tables.h5")
    with h5py.File(path, "r+") as file:
        samples = file["imu"][()]
        samples[:3] = samples[[2, 0, 1]]
        file["imu"][...] = samples
    options = CheckOptions(dialect=dialect_of(tmp_path))
    result = repair(path, tmp_path / "out.h5", options, quiet, check=given_check(path, Unsorted("imu", 0, 3)))
    assert "source of imu" in result.refusal
