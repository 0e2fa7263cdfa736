"""Columns of numbers in text."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.sources import text
from fedora_qa.sources.source import SourceError
from fedora_qa.sources.text import number_table


def write(folder: Path, content: str | bytes) -> Path:
    path = folder / "times.txt"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    ("content", "rows"),
    [
        ("1\n2\n3\n", [[1], [2], [3]]),
        ("# from, to\n1, 2\n3, 4\n", [[1, 2], [3, 4]]),
        ("from,to\n1,2\n", [[1, 2]]),
        ("1;2\r\n3;4\r\n\r\n", [[1, 2], [3, 4]]),
        ("\ufefft x\n1 0.5\n", [[1.0, 0.5]]),
        ("1 2 # remark\n", [[1, 2]]),
        ("nan 1\n", [[float("nan"), 1.0]]),
        ("time file\n1 a.png\n2 b.png\n", [[1, 0], [2, 0]]),
    ],
)
def test_forms(content: str, rows: list[list[float]], tmp_path: Path) -> None:
    """Heads, remarks, commas, semicolons and blank lines are as people write them."""
    table = number_table(write(tmp_path, content))
    np.testing.assert_array_equal(table.rows(0, len(rows)), rows)


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=20))
def test_whole_numbers_stay_exact(tmp_path_factory: pytest.TempPathFactory, values: list[int]) -> None:
    """Nanoseconds since 1970 do not pass through floats."""
    path = write(tmp_path_factory.mktemp("text"), "".join(f"{value}\n" for value in values))
    table = number_table(path)
    assert table.dtype == np.int64
    assert table.rows(0, len(values))[:, 0].tolist() == values


@given(st.lists(st.tuples(*[st.floats(allow_nan=False, width=64)] * 8), min_size=1, max_size=9))
def test_trajectories_of_tum(tmp_path_factory: pytest.TempPathFactory, poses: list[tuple[float, ...]]) -> None:
    """Eight columns of numbers come back as they were written."""
    lines = [" ".join(map(repr, pose)) for pose in poses]
    table = number_table(
        write(tmp_path_factory.mktemp("text"), "# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines))
    )
    np.testing.assert_array_equal(table.rows(0, len(poses)), poses)


def test_empty(tmp_path: Path) -> None:
    """A file without rows is a table without rows."""
    assert number_table(write(tmp_path, "# nothing\n")).shape == (0, 1)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("1 2\n3\n", "2 numbers in row 1 of times.txt, got 1"),
        ("1\nx\n", "numbers in every row"),
        (b"\xff\xfe\x00", "numbers as text"),
        (" ".join("1" * 65), "64 columns at most"),
        ("".join(f"{i}.png {i}\n" for i in range(9)), "begin with a number in times.txt, got '8.png'; put columns"),
        ("".join(f"{i}.png\n" for i in range(9)), "begin with a number"),
    ],
)
def test_refusals(content: str | bytes, words: str, tmp_path: Path) -> None:
    """One sentence names the file and the row."""
    with pytest.raises(SourceError, match=words):
        number_table(write(tmp_path, content))


def test_other_content_is_parsed_anew_and_size_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cache is one of content; text larger than the limit is not read."""
    path = write(tmp_path, "1\n")
    assert number_table(path).shape == (1, 1)
    write(tmp_path, "1\n2\n")
    os.utime(path, ns=(5, 5))
    assert number_table(path).shape == (2, 1)
    monkeypatch.setattr(text, "LARGEST_BYTES", 1)
    os.utime(path, ns=(6, 6))
    with pytest.raises(SourceError, match="in 1 bytes at most"):
        number_table(path)
