"""A folder is listed, identified and recognised as changed by all of its files."""

import hashlib
import os
from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.storage import digest, folder
from fedora_qa.storage.digest import file_digest, whole_digest
from fedora_qa.storage.folder import list_files, local_version


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    root = tmp_path / "sequence"
    (root / "images").mkdir(parents=True)
    (root / "images/0.png").write_bytes(b"image")
    (root / "b.h5").write_bytes(b"events")
    (root / ".cache").mkdir()
    (root / ".cache/x").write_bytes(b"hidden")
    (tmp_path / "secret.txt").write_bytes(b"secret")
    return root


def test_only_files_of_the_folder_are_listed(sequence: Path) -> None:
    """Hidden files, pipes, links out of the folder, to folders, to nowhere are left out; a link within it counts."""
    (sequence / "out.txt").symlink_to(sequence.parent / "secret.txt")
    (sequence / "up").symlink_to(sequence.parent)
    (sequence / "round").symlink_to(sequence)
    (sequence / "in.h5").symlink_to(sequence / "b.h5")
    (sequence / "itself.h5").symlink_to(sequence / "itself.h5")
    (sequence / "broken.h5").symlink_to(sequence / "missing.h5")
    os.mkfifo(sequence / "pipe.txt")
    assert [file.name for file in list_files(sequence)] == ["b.h5", "images/0.png", "in.h5"]


def test_depth_and_number_are_bounded(sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of folders without end is not followed; too many files are one sentence."""
    deep = sequence.joinpath(*"d" * (folder.DEEPEST + 1))
    deep.mkdir(parents=True)
    (deep / "x.txt").touch()
    assert [file.name for file in list_files(sequence)] == ["b.h5", "images/0.png"]
    monkeypatch.setattr(folder, "MOST_FILES", 1)
    with pytest.raises(MisuseError, match="Expected 1 files at most"):
        list_files(sequence)
    with pytest.raises(MisuseError, match="No such file"):
        list_files(sequence / "missing")


def test_digest_is_that_of_a_list_of_sums(sequence: Path) -> None:
    """``sha256sum b.h5 images/0.png | sha256sum``, whatever the digest of each file is made of."""
    lines = [
        f"{hashlib.sha256(content).hexdigest()}  {name}\n"
        for name, content in (("b.h5", b"events"), ("images/0.png", b"image"))
    ]
    expected = hashlib.sha256("".join(lines).encode()).hexdigest()
    read = file_digest(sequence)
    assert (read.sha256, read.kind, read.version.size) == (expected, "full", 11)
    assert whole_digest(sequence) == expected


def test_a_large_folder_gets_a_partial_digest(sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small files count whole, a large one by pieces: every small change shows, and so does another size."""
    monkeypatch.setattr(digest, "_WHOLE_UP_TO_BYTES", 10)
    monkeypatch.setattr(digest, "_FOLDER_PIECE_BYTES", 16)
    large = sequence / "large.h5"
    large.write_bytes(bytes(100_000))
    first = file_digest(sequence)
    assert first.kind == "partial"
    assert whole_digest(sequence) != first.sha256
    (sequence / "images/0.png").write_bytes(b"imagf")
    second = file_digest(sequence)
    large.write_bytes(bytes(100_001))
    assert len({first.sha256, second.sha256, file_digest(sequence).sha256}) == 3


def test_every_change_is_another_version(sequence: Path) -> None:
    """Size, time, name and number of files."""
    versions = [local_version(sequence)]
    os.utime(sequence / "b.h5", ns=(1, 1))
    versions.append(local_version(sequence))
    (sequence / "images/1.png").touch()
    versions.append(local_version(sequence))
    (sequence / "images/1.png").rename(sequence / "images/2.png")
    versions.append(local_version(sequence))
    assert len(set(versions)) == 4
    assert versions[0].size == 11
