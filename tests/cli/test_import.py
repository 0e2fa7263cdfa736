"""``fedora-qa import`` from end to end: what it writes and prints, what it refuses, and that nothing is left behind."""

from pathlib import Path

import h5py
import pytest

from tests.cli.conftest import Command
from tests.support.bags import Bag
from tests.support.prophesee import random_events, write_dat, write_evt3


def names(folder: Path) -> list[str]:
    """What lies in a folder, hidden files too."""
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return write_evt3(tmp_path / "flight.raw", random_events(20_000, 4))


def test_what_is_written_can_be_checked(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """Events alone cannot be checked against another stream; all that can be said of them is."""
    before = source.read_bytes()
    out = tmp_path / "flight.h5"
    done = fedora_qa("import", source, "-o", out)
    assert done.code == 0, done.err
    assert "is written from Prophesee EVT3" in done.out
    assert source.read_bytes() == before
    assert names(tmp_path) == ["flight.h5", "flight.raw"]
    checked = fedora_qa("check", "--verbose", out)
    assert checked.code == 3
    assert "no stream could be checked against another" in checked.out
    assert "Findings" not in checked.out
    for name in ("integrity.layout", "metadata.complete", "clocks.order", "event_stream.bounds"):
        line = next(line for line in checked.out.splitlines() if line.strip().startswith(name))
        assert "passed" in line


def test_a_fault_of_the_recording_is_found(fedora_qa: Command, tmp_path: Path) -> None:
    """Events beside the sensor are brought in as they are, and ``check`` finds them."""
    events = [*random_events(20_000, 5), (700, 1, 3_000_000, 1)]
    out = tmp_path / "out.h5"
    assert fedora_qa("import", write_evt3(tmp_path / "a.raw", events), "-o", out).code == 0
    checked = fedora_qa("check", "--verbose", out)
    assert checked.code == 1
    assert "event_stream.bounds" in checked.out


def test_outputs_are_protected(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """An output that exists, that is the source under any name, or that has no folder, is refused before any work."""
    before = source.read_bytes()
    existing, link, hard = tmp_path / "old.h5", tmp_path / "link.h5", tmp_path / "hard.h5"
    existing.write_text("mine")
    link.symlink_to(source)
    hard.hardlink_to(source)
    for output in (existing, source, link, hard, tmp_path, tmp_path / "none" / "out.h5"):
        done = fedora_qa("import", source, "-o", output)
        assert done.code == 2, output
        assert done.err.startswith("fedora-qa: Expected ")
    for output in (source, link, hard):
        assert fedora_qa("import", source, "-o", output, "--force").code == 2
    assert source.read_bytes() == before
    assert existing.read_text() == "mine"
    assert fedora_qa("import", source, "-o", existing, "--force").code == 0
    assert h5py.is_hdf5(existing)


NOT_RECORDINGS = {
    "a ZIP archive": b"PK\x03\x04" + bytes(100),
    "an HDF5 file": b"\x89HDF\r\n\x1a\n" + bytes(100),
    "an empty file": b"",
    "a text file": b"hello, world",
    "something else": b'{"hello": "world"}',
}


@pytest.mark.parametrize("what", NOT_RECORDINGS)
def test_what_is_no_recording(what: str, fedora_qa: Command, tmp_path: Path) -> None:
    """The sentence says what it is instead."""
    (tmp_path / "a.raw").write_bytes(NOT_RECORDINGS[what])
    done = fedora_qa("import", tmp_path / "a.raw", "-o", tmp_path / "out.h5")
    assert done.code == 2
    assert f"got {what}" in done.err
    assert names(tmp_path) == ["a.raw"]


def test_nothing_is_left_of_an_error(fedora_qa: Command, tmp_path: Path) -> None:
    """An error after a million events leaves the folder as it was."""
    events = [(k % 640, k % 480, k, 1) for k in range(300_000)]
    source = write_dat(tmp_path / "a.dat", [*events, (1, 2, 3, 1)])
    done = fedora_qa("import", source, "-o", tmp_path / "out.h5")
    assert done.code == 2
    assert done.err == (
        "fedora-qa: Expected events timestamps that do not decrease, got 3 us after 299999 us at row 300000; record "
        "again, or write them as they are with --allow-backwards and let check report them\n"
    )
    assert names(tmp_path) == ["a.dat"]
    assert fedora_qa("import", source, "-o", tmp_path / "out.h5", "--allow-backwards").code == 0
    assert fedora_qa("check", tmp_path / "out.h5").code == 1


@pytest.mark.parametrize("resolution", ["640", "0x0", "axb", "99999x9"])
def test_resolutions(resolution: str, fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """Two positive numbers."""
    done = fedora_qa("import", source, "-o", tmp_path / "out.h5", "--resolution", resolution)
    assert done.code == 2
    assert "--resolution WxH" in done.err


def test_a_bag_can_be_checked(fedora_qa: Command, tmp_path: Path) -> None:
    """Clocks of a bag are checked against each other; the map of topics is read, and never written over."""
    bag = Bag("mcap")
    bag.add_events(random_events(5_000, 8))
    for k in range(400):
        bag.add_imu(5_000 * k, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81), topic="/imu/other")
    source = bag.write(tmp_path)
    topics = tmp_path / "topics.toml"
    topics.write_text('[topics]\nevents = "/dvs/events"\nimu = "/imu/other"\n')
    assert fedora_qa("import", source, "-o", topics, "--topics", topics, "--force").code == 2
    assert fedora_qa("import", source, "-o", source / "out.h5", "--topics", topics).code == 2
    done = fedora_qa("import", source, "-o", tmp_path / "out.h5", "--topics", topics, "--kind", "recorded")
    assert done.code == 0, done.err
    assert "is written from ROS 2 bag; rows: events 4" in done.out
    checked = fedora_qa("check", "--verbose", tmp_path / "out.h5")
    # Neither noise nor thresholds are declared, and no stream measures what another does.
    assert checked.code == 3, checked.out
    for name in ("clocks.unit", "clocks.rate", "clocks.gaps", "event_stream.bounds"):
        line = next(line for line in checked.out.splitlines() if line.strip().startswith(name))
        assert "passed" in line
