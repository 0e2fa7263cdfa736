"""Files of other makers are recognised and come out in canonical units."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.layout.binding import canonical_rows, instant_ns, raw_rows
from fedora_qa.layout.dialect import DIALECT_NAMES, load_dialect
from fedora_qa.layout.resolve import Layout, resolve
from fedora_qa.sequence.sequence import open_sequence
from tests.support.foreign import EPOCH_S, write_dsec, write_m3ed, write_mvsec, write_purdue_lab, write_v2e

Writer = Callable[[Path], Path]

FILES = {
    "purdue-lab": (write_purdue_lab, {"rgb", "depth", "events"}),
    "dsec": (write_dsec, {"events"}),
    "mvsec": (write_mvsec, {"rgb", "events", "rgb_to_event"}),
    "m3ed": (write_m3ed, {"rgb", "events", "rgb_to_event"}),
    "v2e": (write_v2e, {"rgb", "events", "rgb_to_event"}),
}


def test_every_dialect_has_a_file() -> None:
    """The canonical one has the files of the generator; the others are folders, and no file by itself tells of them."""
    assert {*FILES, "fedora", "vid2e", "tum-vie", "eds"} == set(DIALECT_NAMES)


def test_columns_that_any_file_may_have_identify_no_dialect(tmp_path: Path) -> None:
    """Events of EDS are named x, y, t and p, of no unit: in its folder they are known, by themselves they are not."""
    with h5py.File(tmp_path / "events.h5", "w") as file:
        for name in "xytp":
            file[name] = np.arange(3)
        assert not resolve(file).is_recognised
        assert resolve(file, load_dialect("eds")).streams == {"events"}


@pytest.mark.parametrize("name", FILES)
def test_dialect_is_recognised(name: str, tmp_path: Path) -> None:
    """The file is read in its own dialect, without problems, and the record says that this was inferred."""
    write, streams = FILES[name]
    with h5py.File(write(tmp_path / "foreign.h5")) as file:
        layout = resolve(file)
    assert layout.dialect_name == name
    assert layout.streams == streams
    assert layout.problems == ()
    assert layout.inferred["layout.dialect"] == name
    assert all(key.startswith("declared.") or key in {"layout.dialect", "kind"} for key in layout.inferred)


@pytest.mark.parametrize("name", FILES)
def test_sequence_opens(name: str, tmp_path: Path) -> None:
    """A sequence of another maker opens, and declares nothing that could be held against it but what is absent."""
    with open_sequence(FILES[name][0](tmp_path / "foreign.h5")) as sequence:
        assert all(not problem.name for problem in sequence.declared.problems)


def read(write: Writer, tmp_path: Path, key: str, origin_ns: int = 0) -> np.ndarray:
    with h5py.File(write(tmp_path / "foreign.h5")) as file:
        binding = resolve(file).bindings[key]
        return canonical_rows(file, binding, 0, binding.rows, origin_ns)


def test_purdue_lab_units(tmp_path: Path) -> None:
    """Metres become millimetres, fractional microseconds survive, events come apart."""
    assert read(write_purdue_lab, tmp_path, "path/depth").max() == 2500.0
    assert read(write_purdue_lab, tmp_path, "path/depth_ts").tolist() == [250, 20_000_500, 40_000_750]
    assert read(write_purdue_lab, tmp_path, "path/events/x").tolist() == [1, 7, 3]
    assert read(write_purdue_lab, tmp_path, "path/events/t").tolist() == [100_500, 200_000, 30_000_000]
    assert read(write_purdue_lab, tmp_path, "path/events/p").tolist() == [1, 0, 1]


def test_dsec_offset(tmp_path: Path) -> None:
    """Stamps are 32-bit microseconds after an offset that 32 bits cannot hold."""
    origin_ns = 49_599_300_523_000
    assert read(write_dsec, tmp_path, "path/events/t", origin_ns).tolist() == [10_000, 20_000]


def test_mvsec_seconds_polarity_and_grey(tmp_path: Path) -> None:
    """Seconds become nanoseconds, -1 becomes 0, grey becomes three equal channels."""
    origin_ns = int(EPOCH_S) * 10**9
    times = read(write_mvsec, tmp_path, "path/events/t", origin_ns)
    np.testing.assert_allclose(times, [0, 1_000_000, 40_000_000], atol=240)
    assert read(write_mvsec, tmp_path, "path/events/p").tolist() == [1, 0, 1]
    assert read(write_mvsec, tmp_path, "path/rgb").shape == (2, 6, 8, 3)


def test_origin_is_on_the_dialects_clock(tmp_path: Path) -> None:
    """The origin of a DSEC file is its first event, offset included."""
    with h5py.File(write_dsec(tmp_path / "dsec.h5")) as file:
        binding = resolve(file).bindings["path/events/t"]
        first = raw_rows(file, binding, 0, 1)[0]
        assert instant_ns(first, binding) == 49_599_300_533_000


def test_nothing_known_is_read_as_canonical(tmp_path: Path) -> None:
    """A file in which no dialect finds anything has every stream absent, and says where each was looked for."""
    with h5py.File(tmp_path / "nothing.h5", "w") as file:
        file["something"] = [1, 2, 3]
        layout: Layout = resolve(file)
    assert layout.dialect_name == "fedora"
    assert not layout.streams
    assert "path/depth" in layout.absent["depth"]
