"""A piece holds the rows of its time, stored as they were; links, attributes and damage survive."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.plan import window_length_ns
from fedora_qa.engine.tasks import check_file
from fedora_qa.extract.extract import Cutter, entries_kept
from fedora_qa.extract.place import CutRows, Piece
from fedora_qa.layout.resolve import detect_dialect
from fedora_qa.sequence.facts import IndexMap
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import open_sequence
from tests.support.foreign import write_purdue_lab

MS = 1_000_000
MIDDLE = Piece(320 * MS, 680 * MS)
TIMESTAMPS = ("integrity", "metadata", "clocks", "index_maps", "event_stream")

Kept = dict[str, CutRows]


def cut(source: Path, target: Path, piece: Piece = MIDDLE) -> tuple[Kept, tuple[str, ...]]:
    """Write a piece of a file."""
    with open_sequence(source) as sequence, h5py.File(source) as file:
        scanned = scan(sequence, window_length_ns(sequence))
        return Cutter(file, sequence, scanned, detect_dialect(file)).write(piece, target)


def values(file: h5py.File, path: str) -> np.ndarray[Any, Any]:
    """All values of a dataset."""
    dataset = file[path]
    assert isinstance(dataset, h5py.Dataset)
    return np.asarray(dataset[...])


@pytest.fixture
def copy(park_day: Path, tmp_path: Path) -> Path:
    """A copy of a clean second that may be written into."""
    return Path(shutil.copy(park_day, tmp_path / "seq.h5"))


def test_rows_of_its_time(park_day: Path, tmp_path: Path) -> None:
    """Values and stamps are those of the file between the ends of the piece; flow has whole intervals."""
    kept, left_out = cut(park_day, tmp_path / "piece.h5")
    assert left_out == ()
    with h5py.File(park_day) as whole, h5py.File(tmp_path / "piece.h5") as piece:
        for path in ("path/rgb", "path/depth_ts", "path/events/t", "path/imu/angular_velocity", "path/flow/25hz"):
            rows = kept[next(stream for stream in sorted(kept, key=len, reverse=True) if f"path/{stream}" in path)]
            assert np.array_equal(values(piece, path), values(whole, path)[rows.start : rows.stop], equal_nan=True)
        for path in ("path/rgb_ts", "path/events/t", "path/imu/ts", "path/pose/ts", "path/flow/10hz_ts"):
            timestamps = values(piece, path)
            assert len(timestamps)
            assert 320_000 <= timestamps.min() <= timestamps.max() <= 680_000
        frames, events = values(piece, "path/rgb_ts"), values(piece, "path/events/t")
        assert values(piece, "metadata/rgb_to_event").tolist() == [int(np.sum(events < frame)) for frame in frames]


def test_milliseconds_count_on_the_clock_of_the_piece(copy: Path, tmp_path: Path) -> None:
    """The map from milliseconds ends with the piece, and counts its events, before whose first there are none."""
    with h5py.File(copy, "r+") as file:
        # Long after the last event, so that the map is larger than what is copied whole.
        file["metadata/ms_to_event"] = np.searchsorted(file["path/events/t"][:], 1000 * np.arange(10_000))
        file["metadata/rectify_map"] = np.zeros((180, 240, 2), np.float32)
    kept, left_out = cut(copy, tmp_path / "piece.h5")
    assert left_out == ()
    with h5py.File(tmp_path / "piece.h5") as piece:
        times_us, entries = values(piece, "path/events/t"), values(piece, "metadata/ms_to_event")
        assert entries.tolist() == [int(np.sum(times_us < 1000 * k)) for k in range(len(entries))]
        assert entries[-1] == len(times_us) > entries[-2]
        assert kept["ms_to_event"] == CutRows(0, len(entries), 10_000)
        assert values(piece, "metadata/rectify_map").shape == (180, 240, 2)
    record = check_file(tmp_path / "piece.h5", CheckOptions(select=("index_maps",), evidence=None)).record
    assert {result.outcome for result in record.results} == {"passed"}


def test_a_piece_of_a_clean_file_is_clean(park_day: Path, tmp_path: Path) -> None:
    """Cutting plants nothing: what is asked of stamps, maps and declarations is in order in a piece too."""
    cut(park_day, tmp_path / "piece.h5")
    record = check_file(tmp_path / "piece.h5", CheckOptions(select=TIMESTAMPS, evidence=None)).record
    assert [result.check for result in record.results if result.outcome in {"failed", "warned", "crashed"}] == []


def test_stored_as_it_was(park_day: Path, tmp_path: Path) -> None:
    """Types, chunks, codec, checksum and attributes are those of the file."""
    cut(park_day, tmp_path / "piece.h5")
    with h5py.File(park_day) as whole, h5py.File(tmp_path / "piece.h5") as piece:
        assert same_attributes(whole, piece)

        def compare(path: str, one: h5py.Group | h5py.Dataset) -> None:
            other = piece[path]
            assert same_attributes(one, other), path
            if isinstance(one, h5py.Dataset):
                assert (one.dtype, one.chunks, one.fletcher32) == (other.dtype, other.chunks, other.fletcher32), path
                assert one._filters == other._filters, path

        whole.visititems(compare)


def same_attributes(one: h5py.Group | h5py.Dataset, other: h5py.Group | h5py.Dataset) -> bool:
    """Whether two objects have the same attributes."""
    return set(one.attrs) == set(other.attrs) and all(
        np.array_equal(one.attrs[name], other.attrs[name]) for name in one.attrs
    )


def flip_a_bit(path: Path, key: str, row: int) -> None:
    """Damage the stored bytes of the chunk that holds a row."""
    with h5py.File(path) as file:
        dataset = file[key]
        assert isinstance(dataset, h5py.Dataset)
        found = dataset.id.get_chunk_info_by_coord((row, *(0,) * (dataset.ndim - 1)))
    with path.open("r+b") as stored:
        stored.seek(found.byte_offset + found.size // 2)
        byte = stored.read(1)[0]
        stored.seek(-1, 1)
        stored.write(bytes([byte ^ 0xFF]))


@pytest.mark.parametrize(("key", "stream"), [("path/depth", "depth"), ("path/imu/angular_velocity", "imu")])
def test_damage_survives(key: str, stream: str, copy: Path, tmp_path: Path) -> None:
    """A chunk that cannot be decoded cannot in the piece either, also where the piece begins within it."""
    flip_a_bit(copy, key, 25)
    kept, _ = cut(copy, tmp_path / "piece.h5")
    results = check_file(
        tmp_path / "piece.h5", CheckOptions(select=("integrity.readable",), evidence=None)
    ).record.results
    assert [finding.where.stream for result in results for finding in result.findings] == [stream]
    assert (kept["imu"].start == 0) == (stream == "imu")


def set_fill(file: h5py.File) -> None:
    """Replace a stream of frames by one that was hardly written."""
    shape = file["path/depth"].shape
    del file["path/depth"]
    file.create_dataset("path/depth", shape, np.float32, chunks=(1, *shape[1:]))[0] = 1.0


def shorten_map(file: h5py.File) -> None:
    """Cut the last entry off an index map."""
    entries = file["metadata/rgb_to_event"][:-1]
    del file["metadata/rgb_to_event"]
    file["metadata/rgb_to_event"] = entries


def link_away(file: h5py.File) -> None:
    """Let a stream lead out of the file."""
    del file["path/imu"]
    file["path/imu"] = h5py.ExternalLink("other.h5", "/path/imu")


LAYOUTS: dict[str, Callable[[h5py.File], None]] = {
    "chunks never written": set_fill,
    "a map cut short": shorten_map,
    "a link that leads out": link_away,
}


@pytest.mark.parametrize("spoil", LAYOUTS.values(), ids=LAYOUTS.keys())
def test_what_is_wrong_with_the_layout_survives(spoil: Callable[[h5py.File], None], copy: Path, tmp_path: Path) -> None:
    """At the end of the file the piece has the problems of the whole."""
    with h5py.File(copy, "r+") as file:
        spoil(file)
    cut(copy, tmp_path / "piece.h5", Piece(700 * MS, 1100 * MS))
    codes = []
    for path in (copy, tmp_path / "piece.h5"):
        results = check_file(path, CheckOptions(select=("integrity.layout",), evidence=None)).record.results
        codes.append([finding.code for result in results for finding in result.findings])
    assert codes[0] == codes[1] != []


def test_what_belongs_to_no_stream(copy: Path, tmp_path: Path) -> None:
    """Small things and links come along, a second name stays one, and what is large is left out and named."""
    with h5py.File(copy, "r+") as file:
        file["notes/small"] = np.arange(10)
        file["notes/large"] = np.zeros(100_000)
        file["notes/soft"] = h5py.SoftLink("/path/imu/ts")
        file["notes/hard"] = file["path/imu"]
        file["notes/loop"] = file["notes"]
        file["notes/type"] = np.dtype([("a", "<i4"), ("b", "<f8")])
        file["notes/texts"] = ["one", "of any length"]
        file["notes/scalar"] = 3.5
        file["notes/nothing"] = h5py.Empty("f8")
    kept, left_out = cut(copy, tmp_path / "piece.h5")
    assert left_out == ("/notes/large",)
    with h5py.File(tmp_path / "piece.h5") as piece:
        assert values(piece, "notes/small").tolist() == list(range(10))
        assert len(values(piece, "notes/soft")) == kept["imu"].stop - kept["imu"].start
        assert piece["notes/hard"] == piece["path/imu"]
        assert piece["notes/loop"] == piece["notes"]
        assert piece["notes/type"].dtype.names == ("a", "b")
        assert values(piece, "notes/texts").tolist() == [b"one", b"of any length"]
        assert piece["notes/scalar"][()] == 3.5
        assert piece["notes/nothing"].shape is None


@pytest.mark.parametrize("path", ["path/imu/ts", "path/imu", "metadata/pose", "metadata/depth_range"])
def test_what_does_not_open_is_left_out(path: str, copy: Path, tmp_path: Path) -> None:
    """An object whose header is damaged is left out and named, and everything else is there."""
    with h5py.File(copy) as file:
        header = file.id.links.get_info(path.encode()).u
    with copy.open("r+b") as stored:
        stored.seek(header)
        stored.write(b"\xff" * 4)
    _, left_out = cut(copy, tmp_path / "piece.h5")
    assert left_out == (f"/{path}",)
    with h5py.File(tmp_path / "piece.h5") as piece:
        assert path not in piece
        assert len(values(piece, "path/rgb"))


def test_another_dialect_stays_itself(tmp_path: Path) -> None:
    """A file of other names is cut where its dialect says, columns that share a dataset together."""
    kept, left_out = cut(write_purdue_lab(tmp_path / "lab.h5"), tmp_path / "piece.h5", Piece(10 * MS, 35 * MS))
    assert left_out == ()
    with h5py.File(tmp_path / "piece.h5") as piece:
        assert values(piece, "path/events").tolist() == [[3, 4, 30_000.0, 1]]
        assert values(piece, "path/imgts").tolist() == [20_000.5]
        assert values(piece, "path/a").shape == (4, 3)
    assert kept["events"] == CutRows(2, 3, 3)


def test_the_source_is_not_touched(copy: Path, tmp_path: Path) -> None:
    """Not a byte of the file is changed."""
    before = copy.read_bytes()
    cut(copy, tmp_path / "piece.h5")
    assert copy.read_bytes() == before


@st.composite
def cuts(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, CutRows, CutRows]:
    """Stamps of events and frames, both in order, and rows of each to keep."""
    events = np.sort(np.array(draw(st.lists(st.integers(0, 50), max_size=30)), dtype=np.int64))
    frames = np.sort(np.array(draw(st.lists(st.integers(0, 50), min_size=1, max_size=10)), dtype=np.int64))

    def rows(count: int) -> CutRows:
        start = draw(st.integers(0, count))
        return CutRows(start, draw(st.integers(start, count)), count)

    return events, frames, rows(len(frames)), rows(len(events))


Cut = tuple[np.ndarray, np.ndarray, CutRows, CutRows]


DEFINITIONS: dict[str, Callable[[np.ndarray, int], int]] = {
    "": lambda events, frame: int(np.sum(events < frame)),
    "event_not_before": lambda events, frame: int(np.sum(events < frame)) if np.any(events >= frame) else 0,
    "event_before": lambda events, frame: int(np.sum(events < frame)) - 1,
    "event_after": lambda events, frame: int(np.sum(events <= frame)),
}


@pytest.mark.parametrize("definition", DEFINITIONS)
@given(cut=cuts(), off=st.integers(-3, 3))
def test_what_an_entry_is_off_by_stays(definition: str, cut: Cut, off: int) -> None:
    """By the definition of the map, counted in the piece, entries are right but for what they were off by."""
    events, frames, kept_frames, kept_events = cut
    piece = events[kept_events.start : kept_events.stop]
    left, right = np.searchsorted(events, frames, "left"), np.searchsorted(events, frames, "right")
    correct = np.array([DEFINITIONS[definition](events, frame) for frame in frames])
    index_map = IndexMap(left + off, left, right, correct if definition else None)
    rows = frames[kept_frames.start : kept_frames.stop]
    defined = [DEFINITIONS[definition](piece, frame) for frame in rows]
    assert list(entries_kept(index_map, kept_frames, kept_events, definition) - off) == defined


@given(cuts().filter(lambda cut: cut[3].stop > cut[3].start))
def test_the_nearest_of_the_events_that_are_kept(cut: Cut) -> None:
    """An entry of a map to the nearest event names one of the piece than which none is nearer."""
    events, frames, kept_frames, kept_events = cut
    left, right = np.searchsorted(events, frames, "left"), np.searchsorted(events, frames, "right")
    index_map = IndexMap(left, left, right, np.abs(events - frames[:, np.newaxis]).argmin(axis=1))
    entries = entries_kept(index_map, kept_frames, kept_events, "nearest_event")
    piece = events[kept_events.start : kept_events.stop]
    for frame, entry in zip(frames[kept_frames.start : kept_frames.stop], entries, strict=True):
        assert abs(piece[entry] - frame) == np.abs(piece - frame).min()
