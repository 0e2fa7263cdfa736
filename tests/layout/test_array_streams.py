"""A dialect reads streams of many arrays of NumPy, and names what its paths do not match."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.folder import OpenFolder, match_folder
from fedora_qa.layout.resolve import Layout, resolve
from fedora_qa.sequence.sequence import open_sequence

EVENTS: dict[str, np.ndarray] = {
    "x": np.arange(60, dtype=np.uint16) % 10,
    "y": np.arange(60, dtype=np.uint16) % 8,
    "t": np.arange(60) * 1000,
    "p": (np.arange(60) % 2).astype(np.uint8),
}
DEPTHS = np.arange(7 * 80, dtype=np.float32).reshape(7, 8, 10) + 1


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Events in an NPZ a frame, or in an NPY of four columns a frame, and depth in an NPZ with a member a frame."""
    folder = tmp_path / "flight"
    (folder / "events").mkdir(parents=True)
    (folder / "tables").mkdir()
    # No event in the third frame.
    bounds = [0, 11, 30, 30, 60]
    for number in range(4):
        frame = slice(bounds[number], bounds[number + 1])
        parts: dict[str, Any] = {name: values[frame] for name, values in EVENTS.items()}
        np.savez(folder / f"events/{number}_events.npz", **parts)
        table = np.column_stack([EVENTS[name][frame] for name in "txyp"])
        np.save(folder / f"tables/{number}.npy", table)
    depths: dict[str, Any] = {f"depth_{n}": depth for n, depth in enumerate(DEPTHS)}
    np.savez(folder / "depth.npz", **depths)
    (folder / "times.txt").write_text("".join(f"{n * 10_000}\n" for n in range(7)))
    return folder


def dialect_of(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "mine.toml"
    head = 'name = "mine"\n[files]\nevents = "events/*_events.npz"\ntables = "tables/*.npy"\n'
    path.write_text("\n".join([f'{head}depth = "depth.npz"\ntimes = "times.txt"\n[datasets]', *lines]), "utf-8")
    return path


MEMBERS = tuple(f'"path/events/{name}" = {{ file = "events", path = "{name}" }}' for name in "xytp")
COLUMNS = tuple(f'"path/events/{name}" = {{ file = "tables", columns = [{n}] }}' for n, name in enumerate("txyp"))
DEPTH = '"path/depth" = { file = "depth", path = "depth_*", value_unit = "mm" }'
DEPTH_TS = '"path/depth_ts" = { file = "times" }'


def layout_of(folder: Path, dialect: Path) -> Layout:
    with closing(OpenFolder(match_folder(folder, load_dialect(dialect)))) as opened:
        return resolve(opened)


@pytest.mark.parametrize("lines", [MEMBERS, COLUMNS])
def test_events_of_a_file_a_frame(lines: tuple[str, ...], folder: Path, tmp_path: Path) -> None:
    """Events of all frames follow on each other."""
    with open_sequence(folder, load_dialect(dialect_of(tmp_path, *lines))) as sequence:
        assert sequence.layout.streams == {"events"}
        for name in "xyp":
            np.testing.assert_array_equal(sequence.rows(f"path/events/{name}", 0, 60), EVENTS[name])
        np.testing.assert_array_equal(sequence.rows("path/events/t", 5, 40), EVENTS["t"][5:40] * 1000)


def test_depth_of_a_member_a_frame(folder: Path, tmp_path: Path) -> None:
    """The members of an NPZ that fit a pattern are rows."""
    with open_sequence(folder, load_dialect(dialect_of(tmp_path, DEPTH, DEPTH_TS))) as sequence:
        assert sequence.layout.streams == {"depth"}
        assert not sequence.layout.problems
        np.testing.assert_array_equal(sequence.rows("path/depth", 0, 7), DEPTHS)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            (DEPTH.replace("depth_*", "range_*"), DEPTH_TS),
            "Expected range_* in depth.npz beside times.txt, got nothing",
        ),
        ((DEPTH,), "Expected a place for path/depth_ts beside path/depth in the dialect mine, got none"),
        ((DEPTH.replace("depth_*", "d"), DEPTH_TS), "Expected d in depth.npz beside times.txt, got nothing there"),
        (
            tuple(line.replace('path = "', 'path = "no_') for line in MEMBERS),
            "Expected no_x in events/*_events.npz in the folder, where the dialect mine has events, got nothing there",
        ),
        (
            (*MEMBERS, DEPTH, DEPTH_TS, '"metadata/depth_to_event" = { file = "depth", path = "map" }'),
            "Expected map in depth.npz",
        ),
    ],
)
def test_a_path_that_matches_nothing_is_a_problem(
    lines: tuple[str, ...], message: str, folder: Path, tmp_path: Path
) -> None:
    """Nothing that a dialect of the user names is dropped without a word."""
    problems = [problem.message for problem in layout_of(folder, dialect_of(tmp_path, *lines)).problems]
    assert any(each.startswith(message) for each in problems), problems
