"""AEDAT 4.0 is decoded as it is described, by an encoder of its own."""

import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.errors import MisuseError
from fedora_qa.importing import compressed
from fedora_qa.importing.run import ImportOptions
from tests.importing.reading import events_of, imported
from tests.support.aedat4 import CODES, aedat4, events_packet, frame_packet, imu_packet, write_aedat4
from tests.support.prophesee import random_events

STREAMS = {0: ("EVTS", (346, 260)), 1: ("FRME", (346, 260)), 2: ("IMUS", None), 3: ("TRIG", None)}
EVENTS = random_events(500, 6)
PIXELS = bytes(range(24))


def packets() -> list[tuple[int, bytes]]:
    """Events in two packets, two frames, IMU samples and a trigger."""
    return [
        (0, events_packet(EVENTS[:200])),
        (1, frame_packet(1000, 4, 2, 16, PIXELS, exposure=(600, 1000))),
        (2, imu_packet([(100, (0.0, 0.0, 1.0), (180.0, 0.0, -90.0)), (200, (0.5, 0.0, 1.0), (0.0, 0.0, 0.0))])),
        (3, b"whatever"),
        (0, events_packet(EVENTS[200:])),
        (1, frame_packet(2000, 4, 2, 16, PIXELS)),
    ]


@pytest.mark.parametrize("compression", CODES)
@pytest.mark.parametrize("has_table", [False, True])
def test_streams_return(compression: str, has_table: bool, tmp_path: Path) -> None:
    """Events, frames with channels in order at the middle of the exposure, IMU samples in SI units."""
    source = write_aedat4(tmp_path / "a.aedat4", packets(), STREAMS, compression, has_table=has_table)
    done = imported(source, tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == EVENTS
    assert done.rows == {"rgb": 2, "events": len(EVENTS), "imu": 2}
    assert done.facts == {"packets of other streams": 1}
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["path/rgb_ts"][:].tolist() == [800, 2000]
        np.testing.assert_array_equal(file["path/rgb"][0], np.frombuffer(PIXELS, np.uint8).reshape(2, 4, 3)[..., ::-1])
        np.testing.assert_allclose(file["path/imu/angular_velocity"][0], [np.pi, 0, -np.pi / 2], rtol=1e-7)
        np.testing.assert_allclose(file["path/imu/linear_acceleration"][1], [9.80665 / 2, 0, 9.80665], rtol=1e-7)
        assert file["path/imu/ts"][:].tolist() == [100, 200]
        assert file["metadata/cameras/events"].attrs["width"] == 346
        assert file["metadata/cameras/rgb"].attrs["width"] == 4
        times = [event[2] for event in EVENTS]
        np.testing.assert_array_equal(file["metadata/rgb_to_event"], np.searchsorted(times, [800, 2000]))


@pytest.mark.parametrize(("code", "channels"), [(0, 1), (24, 4)])
def test_other_frames(code: int, channels: int, tmp_path: Path) -> None:
    """Grey is read as R = G = B; the fourth channel is left out."""
    pixels = bytes(range(6 * channels))
    source = write_aedat4(tmp_path / "a.aedat4", [(1, frame_packet(5, 3, 2, code, pixels))], {1: STREAMS[1]})
    imported(source, tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        stored = np.frombuffer(pixels, np.uint8).reshape(2, 3, channels)
        np.testing.assert_array_equal(file["path/rgb"][0], stored[..., [2, 1, 0] if channels == 4 else [0, 0, 0]])


DAMAGED = events_packet(EVENTS[:5])
REFUSED = {
    "cut within a packet": (aedat4(packets(), STREAMS, has_table=False)[:-5], "cut short or damaged"),
    "cut before the table": (aedat4(packets(), STREAMS)[:-60], "it is cut short"),
    "header alone": (b"#!AER-DAT4.0\r\n", "the header of AEDAT 4.0"),
    "two cameras": (aedat4([], {0: STREAMS[0], 5: STREAMS[0]}), "one stream of the type EVTS, got 0 and 5"),
    "no stream that is read": (aedat4([], {3: STREAMS[3]}), "got TRIG"),
    "no packets": (aedat4([], STREAMS), "got none"),
    "no resolution": (aedat4(packets(), {0: ("EVTS", None)}), "--resolution WxH"),
    "another type in the stream": (aedat4([(2, DAMAGED)], STREAMS), "the type b'EVTS' in a stream of IMUS"),
    "a list beyond its bytes": (aedat4([(0, DAMAGED[:-20])], STREAMS), "that states"),
    "a packet of three bytes": (aedat4([(0, b"abc")], STREAMS, "none"), "a buffer of 3 bytes that states 0"),
    "pixels are missing": (aedat4([(1, frame_packet(5, 4, 2, 16, PIXELS[:-1]))], STREAMS), "4 x 2 x 3 with 23 bytes"),
    "a frame of another format": (aedat4([(1, frame_packet(5, 4, 2, 2, PIXELS))], STREAMS), "the format 2"),
    "frames of two sizes": (
        aedat4([(1, frame_packet(5, 4, 2, 16, PIXELS)), (1, frame_packet(6, 2, 4, 16, PIXELS))], STREAMS),
        "all rgb images to have the shape",
    ),
    "time runs backwards": (aedat4([(0, events_packet(EVENTS[::-1]))], STREAMS), "do not decrease"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str, tmp_path: Path) -> None:
    """One sentence says what was expected, what there is, and what to do."""
    data, part = REFUSED[name]
    (tmp_path / "a.aedat4").write_bytes(data)
    with pytest.raises(MisuseError, match=r"^Expected .*, got.*;") as caught:
        imported(tmp_path / "a.aedat4", tmp_path / "out.h5")
    assert part in str(caught.value)


def test_bytes_that_are_not_compressed(tmp_path: Path) -> None:
    """Packets without compression in a recording that declares LZ4."""
    plain, packed = aedat4([(0, DAMAGED)], STREAMS, "none"), aedat4([], STREAMS, "lz4", has_table=False)
    body = plain[len(aedat4([], STREAMS, "none", has_table=False)) :]
    (tmp_path / "a.aedat4").write_bytes(packed + body)
    with pytest.raises(MisuseError, match="Expected a whole packet at byte"):
        imported(tmp_path / "a.aedat4", tmp_path / "out.h5")


@pytest.mark.parametrize("version", ["3.1", "2.0"])
def test_earlier_versions(version: str, tmp_path: Path) -> None:
    """They are named."""
    (tmp_path / "a.aedat").write_bytes(f"#!AER-DAT{version}\r\n".encode())
    with pytest.raises(MisuseError, match=rf"Expected AEDAT 4.0, got AEDAT {version}"):
        imported(tmp_path / "a.aedat", tmp_path / "out.h5")


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_packet_that_grows_is_refused(compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No more is decompressed than a packet may have."""
    monkeypatch.setattr(compressed, "LARGEST_PACKET_BYTES", 1 << 16)
    source = write_aedat4(tmp_path / "a.aedat4", [(0, bytes(1 << 20))], STREAMS, compression)
    with pytest.raises(MisuseError, match="more than 65536 bytes"):
        imported(source, tmp_path / "out.h5")


@pytest.mark.parametrize(("compression", "package"), [("lz4", "lz4.frame"), ("zstd", "backports")])
def test_without_the_codec(compression: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sentence names the extra; a recording without compression needs none."""
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, "compression", None)
    source = write_aedat4(tmp_path / "a.aedat4", packets(), STREAMS, compression)
    with pytest.raises(MisuseError, match=r"pip install 'fedora-qa\[aedat\]'"):
        imported(source, tmp_path / "out.h5")
    imported(write_aedat4(tmp_path / "b.aedat4", packets(), STREAMS, "none"), tmp_path / "b.h5")


@pytest.mark.parametrize("compression", ["none", "lz4"])
@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_mutated_recordings(compression: str, data: st.DataObject) -> None:
    """Bytes that change or vanish give rows or one sentence."""
    content = bytearray(aedat4(packets(), STREAMS, compression))
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(14, len(content) - 1))] = data.draw(st.integers(0, 255))
    content = content[: data.draw(st.integers(15, len(content)))]
    with tempfile.TemporaryDirectory() as folder:
        source, refusal = Path(folder) / "a.aedat4", ""
        source.write_bytes(content)
        try:
            done = imported(source, Path(folder) / "out.h5", ImportOptions(allow_backwards=data.draw(st.booleans())))
        except MisuseError as error:
            refusal = str(error)
        assert refusal.startswith("Expected ") or any(done.rows.values())
