"""A drafted dialect opens the file that it was drafted from."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.layout.binding import canonical_rows
from fedora_qa.layout.canonical import STREAMS
from fedora_qa.layout.dialect import Dialect, load_dialect
from fedora_qa.layout.draft_file import draft_dialect
from fedora_qa.layout.guesses import guess_places, unit_of_timestamps
from fedora_qa.layout.inventory import StoredObject
from fedora_qa.layout.resolve import resolve
from tests.support.foreign import write_mvsec, write_purdue_lab
from tests.support.handmade import write_handmade


def draft(path: Path) -> tuple[str, Dialect]:
    with h5py.File(path) as file:
        text = draft_dialect(file, "drafted")
    target = path.with_suffix(".toml")
    target.write_text(text, "utf-8")
    return text, load_dialect(target)


def write_unknown(path: Path) -> Path:
    """A layout that no dialect describes: nanoseconds, metres, quaternions, odd names."""
    random = np.random.default_rng(2)
    with h5py.File(path, "w") as file:
        file["cam/colour/frames"] = np.zeros((4, 8, 10, 3), dtype=np.uint8)
        file["cam/colour/timestamps"] = np.arange(4) * 33_000_000 + 5
        file["cam/range"] = random.uniform(1, 9, (4, 8, 10)).astype(np.float32)
        file["cam/range_time"] = np.arange(4) * 33_000_000 + 5
        file["dvs/data"] = np.column_stack(
            [np.arange(40) * 1e5, random.integers(0, 99, 40), random.integers(0, 77, 40), np.arange(40) % 2]
        )
        file["nav/gyro"] = random.normal(size=(50, 3))
        file["nav/accel"] = random.normal(size=(50, 3))
        file["nav/stamps"] = np.arange(50) * 2_000_000
        file["odd/matrix"] = np.eye(5)
    return path


@pytest.mark.parametrize(
    ("write", "streams"),
    [
        (write_handmade, set(STREAMS)),
        (write_purdue_lab, {"rgb", "depth", "events"}),
        (write_mvsec, {"rgb", "events"}),
        (write_unknown, {"rgb", "depth", "events", "imu"}),
    ],
)
def test_draft_opens_its_file(write: Callable[[Path], Path], streams: set[str], tmp_path: Path) -> None:
    """The draft is a dialect, finds the streams that can be told from values, and reads without problems."""
    path = write(tmp_path / "file.h5")
    _, dialect = draft(path)
    with h5py.File(path) as file:
        layout = resolve(file, dialect)
    assert layout.streams == streams
    # A stream of which a part has no place is noted.
    assert all(problem.is_lossless for problem in layout.problems)


def test_units_and_columns_are_guessed(tmp_path: Path) -> None:
    """Nanoseconds, metres, and the columns of t and p are told from the values."""
    path = write_unknown(tmp_path / "file.h5")
    text, dialect = draft(path)
    with h5py.File(path) as file:
        bindings = resolve(file, dialect).bindings
        assert canonical_rows(file, bindings["path/events/t"], 0, 3, 0).tolist() == [0, 100_000, 200_000]
        assert canonical_rows(file, bindings["path/events/p"], 0, 3, 0).tolist() == [0, 1, 0]
        assert 1000 <= canonical_rows(file, bindings["path/depth"], 0, 4, 0).min() <= 9000
        assert canonical_rows(file, bindings["path/imu/ts"], 0, 2, 0).tolist() == [0, 2_000_000]
    assert "#   odd/matrix  5 x 5  float64" in text


def test_every_guess_has_a_reason(tmp_path: Path) -> None:
    """Each place stands below a comment."""
    text, dialect = draft(write_unknown(tmp_path / "file.h5"))
    lines = text.splitlines()
    places = [number for number, line in enumerate(lines) if line.startswith('"')]
    assert len(places) == len(dialect.datasets)
    assert all(lines[number - 1].startswith("# ") for number in places)


@given(st.text(st.characters(codec="utf-8", exclude_characters="/\0"), min_size=1).filter(lambda name: name != "."))
def test_any_name_survives(name: str) -> None:
    """Names in HDF5 hold quotes, newlines and control characters: none breaks the draft, and none that cannot be shown
    on a terminal gets into it."""
    with h5py.File("draft.h5", "w", driver="core", backing_store=False) as file:
        group = file.create_group(name)
        for member in "xytp":
            group[member] = np.arange(3) % 2 if member == "p" else np.arange(3)
        read = tomllib.loads(draft_dialect(file, name))
    assert read["name"] == name
    places = read["datasets"]
    assert places["path/events/x"]["path"] == f"{name}/x" if name.isprintable() else not places


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("origin_s", [0.0, 1.75e9], ids=["from zero", "epoch"])
def test_unit_of_frames(unit: str, origin_s: float) -> None:
    """The unit of frame stamps is told from their date, or from their step."""
    per_s = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    timestamps = (origin_s + np.arange(5) * 0.02) * per_s
    assert unit_of_timestamps(timestamps, "frames")[0] == unit


@pytest.mark.parametrize("rate_hz", [2_000, 400_000, 20_000_000])
@pytest.mark.parametrize("unit", ["s", "us"])
def test_unit_of_events(unit: str, rate_hz: float) -> None:
    """Seconds have fractions, and whole microseconds have none."""
    times_us = np.floor(np.arange(256) * 1e6 / rate_hz) + 40
    assert unit_of_timestamps(times_us / {"s": 1e6, "us": 1.0}[unit], "events")[0] == unit


def test_map_from_milliseconds(tmp_path: Path) -> None:
    """It is placed by its name, where the events are."""
    with h5py.File(tmp_path / "events.h5", "w") as file:
        times_us = np.arange(0, 90_000, 300)
        for name, values in (("x", times_us % 7), ("y", times_us % 5), ("t", times_us), ("p", times_us // 300 % 2)):
            file[f"events/{name}"] = values
        file["ms_to_idx"] = np.searchsorted(times_us, 1000 * np.arange(90))
    _, dialect = draft(tmp_path / "events.h5")
    with h5py.File(tmp_path / "events.h5") as file:
        layout = resolve(file, dialect)
    assert layout.bindings["metadata/ms_to_event"].path == "ms_to_idx"
    assert not layout.problems


def test_maps_from_frames_and_the_range_of_depth_are_placed_by_name(tmp_path: Path) -> None:
    """A draft that leaves them out loses the checks of what the file has; a map of other numbers is none."""
    path = write_handmade(tmp_path / "file.h5")
    with h5py.File(path, "r+") as file:
        frames, events = len(file["path/rgb_ts"]), len(file["path/events/t"])
        indices = np.linspace(0, events, frames).astype(np.int64)
        for name in ("rgb_to_event", "depth_to_event", "depth_range"):
            if f"metadata/{name}" in file:
                del file[f"metadata/{name}"]
        file["index/image_to_event"] = indices
        file["index/depth_to_event"] = np.linspace(0, events, len(file["path/depth_ts"])).astype(np.int64)
        file["range_of_depth/range"] = [0.1, 30.0]
        file["index/first_to_event"] = indices + 1  # points behind the last event
    text, dialect = draft(path)
    with h5py.File(path) as file:
        bindings = resolve(file, dialect).bindings
    assert bindings["metadata/rgb_to_event"].path == "index/image_to_event"
    assert bindings["metadata/depth_to_event"].path == "index/depth_to_event"
    assert bindings["metadata/depth_range"].path == "range_of_depth/range"
    assert "#   index/first_to_event" in text


def test_the_draft_of_a_file_has_the_declarations_to_fill_in(tmp_path: Path) -> None:
    text, _ = draft(write_unknown(tmp_path / "unknown.h5"))
    declarations = text.partition("[metadata]")[2]
    assert '# "metadata/cameras/rgb/width" = 10' in declarations
    assert '# "metadata/cameras/rgb/height" = 8' in declarations
    assert '# "metadata/cameras/events/K" = ' in declarations
    assert '# "metadata/events/threshold_on" = ON' in declarations


@pytest.mark.parametrize(("name", "is_depth"), [("depth", True), ("inverse_depth", False), ("left/invdepth", False)])
def test_inverse_depth_is_not_taken_for_depth(tmp_path: Path, name: str, is_depth: bool) -> None:
    path = tmp_path / "unknown.h5"
    with h5py.File(path, "w") as file:
        file["rgb"] = np.zeros((4, 8, 10, 3), dtype=np.uint8)
        file["rgb_ts"] = np.arange(4) * 33_000
        file[name] = np.random.default_rng(3).uniform(0.1, 0.9, (4, 8, 10)).astype(np.float32)
    text, dialect = draft(path)
    assert ("path/depth" in dialect.datasets) is is_depth
    assert (f"#   {name}  4 x 8 x 10  float32" in text) is not is_depth


def test_the_draft_states_by_how_much_coded_flow_of_kitti_differs() -> None:
    pictures = np.full((1, 8, 10, 3), 32768, dtype=np.uint16)
    intervals = np.column_stack([np.arange(4), np.arange(1, 5)]) * 20_000
    items = [
        StoredObject("flow/*.png", (4, 8, 10, 3), pictures.dtype, pictures, "flow", "images"),
        StoredObject("flow.txt", (4, 2), intervals.dtype, intervals, "times", "text"),
    ]
    guess = next(guess for guess in guess_places(items) if guess.key == "path/flow/50hz")
    assert guess.fields["convert"] == "flow16"
    assert "scale = 2.0" in guess.reason
