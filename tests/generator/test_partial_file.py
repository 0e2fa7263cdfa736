"""A file takes its name when it is whole: what is refused, what is left, what a disk without room does."""

import errno
import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.errors import OutputError
from fedora_generator.partial_file import partial_file, require_writable

FULL = Path("/dev/full")


def write(target: Path, content: bytes, *, overwrite: bool = False) -> None:
    with partial_file(target, overwrite=overwrite) as file:
        file.write(content)


def test_the_name_comes_with_the_last_byte(tmp_path: Path) -> None:
    """Before the end of the block there is only a hidden file; afterwards only the target."""
    target = tmp_path / "a.h5"
    with partial_file(target, overwrite=False) as file:
        file.write(b"whole")
        assert [path.name for path in tmp_path.iterdir()] == [".a.h5.partial"]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.h5": b"whole"}


def test_what_a_killed_run_left_is_used_again(tmp_path: Path) -> None:
    """A longer stale file leaves none of its bytes, and is gone."""
    (tmp_path / ".a.h5.partial").write_bytes(b"stale" * 1000)
    write(tmp_path / "a.h5", b"new")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.h5": b"new"}


def test_two_runs_do_not_write_one_target(tmp_path: Path) -> None:
    """The second is refused and takes nothing from the first."""
    target = tmp_path / "a.h5"
    with partial_file(target, overwrite=False) as file:
        file.write(b"first")
        with pytest.raises(OutputError, match=r"the only run that writes .*a\.h5"):
            write(target, b"second")
    assert target.read_bytes() == b"first"


def test_a_link_is_followed(tmp_path: Path) -> None:
    """The file that it leads to is replaced, beside which the partial file lay; the link stays a link."""
    folder = tmp_path / "there"
    folder.mkdir()
    link = tmp_path / "link.h5"
    link.symlink_to(folder / "real.h5")
    write(link, b"new")
    assert (folder / "real.h5").read_bytes() == b"new"
    assert link.is_symlink()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (".", "got the folder"),
        ("pipe", "which is a device or a pipe"),
        ("there", "which exists; choose another name or use --force"),
        ("lost", "Expected an existing folder to write into, got .*nowhere"),
        ("no/a.h5", "Expected an existing folder to write into, got .*no"),
        ("there/a.h5", "Expected an existing folder"),
        ("n" * 250, "File name too long"),
        ("n" * 300, "File name too long"),
        ("/proc/a.h5", "Expected (a folder that can be written, got|to be able to write into) /proc"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_is_refused(tmp_path: Path, name: str, message: str) -> None:
    """In one line, and nothing changes."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "there").write_bytes(b"precious")
    (tmp_path / "lost").symlink_to(tmp_path / "nowhere" / "a.h5")
    before = {path.name for path in tmp_path.iterdir()}
    with pytest.raises(OutputError, match=message) as refused:
        write(tmp_path / name, b"new")
    assert "\n" not in str(refused.value)
    assert {path.name for path in tmp_path.iterdir()} == before
    assert (tmp_path / "there").read_bytes() == b"precious"


def test_a_device_is_never_replaced() -> None:
    """Nor with ``overwrite``."""
    with pytest.raises(OutputError, match="a device"):
        require_writable(FULL, overwrite=True)
    assert FULL.is_char_device()


def test_a_folder_without_rights_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is written; whoever runs the test may have every right, so the answer is given here."""
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    with pytest.raises(OutputError, match="a folder that can be written"):
        require_writable(tmp_path / "a.h5", overwrite=False)


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO])
def test_a_disk_may_refuse_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int) -> None:
    """What the system says when the bytes reach the disk counts; the target stays as it was."""
    target = tmp_path / "a.h5"
    target.write_bytes(b"precious")

    def refuse(_: int) -> None:
        raise OSError(error, os.strerror(error))

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OutputError, match=os.strerror(error)):
        write(target, b"new", overwrite=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.h5": b"precious"}


def write_until_the_disk_is_full(target: Path) -> None:
    """Rows through HDF5, of which half find room."""
    rows = np.random.default_rng(0).integers(0, 256, (64, 1000), dtype=np.uint8)
    with partial_file(target, overwrite=False) as file:
        with h5py.File(file, "w") as sequence:
            dataset = sequence.create_dataset("rows", rows.shape, rows.dtype, chunks=(1, 1000))
            dataset[:32] = rows[:32]
            file.failure, size = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), file.path.stat().st_size
            dataset[32:] = rows[32:]
            sequence.attrs["late"] = "also dropped"
        assert file.path.stat().st_size == size
        file.raise_pending()


def test_hdf5_closes_what_could_not_be_written(tmp_path: Path) -> None:
    """A write that fails stops the run at ``raise_pending``; HDF5, whose later writes are dropped, gets no error."""
    with pytest.raises(OutputError, match="got a full disk"):
        write_until_the_disk_is_full(tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_waits_for_a_safe_moment(tmp_path: Path) -> None:
    """Ctrl-C is answered at ``raise_pending``; nothing is left, and Ctrl-C means afterwards what it meant before."""
    handler, reached = signal.getsignal(signal.SIGINT), []

    def interrupted_run() -> None:
        with partial_file(tmp_path / "a.h5", overwrite=False) as file:
            signal.raise_signal(signal.SIGINT)
            reached.append("writes on")
            file.raise_pending()
            reached.append("never")

    with pytest.raises(KeyboardInterrupt):
        interrupted_run()
    assert reached == ["writes on"]
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_second_interrupt_does_not_wait(tmp_path: Path) -> None:
    """Who presses Ctrl-C twice is heard at once."""
    reached = []

    def interrupted_run() -> None:
        with partial_file(tmp_path / "a.h5", overwrite=False):
            signal.raise_signal(signal.SIGINT)
            reached.append("once")
            signal.raise_signal(signal.SIGINT)
            reached.append("never")

    with pytest.raises(KeyboardInterrupt):
        interrupted_run()
    assert reached == ["once"]
    assert list(tmp_path.iterdir()) == []


def test_a_buffer_of_any_type_is_written_by_its_bytes(tmp_path: Path) -> None:
    """The number that is returned counts bytes, as HDF5 expects."""
    numbers = np.arange(5, dtype=np.int32)
    with partial_file(tmp_path / "a.h5", overwrite=False) as file:
        assert file.write(numbers) == 20
    assert (tmp_path / "a.h5").read_bytes() == numbers.tobytes()
