"""Bags of ROS 1, format 2.0, read chunk by chunk in the order of the file, so that memory does not grow with length.

Source: the description of the format, http://wiki.ros.org/Bags/Format/2.0. A bag is a sequence of records, each a
header of fields ``name=value`` and data. The record behind the magic line says where the index begins: connections,
each with its topic and type, and for each chunk how many messages it has of each. Chunks lie before it, and hold
messages in the order in which they were received.
"""

import bz2
import os
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final, Self

from fedora_qa.importing.compressed import DamagedPacketError, decompressed, lz4_decompressor

MAGIC: Final = b"#ROSBAG V2.0\n"

LARGEST_CHUNK_BYTES: Final = 128 << 20
"""Decompressed. Recorders close a chunk at 768 KiB; one image of 40 megapixels fits."""

_LARGEST_HEADER_BYTES: Final = 64 << 10
_LARGEST_CONNECTION_BYTES: Final = 4 << 20
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = b"\x02", b"\x03", b"\x04", b"\x05", b"\x06", b"\x07"
_U32, _U64 = struct.Struct("<I"), struct.Struct("<Q")
_COUNT: Final = struct.Struct("<II")

Fields = dict[bytes, bytes]


class DamagedBagError(Exception):
    """A bag is not as its format has it; the text completes "got"."""


@dataclass(slots=True)
class Connection:
    """Messages of one publisher.

    Attributes
    ----------
    topic, type_name
        Topic, and type as in ROS 2 (``sensor_msgs/msg/Imu``).
    definition
        Text of the type.
    count
        Number of messages, by the index.
    """

    topic: str
    type_name: str
    definition: str
    count: int = 0


class Ros1Bag:
    """An open bag. Use as a context manager.

    Attributes
    ----------
    connections
        By their number in the bag.
    """

    def __init__(self, path: Path) -> None:
        """Read the index; raises ``DamagedBagError`` or ``OSError``."""
        self.connections: dict[int, Connection] = {}
        self._file: BinaryIO = path.open("rb")
        try:
            self._size = os.fstat(self._file.fileno()).st_size
            self._read_index()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        """Return the bag."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, memoryview]]:
        """Yield the number of the connection and the bytes of each message of some connections.

        The bytes are those of a chunk: whoever keeps them keeps all of it.

        Raises
        ------
        DamagedBagError, OSError
            A record cannot be read.
        """
        self._file.seek(self._first)
        while self._file.tell() < self._index:
            fields = self._header()
            if fields[b"op"] != _CHUNK:
                self._skip()
                continue
            yield from _messages_in(memoryview(self._chunk(fields)), wanted)

    def _read_index(self) -> None:
        if self._file.read(len(MAGIC)) != MAGIC:
            raise DamagedBagError("another beginning than that of a bag")
        fields = self._header()
        if fields[b"op"] != _BAG:
            raise DamagedBagError("no header of a bag at its beginning")
        self._skip()
        self._first, self._index = self._file.tell(), _u64(fields, b"index_pos")
        if not self._first <= self._index < self._size:
            raise DamagedBagError("a bag without an index, whose recording was not closed")
        self._file.seek(self._index)
        while self._file.tell() < self._size:
            fields = self._header()
            if fields[b"op"] == _CONNECTION:
                number, described = _connection(fields, self._data(_LARGEST_CONNECTION_BYTES))
                self.connections[number] = described
            elif fields[b"op"] == _CHUNK_INFO:
                counts = self._data(_LARGEST_CONNECTION_BYTES)
                for number, count in _COUNT.iter_unpack(counts[: len(counts) // _COUNT.size * _COUNT.size]):
                    if number in self.connections:
                        self.connections[number].count += count
            else:
                raise DamagedBagError("a record in the index that does not belong there")

    def _header(self) -> Fields:
        fields = _fields(self._data(_LARGEST_HEADER_BYTES))
        if b"op" not in fields:
            raise DamagedBagError("a record without a kind")
        return fields

    def _data(self, most: int) -> bytes:
        """Return the next bytes, whose number stands before them."""
        length = self._length()
        if length > most:
            raise DamagedBagError(f"a record of {length} bytes where {most} at most are read")
        return self._file.read(length)

    def _length(self) -> int:
        word = self._file.read(_U32.size)
        length = int(_U32.unpack(word)[0]) if len(word) == _U32.size else self._size
        if length > self._size - self._file.tell():
            raise DamagedBagError("a record that ends behind the end of the file")
        return length

    def _skip(self) -> None:
        length = self._length()
        self._file.seek(length, os.SEEK_CUR)

    def _chunk(self, fields: Fields) -> bytes:
        """Return the bytes of a chunk, decompressed."""
        size, compression = _u32(fields, b"size"), fields.get(b"compression", b"none")
        if size > LARGEST_CHUNK_BYTES:
            raise DamagedBagError(f"a chunk of {size} bytes where {LARGEST_CHUNK_BYTES} at most are read")
        stored = self._data(LARGEST_CHUNK_BYTES)
        try:
            if compression == b"bz2":
                stored = decompressed(bz2.BZ2Decompressor(), stored, (OSError, EOFError, ValueError), size)
            elif compression == b"lz4":
                stored = decompressed(lz4_decompressor(), stored, (RuntimeError, EOFError), size)
            elif compression != b"none":
                raise DamagedBagError(f"a chunk that is compressed by {compression[:16]!r}")
        except DamagedPacketError as error:
            raise DamagedBagError(f"a chunk that does not decompress ({error})") from error
        if len(stored) != size:
            raise DamagedBagError(f"a chunk of {len(stored)} bytes that states {size}")
        return stored


def _messages_in(chunk: memoryview, wanted: Collection[int]) -> Iterator[tuple[int, memoryview]]:
    place = 0
    while place < len(chunk):
        header, place = _part(chunk, place)
        data, place = _part(chunk, place)
        fields = _fields(header.tobytes())
        if fields.get(b"op") != _MESSAGE:
            continue
        number = _u32(fields, b"conn")
        if number in wanted:
            yield number, data


def _part(chunk: memoryview, place: int) -> tuple[memoryview, int]:
    """Return the bytes whose number stands at a place, and the place behind them."""
    if place + _U32.size > len(chunk):
        raise DamagedBagError("a chunk that ends within a record")
    begin = place + _U32.size
    end = begin + int(_U32.unpack_from(chunk, place)[0])
    if end > len(chunk):
        raise DamagedBagError("a chunk that ends within a record")
    return chunk[begin:end], end


def _fields(header: bytes) -> Fields:
    """Return the fields of a header."""
    fields: Fields = {}
    place = 0
    while place < len(header):
        if place + _U32.size > len(header):
            raise DamagedBagError("a header that ends within a field")
        begin = place + _U32.size
        place = begin + int(_U32.unpack_from(header, place)[0])
        name, equals, value = header[begin:place].partition(b"=")
        if not equals or place > len(header):
            raise DamagedBagError("a field without a name or an end")
        fields[name] = value
    return fields


def _connection(fields: Fields, data: bytes) -> tuple[int, Connection]:
    described = _fields(data)
    package, _, name = _text(described, b"type").rpartition("/")
    topic = _text(fields, b"topic")
    definition = _text(described, b"message_definition")
    return _u32(fields, b"conn"), Connection(topic, f"{package.removesuffix('/msg')}/msg/{name}", definition)


def _text(fields: Fields, name: bytes) -> str:
    return fields.get(name, b"").decode("utf-8", "replace")


def _u32(fields: Fields, name: bytes) -> int:
    return _number(fields, name, _U32)


def _u64(fields: Fields, name: bytes) -> int:
    return _number(fields, name, _U64)


def _number(fields: Fields, name: bytes, form: struct.Struct) -> int:
    value: Any = fields.get(name, b"")
    if len(value) != form.size:
        raise DamagedBagError(f"a record without {name.decode()}")
    return int(form.unpack(value)[0])
