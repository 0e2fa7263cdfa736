"""AEDAT 4.0 as its documentation and schemas describe it: a small writer of FlatBuffers, and packets of them.

Sources: "AEDAT 4.0" (docs.inivation.com), "FlatBuffers Internals" (flatbuffers.dev).
"""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import lz4.frame
from backports import zstd

Fields = Mapping[int, tuple[str, Any]]
"""By number: a form of ``struct`` and a number, or ``bytes``, ``structs`` or ``tables`` and what they hold."""

REFERENCES = {"bytes", "structs", "tables"}
CODES = {"none": 0, "lz4": 1, "lz4_high": 2, "zstd": 3, "zstd_high": 4}


def align(buffer: bytearray, to: int, offset: int = 0) -> None:
    buffer.extend(bytes(-(len(buffer) + offset) % to))


def add_table(buffer: bytearray, fields: Fields) -> int:
    """Append a table and what it refers to, and return where it begins."""
    count = max(fields, default=-1) + 1
    vtable_bytes = 4 + 2 * count
    align(buffer, 8, vtable_bytes)
    offsets, body = [0] * count, bytearray(struct.pack("<i", vtable_bytes))
    for number, (form, value) in fields.items():
        size = 4 if form in REFERENCES else struct.calcsize(form)
        align(body, size)
        offsets[number] = len(body)
        body += bytes(4) if form in REFERENCES else struct.pack(form, value)
    buffer += struct.pack(f"<HH{count}H", vtable_bytes, len(body), *offsets)
    table = len(buffer)
    buffer += body
    for number, (form, value) in fields.items():
        if form not in REFERENCES:
            continue
        align(buffer, 8, 4)
        vector, place = len(buffer), table + offsets[number]
        struct.pack_into("<I", buffer, place, vector - place)
        if form == "tables":
            buffer += struct.pack("<I", len(value)) + bytes(4 * len(value))
            for k, item in enumerate(value):
                at = vector + 4 + 4 * k
                struct.pack_into("<I", buffer, at, add_table(buffer, item) - at)
        else:
            items, data = value if form == "structs" else (len(value), value)
            buffer += struct.pack("<I", items) + data
            align(buffer, 4)
    return table


def flatbuffer(kind: str, fields: Fields) -> bytes:
    """A buffer behind its size. Alignment counts from the size on, offsets from behind it."""
    buffer = bytearray(8) + kind.encode()
    table = add_table(buffer, fields)
    struct.pack_into("<II", buffer, 0, len(buffer) - 4, table - 4)
    return bytes(buffer)


def events_packet(events: Sequence[tuple[int, int, int, int]]) -> bytes:
    """Column, row, time in us, polarity."""
    data = b"".join(struct.pack("<qhhB3x", t, x, y, p) for x, y, t, p in events)
    return flatbuffer("EVTS", {0: ("structs", (len(events), data))})


def frame_packet(
    time_us: int, width: int, height: int, code: int, pixels: bytes, exposure: tuple[int, int] = (0, 0)
) -> bytes:
    fields: dict[int, tuple[str, Any]] = {0: ("<q", time_us), 5: ("<b", code), 6: ("<h", width), 7: ("<h", height)}
    if exposure[1]:
        fields |= {3: ("<q", exposure[0]), 4: ("<q", exposure[1])}
    return flatbuffer("FRME", {**fields, 10: ("bytes", pixels)})


def imu_packet(samples: Sequence[tuple[int, Sequence[float], Sequence[float]]]) -> bytes:
    """Time in us, specific force in g, rates in deg/s."""
    tables = [
        {
            0: ("<q", t),
            **{2 + k: ("<f", a) for k, a in enumerate(force)},
            **{5 + k: ("<f", w) for k, w in enumerate(rate)},
        }
        for t, force, rate in samples
    ]
    return flatbuffer("IMUS", {0: ("tables", tables)})


def info_xml(streams: Mapping[int, tuple[str, tuple[int, int] | None]]) -> str:
    nodes = []
    for number, (kind, size) in streams.items():
        sides = (
            ""
            if size is None
            else f'<attr key="sizeX" type="int">{size[0]}</attr><attr key="sizeY" type="int">{size[1]}</attr>'
        )
        nodes.append(
            f'<node name="{number}" path="/mainloop/Recorder/outInfo/{number}/">'
            f'<attr key="compression" type="string">LZ4</attr><attr key="typeIdentifier" type="string">{kind}</attr>'
            f'<node name="info" path="/mainloop/Recorder/outInfo/{number}/info/">{sides}</node></node>'
        )
    return f'<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/">{"".join(nodes)}</node></dv>'


def aedat4(
    packets: Sequence[tuple[int, bytes]],
    streams: Mapping[int, tuple[str, tuple[int, int] | None]],
    compression: str = "lz4",
    *,
    has_table: bool = True,
) -> bytes:
    """A whole recording; its table of packets is empty."""
    code, body = CODES[compression], b""
    compress = {"n": bytes, "l": lz4.frame.compress, "z": zstd.compress}[compression[0]]
    for number, plain in packets:
        content = compress(plain)
        body += struct.pack("<ii", number, len(content)) + content
    info = ("bytes", info_xml(streams).encode())
    head = flatbuffer("IOHE", {0: ("<i", code), 1: ("<q", -1), 2: info})
    if has_table:
        head = flatbuffer("IOHE", {0: ("<i", code), 1: ("<q", 14 + len(head) + len(body)), 2: info})
        body += flatbuffer("FTAB", {})
    return b"#!AER-DAT4.0\r\n" + head + body


def write_aedat4(path: Path, *args: Any, **options: Any) -> Path:
    path.write_bytes(aedat4(*args, **options))
    return path
