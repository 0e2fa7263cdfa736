"""Read tables of FlatBuffers by the numbers of their fields; every offset is tested before it is followed.

Source: "FlatBuffers Internals" (flatbuffers.dev). A buffer begins with the offset of its root table and four characters
that identify its type. A table begins with the distance back to its vtable, which has the offset of each field from the
table, 0 where the field has its default.
"""

import struct
from dataclasses import dataclass
from typing import Final

_HEAD: Final = 8
"""Bytes of the offset of the root and of the identifier."""


class MalformedBufferError(Exception):
    """An offset or a length leads out of the buffer."""


def identifier(buffer: bytes) -> bytes:
    """Return the four characters that identify the type of a buffer."""
    return buffer[4:_HEAD]


@dataclass(frozen=True, slots=True)
class FlatTable:
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
    def root(cls, buffer: bytes) -> "FlatTable":
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
            raise MalformedBufferError(f"a list of {count} items that ends beyond its {len(self.buffer)} bytes")
        return vector + 4, count

    def text(self, field: int) -> str:
        """Return a text, empty where there is none."""
        start, count = self.vector(field, 1)
        return self.buffer[start : start + count].decode("utf-8", "replace")

    def tables(self, field: int) -> list["FlatTable"]:
        """Return the tables of a vector of tables."""
        start, count = self.vector(field, 4)
        places = range(start, start + 4 * count, 4)
        return [FlatTable(self.buffer, place + _unpack("<I", self.buffer, place)) for place in places]


def _unpack(form: str, buffer: bytes, place: int) -> int:
    # A negative place would count from the end.
    if place < 0 or place + struct.calcsize(form) > len(buffer):
        raise MalformedBufferError(f"an offset of {place} in {len(buffer)} bytes")
    number: int = struct.unpack_from(form, buffer, place)[0]
    return number
