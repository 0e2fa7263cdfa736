"""A file behind a URL reads like the file itself, and never more of it than is asked for by whole blocks."""

import faulthandler
import gc
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.errors import MisuseError, StorageError
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.storage import server as storage_server
from fedora_qa.storage.place import RemoteFile, place_of
from fedora_qa.storage.remote_bytes import RemoteBytes
from tests.support.identical import identical
from tests.support.servers import FileServer, serving


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a failed request again at once, and keep less than the whole small file."""
    monkeypatch.setattr(storage_server, "_WAITS_S", (0.0, 0.0))
    monkeypatch.setattr("fedora_qa.sequence.sequence.BLOCK_BYTES", 512)
    monkeypatch.setattr("fedora_qa.storage.remote_bytes._BLOCKS", 1)


def remote(server: FileServer, name: str = "seq.h5") -> RemoteFile:
    place = place_of(server.url(name))
    assert isinstance(place, RemoteFile)
    return place


@settings(max_examples=15, deadline=None)
@given(reads=st.lists(st.tuples(st.integers(0, 70_000), st.integers(0, 9_000)), min_size=1, max_size=12))
def test_it_reads_as_the_file_does(reads: list[tuple[int, int]], tmp_path_factory: pytest.TempPathFactory) -> None:
    """Any reads, short and long, in any order and beyond the end, give the bytes of the file."""
    folder = tmp_path_factory.mktemp("bytes")
    content = bytes(i * i % 251 for i in range(65_000))
    (folder / "any.bin").write_bytes(content)
    with serving(folder) as server:
        file = RemoteBytes(remote(server, "any.bin"), block_bytes=1000)
        for start, length in reads:
            file.seek(start)
            assert file.read(length) == content[start : start + length]
        file.close()


def test_what_was_read_is_not_asked_for_again(server: FileServer) -> None:
    """Short reads of one block make one request; what the file counts is what the server sent."""
    file = RemoteBytes(remote(server), block_bytes=4096)
    for start in (0, 100, 4000):
        file.seek(start)
        file.read(64)
    assert file.traffic.transferred_bytes == server.sent_bytes == 4096
    assert file.traffic.requests == server.requests == 2
    file.close()


def test_a_sequence_is_the_same_from_afar(server: FileServer, folder: Path) -> None:
    """Layout, declarations and rows are those of the file."""
    with open_sequence(folder / "seq.h5") as here, open_sequence(remote(server)) as there:
        for name in ("layout", "declared", "origin_ns"):
            assert identical(getattr(there, name), getattr(here, name))
        assert identical(there.rows("path/rgb", 1, 3), here.rows("path/rgb", 1, 3))


def test_a_failure_that_passes_costs_nothing(server: FileServer) -> None:
    """A server that is busy for a moment is asked again."""
    file = RemoteBytes(remote(server), block_bytes=512)
    server.failures += [503, 500]
    assert len(file.read(8) or b"") == 8
    file.close()


def change(server: FileServer) -> None:
    (server.folder / "seq.h5").write_bytes((server.folder / "seq.h5").read_bytes() + b"\0")


MISBEHAVIOUR: dict[str, tuple[Callable[[FileServer], Any], str]] = {
    "broken": (lambda server: server.failures.extend([500] * 3), "the answer 500"),
    "forbidden": (lambda server: server.failures.append(403), r"a refusal \(403\)"),
    "changed": (change, "a change; check it again"),
    "gone": (lambda server: (server.folder / "seq.h5").unlink(), "a path that does not exist"),
}


@pytest.mark.parametrize(("misbehave", "told"), MISBEHAVIOUR.values(), ids=MISBEHAVIOUR)
def test_a_server_that_fails_says_nothing_of_the_file(
    misbehave: Callable[[FileServer], Any], told: str, server: FileServer
) -> None:
    """What goes wrong while rows are read is never told as rows that cannot be decoded, and is final."""
    with open_sequence(remote(server)) as sequence:
        misbehave(server)
        for _ in range(2):
            with pytest.raises(StorageError, match=told):
                sequence.rows("path/rgb", 0, 6)


def test_a_change_without_conditions(server: FileServer) -> None:
    """A server that ignores ``If-Match`` is asked for the version at the end."""
    server.conditions = False
    with open_sequence(remote(server)) as sequence:
        sequence.require_unchanged()
        change(server)
        with pytest.raises(StorageError, match="got a change"):
            sequence.require_unchanged()


def test_without_ranges(server: FileServer) -> None:
    """A server that sends only whole files is refused, before it has sent many."""
    server.ranges = False
    with pytest.raises(StorageError, match="range requests"):
        open_sequence(remote(server))
    assert server.sent_bytes < 3 * (server.folder / "seq.h5").stat().st_size


READS_AND_ENDS = """
import sys
from fedora_qa.errors import StorageError
from fedora_qa.sequence import sequence
from fedora_qa.storage.place import place_of
sequence.BLOCK_BYTES = 512
try:
    sequence.open_sequence(place_of(sys.argv[1]))
except StorageError as error:
    print(error)
"""


def test_a_process_ends_after_a_failure(server: FileServer) -> None:
    """What failed is no longer held when the interpreter ends: else HDF5 would free it too late, and crash."""
    server.ranges = False
    command = [sys.executable, "-c", READS_AND_ENDS, server.url("seq.h5")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "range requests" in done.stdout


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("http://127.0.0.1:9/seq.h5", r"a connection to the server, got none \(Connection refused\)"),
        ("https://user:hidden@127.0.0.1:9/seq.h5?X-Amz-Signature=hidden", "Connection refused"),
        ("http://nowhere.invalid/seq.h5", "a connection to the server"),
    ],
)
def test_nobody_there(address: str, told: str) -> None:
    """Without a server: one sentence, without the secrets of the URL."""
    with pytest.raises(StorageError, match=told) as failed:
        open_sequence(place_of(address))
    assert "hidden" not in str(failed.value)
    assert failed.value.__suppress_context__


def test_a_certificate_that_nobody_signed(folder: Path, tmp_path: Path) -> None:
    """A server that cannot prove who it is, is not read from."""
    with (
        serving(folder, certificate=tmp_path / "own.pem") as server,
        pytest.raises(StorageError, match="whose certificate can be verified, got self-signed certificate"),
    ):
        open_sequence(remote(server))


def test_a_server_that_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server that takes the request and never answers is given up, and not called empty."""
    monkeypatch.setattr(storage_server, "_SILENCE_S", 0.2)
    told = pytest.raises(StorageError, match="an answer of the server, got none in time")
    with socket.create_server(("127.0.0.1", 0)) as silent, told:
        open_sequence(place_of(f"http://127.0.0.1:{silent.getsockname()[1]}/seq.h5"))


def test_without_the_extra(server: FileServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is missing is named with the command that installs it."""
    monkeypatch.setitem(__import__("sys").modules, "aiohttp", None)
    with pytest.raises(MisuseError, match=r"pip install 'fedora-qa\[remote\]'"):
        open_sequence(remote(server))


class Knot:
    """Something that refers to itself, which only the garbage collector frees."""

    def __init__(self, held: Any) -> None:
        self.held = held
        self.itself = self


def test_garbage_is_not_collected_while_h5py_waits(server: FileServer, eager_collection: None) -> None:
    """With the collector always busy and HDF5 objects in knots, reading comes to its end: else it would hang."""
    with open_sequence(remote(server)) as sequence:
        for _ in range(10):
            file = h5py.File(server.folder / "seq.h5")
            Knot([file, *(file[name] for name in file)])
            sequence.rows("path/rgb", 0, 6)


@pytest.fixture
def eager_collection() -> Iterator[None]:
    """Collect garbage after every few objects; a run that hangs all the same is ended with what it waits for."""
    before = gc.get_threshold()
    gc.set_threshold(20)
    faulthandler.dump_traceback_later(60, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()
    gc.set_threshold(*before)
