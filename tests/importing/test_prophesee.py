"""EVT2, EVT3 and DAT are decoded as their formats are described, by an encoder of its own."""

import json
import struct
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.errors import MisuseError
from fedora_qa.importing import recording
from fedora_qa.importing.run import PROVENANCE, ImportOptions
from fedora_qa.layout.decodable import filter_parameters
from tests.importing.reading import events_of, imported
from tests.support.prophesee import (
    DAT_HEADER,
    RAW_HEADER,
    WRITERS,
    Event,
    dat_words,
    evt2_words,
    random_events,
    write_dat,
    write_evt2,
    write_evt3,
)

# Steps of time up to 10 s: EVT3 begins anew after 16.8 s.
EVENTS = st.lists(
    st.tuples(
        st.integers(0, 2047),
        st.integers(0, 2047),
        st.one_of(st.just(0), st.integers(0, 100), st.integers(0, 10_000_000)),
        st.integers(0, 1),
    ),
    min_size=1,
    max_size=40,
)


def with_times(steps: list[Event]) -> list[Event]:
    """Events whose third number is the step from the event before."""
    times = np.cumsum([step[2] for step in steps]).tolist()
    return [(x, y, t, p) for (x, y, _, p), t in zip(steps, times, strict=True)]


@pytest.mark.parametrize("name", WRITERS)
@settings(max_examples=60, deadline=None)
@given(steps=EVENTS)
def test_events_return(name: str, steps: list[Event]) -> None:
    """What is encoded is decoded, over any number of periods of the clock."""
    events = with_times(steps)
    with tempfile.TemporaryDirectory() as folder:
        source = WRITERS[name](Path(folder) / "a.raw", events)
        imported(source, Path(folder) / "out.h5")
        assert events_of(Path(folder) / "out.h5") == events


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("block_bytes", [8, 24, 4096])
def test_state_is_carried_over_blocks(
    name: str, block_bytes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks of any length give the same events."""
    monkeypatch.setattr("fedora_qa.importing.prophesee_file.BLOCK_BYTES", block_bytes)
    assert block_bytes != recording.BLOCK_BYTES
    events = random_events(300, 1)
    imported(WRITERS[name](tmp_path / "a.raw", events), tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == events


def test_clocks_begin_anew(tmp_path: Path) -> None:
    """The periods of 34 and 32 bits of EVT2 and DAT."""
    late = (1 << 34) - 1
    write_evt2(tmp_path / "a.raw", [(1, 2, late, 1), (1, 2, late + 2, 0)])
    imported(tmp_path / "a.raw", tmp_path / "a.h5")
    assert events_of(tmp_path / "a.h5") == [(1, 2, late, 1), (1, 2, late + 2, 0)]
    late = (1 << 32) - 1
    write_dat(tmp_path / "b.dat", [(1, 2, late, 1), (1, 2, late + 2, 0)])
    imported(tmp_path / "b.dat", tmp_path / "b.h5")
    assert events_of(tmp_path / "b.h5") == [(1, 2, late, 1), (1, 2, late + 2, 0)]


def test_a_written_example_of_evt3(tmp_path: Path) -> None:
    """Words as in the documentation, read by hand: vectors of 12 and 8, a single event, words without events."""
    words = [
        *(0x2005, 0x3005),  # before any time and row: nothing can be said of them
        *(0x8001, 0x6002),  # 4096 + 2 us
        *(0x000A, 0x380A, 0x4801, 0x5081),  # row 10, base 10, brighter: columns 10, 21, 22, 29
        *(0x2014, 0x2815),  # column 20 darker, 21 brighter
        *(0xA000, 0xE000, 0x7123, 0xF123, 0x1000),  # trigger, others, continued, none of the types
        0x5001,  # the base went on behind both vectors: column 30
        *(0x8002, 0x2001),  # the lower part of the time begins with the upper one
    ]
    path = tmp_path / "a.raw"
    path.write_bytes(RAW_HEADER.format(version="3.0", name="EVT3").encode() + struct.pack(f"<{len(words)}H", *words))
    done = imported(path, tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == [
        *((x, 10, 4098, 1) for x in (10, 21, 22, 29)),
        *((20, 10, 4098, 0), (21, 10, 4098, 1), (30, 10, 4098, 1), (1, 10, 8192, 0)),
    ]
    assert done.facts["events before the first time and row"] == 1
    assert done.facts["triggers"] == 1
    assert done.facts["words of no known type"] == 1


@pytest.mark.parametrize(
    ("header", "size"),
    [
        ("% evt 3.0\n% geometry 320x240\n", (320, 240)),
        ("% format EVT3;width=100;height=50\n% end\n", (100, 50)),
        ("% evt 3.0\r\n% geometry 1280x720\r\n% end\r\n", (1280, 720)),
    ],
)
def test_forms_of_headers(header: str, size: tuple[int, int], tmp_path: Path) -> None:
    """The resolution stands in several places; the end need not be marked."""
    source = write_evt3(tmp_path / "a.raw", [(1, 2, 3, 1)], header)
    imported(source, tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == [(1, 2, 3, 1)]
    with h5py.File(tmp_path / "out.h5") as file:
        camera = file["metadata/cameras/events"].attrs
        assert (camera["width"], camera["height"]) == size


def test_data_that_begin_like_a_header(tmp_path: Path) -> None:
    """Where the end is not marked, data that begin with the bytes of ``% `` are data."""
    data = b"% \x01\x10" + evt2_words([(1, 2, 3, 1)])
    (tmp_path / "a.raw").write_bytes(b"% evt 2.0\n% geometry 640x480\n" + data + b"\n\x00\x00\xf0")
    done = imported(tmp_path / "a.raw", tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == [(1, 2, 3, 1)]
    assert done.facts["events before the first time"] == 1


def test_resolution_is_given(tmp_path: Path) -> None:
    """It takes precedence over that of the header, and is required where the header has none."""
    source = write_evt3(tmp_path / "a.raw", [(1, 2, 3, 1)], "% evt 3.0\n")
    with pytest.raises(MisuseError, match="--resolution WxH"):
        imported(source, tmp_path / "out.h5")
    imported(source, tmp_path / "out.h5", ImportOptions(resolution=(30, 40)))
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["metadata/cameras/events"].attrs["height"] == 40


def test_provenance(tmp_path: Path) -> None:
    """The file says what it was made from."""
    source = write_evt2(tmp_path / "flight.raw", random_events(50, 2))
    imported(source, tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        assert file.attrs["sequence"] == "flight"
        assert file.attrs["kind"] == "recorded"
        assert file.attrs["created_by"].startswith("fedora-qa import ")
        document = json.loads(file[PROVENANCE][()])
    assert document["source"]["name"] == "flight.raw"
    assert document["source"]["format"] == "Prophesee EVT2"
    assert document["source"]["size"] == source.stat().st_size
    assert document["facts"]["header.date"] == "2026-01-02 03:04:05"


EVT2_HEADER = RAW_HEADER.format(version="2.0", name="EVT2").encode()
BACKWARDS: list[Event] = [(1, 2, 300, 1), (1, 2, 200, 1)]
REFUSED = {
    "cut within a word": (EVT2_HEADER + evt2_words([(1, 2, 3, 1)])[:-1], "3 bytes after the last"),
    "no events": (EVT2_HEADER, "got none"),
    "header alone of DAT": (DAT_HEADER.encode(), "the end of the file"),
    "no encoding": (b"% date today\n% end\n\0\0", "names no encoding"),
    "EVT 2.1": (b"% evt 2.1\n% geometry 640x480\n% end\n" + bytes(8), "got EVT21"),
    "EVT 4": (b"% format EVT4;width=1;height=1\n% end\n" + bytes(8), "got EVT4"),
    "big endian": (b"% format EVT3;width=9;height=9;endianness=big\n% end\n\0\0", "little-endian"),
    "DAT of version 1": (DAT_HEADER.replace("Version 2", "Version 1").encode() + dat_words(BACKWARDS), "version 1"),
    "DAT without a version": (DAT_HEADER.replace("% Version 2\n", "").encode() + dat_words([]), "version none"),
    "triggers in DAT": (DAT_HEADER.encode() + b"\x0e\x08" + bytes(8), "got type 14 and 8 bytes"),
    "time of DAT runs backwards": (DAT_HEADER.encode() + dat_words(BACKWARDS), "got 200 us after 300 us at row 1"),
    "a resolution of nothing": (b"% evt 3.0\n% geometry 0x0\n% end\n\0\0", "1 to 16384 px"),
    "an endless header": (b"% a b\n" * 2000, "at most 1024 lines"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str, tmp_path: Path) -> None:
    """One sentence says what was expected, what there is, and what to do."""
    data, part = REFUSED[name]
    (tmp_path / "a.raw").write_bytes(data)
    with pytest.raises(MisuseError, match=r"^Expected .*, got .*;") as caught:
        imported(tmp_path / "a.raw", tmp_path / "out.h5")
    assert part in str(caught.value)


def test_backwards_as_they_are(tmp_path: Path) -> None:
    """They are written, for a check to find."""
    source = write_dat(tmp_path / "a.dat", BACKWARDS)
    imported(source, tmp_path / "out.h5", ImportOptions(allow_backwards=True))
    assert events_of(tmp_path / "out.h5") == BACKWARDS


@pytest.mark.parametrize("name", WRITERS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_mutated_recordings(name: str, data: st.DataObject) -> None:
    """Bytes that change, vanish or are repeated give events or one sentence."""
    with tempfile.TemporaryDirectory() as folder:
        source = WRITERS[name](Path(folder) / "a.raw", random_events(60, 3))
        content = bytearray(source.read_bytes())
        for _ in range(data.draw(st.integers(1, 6))):
            at = data.draw(st.integers(0, len(content) - 1))
            content[at] = data.draw(st.integers(0, 255))
        content = content[: data.draw(st.integers(1, len(content)))]
        source.write_bytes(content)
        options = ImportOptions(allow_backwards=data.draw(st.booleans()))
        refusal = ""
        try:
            done = imported(source, Path(folder) / "out.h5", options)
        except MisuseError as error:
            refusal = str(error)
        assert refusal.startswith("Expected ") or len(events_of(Path(folder) / "out.h5")) == done.rows["events"] > 0


def test_how_it_is_compressed_alters_no_value(tmp_path: Path) -> None:
    """Level and number of threads: the level stands in the file, and the number of threads leaves no trace."""
    events = random_events(20_000, 4)
    source = write_evt3(tmp_path / "a.raw", events)
    stored = []
    for level, threads in ((2, 1), (2, 3), (7, 2)):
        imported(source, tmp_path / "out.h5", ImportOptions(level=level, threads=threads))
        assert events_of(tmp_path / "out.h5") == events
        with h5py.File(tmp_path / "out.h5") as file:
            columns = [file[f"path/events/{name}"] for name in "xytp"]
            assert {filter_parameters(column, 0)[4] for column in columns} == {level}
            stored.append([column.id.read_direct_chunk((0,)) for column in columns])
    assert stored[0] == stored[1] != stored[2]
