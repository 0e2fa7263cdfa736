"""A file is written entirely or not at all."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fedora_qa.record.atomic import replacing, write_text


def test_text_takes_the_place_of_the_old(tmp_path: Path) -> None:
    """The new content is there, and nothing else lies beside it."""
    target = tmp_path / "out.md"
    target.write_text("old")
    write_text(target, "new ±")
    assert target.read_text(encoding="utf-8") == "new ±"
    assert list(tmp_path.iterdir()) == [target]


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    """When writing fails half way, the old file stays and no temporary file remains."""
    target = tmp_path / "out.md"
    target.write_text("old")

    def write_half() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_half()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_the_file_is_as_public_as_its_folder_allows(tmp_path: Path) -> None:
    """Permissions are those of a file made by ``open``."""
    write_text(tmp_path / "one", "")
    (tmp_path / "other").write_text("")
    assert (tmp_path / "one").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    """The file to which it leads is replaced."""
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "out.md", tmp_path / "link.md"
    target.write_text("old")
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_pipe_stays_a_pipe_and_receives_what_is_written(tmp_path: Path) -> None:
    """As any device does: nothing takes its place."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool:
        received = pool.submit(pipe.read_text)
        write_text(pipe, "new")
        assert received.result(timeout=10) == "new"
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]
