"""Arrays of NumPy."""

import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fedora_qa.sources import arrays
from fedora_qa.sources.arrays import arrays_of, npy_array, npz_array
from fedora_qa.sources.source import SourceError

VALUES = np.arange(24, dtype=np.float32).reshape(4, 3, 2)


@pytest.mark.parametrize("order", ["C", "F"])
def test_rows_of_npy_and_npz(order: str, tmp_path: Path) -> None:
    """Rows come back, whatever the order of storage and whether it is deflated."""
    stored = np.asarray(VALUES, order=order)  # type: ignore[call-overload]
    np.save(tmp_path / "a.npy", stored)
    np.savez(tmp_path / "a.npz", depth=stored)
    np.savez_compressed(tmp_path / "b.npz", depth=stored)
    for source in (
        npy_array(tmp_path / "a.npy"), npz_array(tmp_path / "a.npz", "depth"), npz_array(tmp_path / "b.npz", "depth"),
    ):  # fmt: skip
        assert source is not None
        assert (source.shape, source.dtype) == (VALUES.shape, VALUES.dtype)
        np.testing.assert_array_equal(source.rows(1, 3), VALUES[1:3])
    assert npz_array(tmp_path / "a.npz", "flow") is None


def test_frames(tmp_path: Path) -> None:
    """A file a row; one of another type fails alone."""
    for number in range(3):
        np.save(tmp_path / f"{number}.npy", VALUES[number])
    frames = arrays_of(tmp_path, [path.name for path in tmp_path.iterdir()], "", is_joined=False)
    assert frames is not None
    np.testing.assert_array_equal(frames.rows(0, 3), VALUES[:3])
    np.save(tmp_path / "1.npy", VALUES[1].astype(np.float64))
    with pytest.raises(SourceError, match=r"Expected 1.npy as <f4"):
        frames.rows(0, 3)
    np.testing.assert_array_equal(frames.rows(2, 3), VALUES[2:3])


def test_members_of_npz_as_frames(tmp_path: Path) -> None:
    """The arrays of NPZ that fit a pattern are rows, in the order of their numbers."""
    depths: dict[str, Any] = {f"depth_{n}": VALUES[n % 4] + n for n in range(11)}
    np.savez(tmp_path / "a.npz", other=np.zeros(3), **depths)
    frames = arrays_of(tmp_path, ["a.npz"], "depth_*", is_joined=False)
    assert frames is not None
    assert frames.shape == (11, 3, 2)
    np.testing.assert_array_equal(frames.rows(9, 11), [VALUES[1] + 9, VALUES[2] + 10])
    assert arrays_of(tmp_path, ["a.npz"], "flow_*", is_joined=False) is None


@pytest.mark.parametrize("form", ["npy", "npz"])
def test_arrays_end_to_end(form: str, tmp_path: Path) -> None:
    """Rows of several files follow on each other, also over empty ones, which NumPy makes float64."""
    rows = np.arange(40, dtype=np.int16).reshape(20, 2)
    cuts = [0, 3, 3, 10, 20]
    for number, (start, stop) in enumerate(pairwise(cuts)):
        piece = rows[start:stop] if start < stop else np.zeros((0, 2))
        if form == "npy":
            np.save(tmp_path / f"{number}.npy", piece)
        else:
            np.savez_compressed(tmp_path / f"{number}.npz", xy=piece)
    names = [path.name for path in tmp_path.iterdir()]
    member = "xy" if form == "npz" else ""
    joined = arrays_of(tmp_path, names, member, is_joined=True)
    assert joined is not None
    assert (joined.shape, joined.dtype.str) == ((20, 2), "<i2")
    for start in range(20):
        for stop in range(start, 21):
            np.testing.assert_array_equal(joined.rows(start, stop), rows[start:stop])
    np.savez(tmp_path / "9.npz", other=rows)
    if form == "npz":
        with pytest.raises(SourceError, match=r"Expected xy in each of the files, got none in 9.npz"):
            arrays_of(tmp_path, [*names, "9.npz"], member, is_joined=True)


def test_pickles_are_never_read(tmp_path: Path) -> None:
    """Objects run code when they are read."""
    objects = np.array([{"a": 1}], dtype=object)
    np.save(tmp_path / "o.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "o.npz", o=objects)
    with pytest.raises(SourceError, match=r"Expected numbers in o.npy"):
        npy_array(tmp_path / "o.npy")
    with pytest.raises(SourceError, match=r"Expected numbers in o of o.npz"):
        npz_array(tmp_path / "o.npz", "o")


def test_stated_sizes_are_held_against_the_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A header can state any shape."""
    path = tmp_path / "a.npy"
    np.save(path, VALUES)
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    with pytest.raises(SourceError, match=r"Expected 96 bytes of values in a.npy, got 95"):
        npy_array(path)
    path.write_bytes(content.replace(b"(4, 3, 2)", b"(9, 9, 9)"))
    with pytest.raises(SourceError, match="got 96"):
        npy_array(path)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", content[:-4])
    with pytest.raises(SourceError, match="Expected 96 bytes"):
        npz_array(tmp_path / "a.npz", "a")
    for is_joined in (False, True):
        with pytest.raises(SourceError, match="Expected 96 bytes"):
            arrays_of(tmp_path, ["a.npz"], "a*", is_joined=is_joined)
    np.savez(tmp_path / "b.npz", a=VALUES)
    monkeypatch.setattr(arrays, "LARGEST_BYTES", 10)
    with pytest.raises(SourceError, match="in 10 bytes at most"):
        npz_array(tmp_path / "b.npz", "a")


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"\x93NUMPY\x01\x00\x10\x00{'descr': [(((((", b"text"])
def test_what_is_no_array(content: bytes, tmp_path: Path) -> None:
    """One sentence, whatever the bytes."""
    (tmp_path / "a.npy").write_bytes(content)
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(SourceError, match=r"Expected an array of NumPy in a.npy"):
        npy_array(tmp_path / "a.npy")
    with pytest.raises(SourceError, match=r"Expected arrays of NumPy in a.npz"):
        npz_array(tmp_path / "a.npz", "a")
