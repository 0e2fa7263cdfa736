"""AEDAT 4.0, the format of iniVation: compressed packets of events, frames and IMU samples.

Sources: "AEDAT 4.0" (docs.inivation.com) and the FlatBuffers schemas that it names, whose fields are numbered here in
their order; "FlatBuffers Internals" (flatbuffers.dev). Times are Unix time in us.

A buffer begins with the offset of its root table and four characters that identify its type. A table begins with the
distance back to its vtable, which has the offset of each field from the table, 0 where the field has its default.
Every offset is tested before it is followed.
"""

import struct
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import STANDARD_GRAVITY_M_S2
from fedora_qa.errors import MisuseError
from fedora_qa.importing.compressed import LARGEST_PACKET_BYTES, DamagedPacketError, lz4_frame, zstd_frame
from fedora_qa.importing.recording import Block, Recording, Resolution, event_block

_HEAD: Final = 8
"""Bytes of the offset of the root and of the identifier."""

MAGIC: Final = b"#!AER-DAT4.0\r\n"

_LARGEST_HEADER_BYTES: Final = 16 << 20

_PLAIN: Final = 0
_LZ4: Final = (1, 2)
_ZSTD: Final = (3, 4)

# Fields of IOHeader.
_COMPRESSION, _TABLE_PLACE, _INFO = range(3)

_EVENT: Final = np.dtype(
    {"names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"], "offsets": [0, 8, 10, 12], "itemsize": 16}
)

# Fields of Frame.
_TIME, _START, _END, _EXPOSURE_START, _EXPOSURE_END, _FORMAT, _WIDTH, _HEIGHT, _LEFT, _TOP, _PIXELS = range(11)

_CHANNELS: Final[Mapping[int, tuple[int, tuple[int, int, int]]]] = {
    0: (1, (0, 0, 0)),
    16: (3, (2, 1, 0)),
    24: (4, (2, 1, 0)),
}
"""By format of a frame (the types of OpenCV with one, three and four channels of 8 bits): how many channels there are,
and which of them are R, G, B."""

# Fields of IMU: time in us, temperature, then specific force in g and rates in deg/s.
_IMU_TIME: Final = 0
_FORCE: Final = (2, 3, 4)
_RATE: Final = (5, 6, 7)

_STREAM_OF_TYPE: Final = {"EVTS": "events", "FRME": "rgb", "IMUS": "imu"}
"""Streams by the identifier of their packets; others are left out."""


@dataclass(frozen=True, slots=True)
class _StreamInfo:
    """What the header states of a stream: the identifier of its packets, and the size of its images, if any."""

    kind: str
    size: Resolution | None


@contextmanager
def open_aedat4(path: Path, resolution: Resolution | None) -> Iterator[Recording]:
    """Open a recording, whose blocks can be read within the block.

    Parameters
    ----------
    resolution
        Of the events; takes precedence over that of the header.

    Raises
    ------
    MisuseError
        The header cannot be read, it states two streams of one type, or none that is read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        try:
            header = _FlatTable.root(_sized(file, _LARGEST_HEADER_BYTES))
            compression = header.integer(_COMPRESSION, "<i")
            table_place = header.integer(_TABLE_PLACE, "<q", -1)
            streams = _streams(header.text(_INFO))
        except (_MalformedBufferError, ET.ParseError) as error:
            raise MisuseError(f"Expected the header of AEDAT 4.0, got: {error}: {path}; copy it again") from error
        if compression not in {_PLAIN, *_LZ4, *_ZSTD}:
            raise MisuseError(f"Expected compression 0 to 4 in the header, got {compression}: {path}; copy it again")
        chosen: dict[str, int] = {}
        for number, stream in streams.items():
            if stream.kind in chosen:
                raise MisuseError(
                    f"Expected one stream of the type {stream.kind}, got {chosen[stream.kind]} and {number}: {path}; "
                    "record or export the streams of one camera"
                )
            if stream.kind in _STREAM_OF_TYPE:
                chosen[stream.kind] = number
        if not chosen:
            kinds = ", ".join(sorted({stream.kind for stream in streams.values()})) or "none"
            raise MisuseError(f"Expected a stream of events, frames or IMU samples, got {kinds}: {path}; record again")
        event_size = resolution or (streams[chosen["EVTS"]].size if "EVTS" in chosen else None)
        if "EVTS" in chosen and event_size is None:
            raise MisuseError(
                f"Expected the resolution in the header of {path}, got none; give it with --resolution WxH"
            )
        end = table_place if table_place >= 0 else size
        if end > size or table_place == 0:
            raise MisuseError(
                f"Expected packets up to byte {end}, got a file of {size} bytes; it is cut short: copy it again"
            )
        recording = Recording(
            format="AEDAT 4.0",
            blocks=iter(()),
            size=end,
            cameras={"events": event_size} if event_size else {},
            kind="recorded",
            done=file.tell(),
        )
        numbers = {number: kind for kind, number in chosen.items()}
        recording.blocks = _blocks(file, recording, numbers, compression)
        yield recording


def _streams(info: str) -> dict[int, _StreamInfo]:
    """Return what the header states of each stream, by number; raises ``ET.ParseError``."""
    if "<!" in info.replace("<!--", ""):
        raise ET.ParseError("a definition of entities in its XML")
    streams = {}
    for outputs in ET.fromstring(info).iter("node") if info else ():
        if outputs.get("name") != "outInfo":
            continue
        for node in outputs.findall("node"):
            number, kind = node.get("name", ""), _attribute(node, "typeIdentifier")
            details = node.find("node[@name='info']")
            sides = [_attribute(details, name) for name in ("sizeX", "sizeY")] if details is not None else []
            size = (int(sides[0]), int(sides[1])) if len(sides) == 2 and all(map(_is_size, sides)) else None
            if number.isdecimal():
                streams[int(number)] = _StreamInfo(kind, size)
    return streams


def _attribute(node: ET.Element, key: str) -> str:
    return (node.findtext(f"attr[@key='{key}']") or "").strip()


def _is_size(text: str) -> bool:
    return text.isdecimal() and 0 < int(text) < 1 << 15


class _MalformedBufferError(Exception):
    """An offset or a length leads out of the buffer."""


@dataclass(frozen=True, slots=True)
class _FlatTable:
    """A table within a buffer.

    Attributes
    ----------
    buffer
        All bytes.
    start
        Where the table begins.
    """

    buffer: bytes
    start: int

    @classmethod
    def root(cls, buffer: bytes) -> "_FlatTable":
        """Return the root table of a buffer."""
        return cls(buffer, _unpack("<I", buffer, 0))

    def place(self, field: int) -> int | None:
        """Return where a field lies; None where it has its default."""
        vtable = self.start - _unpack("<i", self.buffer, self.start)
        # The vtable begins with its own size and that of the table.
        if 4 + 2 * field + 2 > _unpack("<H", self.buffer, vtable):
            return None
        offset = _unpack("<H", self.buffer, vtable + 4 + 2 * field)
        return self.start + offset if offset else None

    def number(self, field: int, form: str, default: int | float = 0) -> int | float:
        """Return a number; ``form`` is that of ``struct``, such as ``<q``."""
        place = self.place(field)
        return default if place is None else _unpack(form, self.buffer, place)

    def integer(self, field: int, form: str, default: int = 0) -> int:
        """Return a whole number."""
        return int(self.number(field, form, default))

    def vector(self, field: int, item_bytes: int) -> tuple[int, int]:
        """Return where the items of a vector begin, and how many there are; all of them lie in the buffer."""
        place = self.place(field)
        if place is None:
            return 0, 0
        vector = place + _unpack("<I", self.buffer, place)
        count = _unpack("<I", self.buffer, vector)
        if vector + 4 + count * item_bytes > len(self.buffer):
            raise _MalformedBufferError(f"a list of {count} items that ends beyond its {len(self.buffer)} bytes")
        return vector + 4, count

    def text(self, field: int) -> str:
        """Return a text, empty where there is none."""
        start, count = self.vector(field, 1)
        return self.buffer[start : start + count].decode("utf-8", "replace")

    def tables(self, field: int) -> list["_FlatTable"]:
        """Return the tables of a vector of tables."""
        start, count = self.vector(field, 4)
        places = range(start, start + 4 * count, 4)
        return [_FlatTable(self.buffer, place + _unpack("<I", self.buffer, place)) for place in places]


def _unpack(form: str, buffer: bytes, place: int) -> int:
    # A negative place would count from the end.
    if place < 0 or place + struct.calcsize(form) > len(buffer):
        raise _MalformedBufferError(f"an offset of {place} in {len(buffer)} bytes")
    number: int = struct.unpack_from(form, buffer, place)[0]
    return number


def _identifier(buffer: bytes) -> bytes:
    """Return the four characters that identify the type of a buffer."""
    return buffer[4:_HEAD]


def _sized(file: BinaryIO, most: int) -> bytes:
    """Read a buffer behind its size."""
    head = file.read(4)
    size = struct.unpack("<I", head)[0] if len(head) == 4 else 0
    data = file.read(size) if 0 < size <= most else b""
    if not data or len(data) < size:
        raise _MalformedBufferError(f"a size of {size} bytes, of which {len(data)} are there")
    return data


def _blocks(file: BinaryIO, recording: Recording, numbers: Mapping[int, str], compression: int) -> Iterator[Block]:
    """Yield the rows of every packet of the streams with these numbers."""
    left_out = 0
    while recording.done < recording.size:
        start = recording.done
        head = file.read(8)
        number, size = struct.unpack("<ii", head) if len(head) == 8 else (-1, -1)
        if not 0 < size <= LARGEST_PACKET_BYTES or start + 8 + size > recording.size:
            raise MisuseError(
                f"Expected a packet of 1 to {LARGEST_PACKET_BYTES} bytes at byte {start}, got a size of {size} with "
                f"{recording.size - start - len(head)} bytes left; the recording is cut short or damaged: copy it again"
            )
        content = file.read(size)
        recording.done += len(head) + len(content)
        if number not in numbers:
            left_out += 1
            recording.facts["packets of other streams"] = left_out
            continue
        try:
            yield from _rows(_plain(content, compression), numbers[number], recording)
        except (_MalformedBufferError, DamagedPacketError) as error:
            raise MisuseError(f"Expected a whole packet at byte {start}, got: {error}; copy it again") from error


def _plain(content: bytes, compression: int) -> bytes:
    """Return the buffer in a packet, without its size."""
    if compression in _LZ4:
        content = lz4_frame(content)
    elif compression in _ZSTD:
        content = zstd_frame(content)
    size = struct.unpack_from("<I", content)[0] if len(content) >= 4 else 0
    if size != len(content) - 4:
        raise _MalformedBufferError(
            f"a buffer of {len(content)} bytes that states {size}, without the four of its size"
        )
    return content[4:]


def _rows(buffer: bytes, kind: str, recording: Recording) -> Iterator[Block]:
    if _identifier(buffer) != kind.encode():
        raise _MalformedBufferError(f"the type {_identifier(buffer)!r} in a stream of {kind}")
    yield from _ROWS_OF_TYPE[kind](_FlatTable.root(buffer), recording)


def _events(packet: _FlatTable, _recording: Recording) -> Iterator[Block]:
    start, count = packet.vector(0, _EVENT.itemsize)
    events = np.frombuffer(packet.buffer, _EVENT, count, start)
    if count:
        # Negative coordinates become large ones, which lie outside of every sensor as well.
        yield event_block(
            events["x"].astype(np.uint16),
            events["y"].astype(np.uint16),
            events["t"],
            (events["p"] != 0).astype(np.uint8),
        )


def _frame(frame: _FlatTable, recording: Recording) -> Iterator[Block]:
    width, height = frame.integer(_WIDTH, "<h"), frame.integer(_HEIGHT, "<h")
    code = frame.integer(_FORMAT, "<b")
    start, count = frame.vector(_PIXELS, 1)
    if code not in _CHANNELS:
        raise _MalformedBufferError(f"a frame of the format {code}, where grey, BGR and BGRA are {list(_CHANNELS)}")
    channels, rgb = _CHANNELS[code]
    if width <= 0 or height <= 0 or count != width * height * channels:
        raise _MalformedBufferError(f"a frame of {width} x {height} x {channels} with {count} bytes")
    pixels = np.frombuffer(frame.buffer, np.uint8, count, start).reshape(1, height, width, channels)
    time_us = frame.integer(_TIME, "<q")
    opened, closed = frame.integer(_EXPOSURE_START, "<q"), frame.integer(_EXPOSURE_END, "<q")
    # The layout stamps the middle of the exposure; without one the time of the frame is all there is.
    middle_us = (opened + closed) // 2 if 0 < opened <= closed else time_us
    recording.cameras.setdefault("rgb", (width, height))
    yield Block({"path/rgb": np.ascontiguousarray(pixels[..., rgb]), "path/rgb_ts": np.array([middle_us], np.int64)})


def _imu(packet: _FlatTable, _recording: Recording) -> Iterator[Block]:
    samples = packet.tables(0)

    def column(fields: tuple[int, int, int]) -> NDArray[np.float64]:
        numbers = [[sample.number(field, "<f") for field in fields] for sample in samples]
        return np.array(numbers, np.float64).reshape(-1, 3)

    if samples:
        yield Block(
            {
                "path/imu/angular_velocity": np.deg2rad(column(_RATE)),
                "path/imu/linear_acceleration": STANDARD_GRAVITY_M_S2 * column(_FORCE),
                "path/imu/ts": np.array([sample.integer(_IMU_TIME, "<q") for sample in samples], np.int64),
            }
        )


_ROWS_OF_TYPE: Final[Mapping[str, Callable[[_FlatTable, Recording], Iterator[Block]]]] = {
    "EVTS": _events,
    "FRME": _frame,
    "IMUS": _imu,
}
