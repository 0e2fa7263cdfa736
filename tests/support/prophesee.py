"""Recordings as Prophesee's formats describe them, written word by word and as slowly as that is.

Sources: "EVT 2.0 Format", "EVT 3.0 Format" and "DAT File Format" (docs.prophesee.ai).
"""

import struct
from collections.abc import Iterable
from pathlib import Path

Event = tuple[int, int, int, int]
"""Column, row, time in us, polarity."""

RAW_HEADER = "% date 2026-01-02 03:04:05\n% evt {version}\n% format {name};height=480;width=640\n% end\n"
DAT_HEADER = "% Data file containing CD events\n% Version 2\n% Width 640\n% Height 480\n"


def evt2_words(events: Iterable[Event], period_us: int = 1 << 34) -> bytes:
    """EVT 2.0: a word of time before the events of each 64 us."""
    words: list[int] = []
    high = None
    for x, y, t, p in events:
        upper = (t % period_us) >> 6
        if upper != high:
            words.append(0x8 << 28 | upper)
            high = upper
        words.append(p << 28 | (t & 0x3F) << 22 | x << 11 | y)
    return struct.pack(f"<{len(words)}I", *words)


def evt3_words(events: Iterable[Event], *, vectors: bool = True) -> bytes:
    """EVT 3.0: events of one time, row and polarity in ascending columns go into vectors of 12 and 8.

    While nothing happens the sensor repeats the upper part of the time, here every 4 s.
    """
    events = list(events)
    words: list[int] = []
    time_us: int | None = None
    row: int | None = None
    k = 0
    while k < len(events):
        x, y, t, p = events[k]
        if t != time_us:
            if time_us is not None:
                words += [0x8000 | (at >> 12) % 4096 for at in range(time_us + (1 << 22), t, 1 << 22)]
            if time_us is None or t >> 12 != time_us >> 12:
                words.append(0x8000 | (t >> 12) % 4096)
            words.append(0x6000 | t % 4096)
            time_us = t
        if y != row:
            words.append(y)
            row = y
        # As many events as follow in ascending columns.
        stop = k + 1
        while stop < len(events) and events[stop][1:] == (y, t, p) and events[stop - 1][0] < events[stop][0] < x + 32:
            stop += 1
        if vectors and stop - k > 1:
            columns = {event[0] - x for event in events[k:stop]}
            words.append(0x3000 | p << 11 | x)
            for first, length, kind in ((0, 12, 0x4000), (12, 12, 0x4000), (24, 8, 0x5000)):
                words.append(kind | sum(1 << bit for bit in range(length) if first + bit in columns))
        else:
            stop = k + 1
            words.append(0x2000 | p << 11 | x)
        k = stop
    return struct.pack(f"<{len(words)}H", *words)


def dat_words(events: Iterable[Event]) -> bytes:
    """DAT 2: the type and size of an event, and events of eight bytes."""
    return b"\x0c\x08" + b"".join(struct.pack("<II", t % (1 << 32), p << 28 | y << 14 | x) for x, y, t, p in events)


def write_evt2(path: Path, events: Iterable[Event], header: str = RAW_HEADER) -> Path:
    path.write_bytes(header.format(version="2.0", name="EVT2").encode() + evt2_words(events))
    return path


def write_evt3(path: Path, events: Iterable[Event], header: str = RAW_HEADER, *, vectors: bool = True) -> Path:
    path.write_bytes(header.format(version="3.0", name="EVT3").encode() + evt3_words(events, vectors=vectors))
    return path


def write_dat(path: Path, events: Iterable[Event], header: str = DAT_HEADER) -> Path:
    path.write_bytes(header.encode() + dat_words(events))
    return path


WRITERS = {"evt2": write_evt2, "evt3": write_evt3, "dat": write_dat}
"""By the name of the encoding."""


def random_events(count: int, seed: int, *, rows: bool = True) -> list[Event]:
    """Events over 2 s in order; with ``rows`` many of them fire together in a row, as edges do."""
    import numpy as np  # noqa: PLC0415

    rng = np.random.default_rng(seed)
    times = np.sort(rng.integers(0, 2_000_000, count))
    if rows:
        times = times // 500 * 500
    y = times // 500 % 480 if rows else rng.integers(0, 480, count)
    events = zip(rng.integers(0, 640, count), y, times, rng.integers(0, 2, count), strict=True)
    return sorted(
        {tuple(map(int, event)) for event in events}, key=lambda event: (event[2], event[1], event[3], event[0])
    )
