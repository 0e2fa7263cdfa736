"""Where a finding lies in time, and the pieces of the file around it that may show it, the shortest first."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_US
from fedora_qa.layout.canonical import FRAMES_OF_MAP
from fedora_qa.record.types import Where
from fedora_qa.sequence.scan import Scan

SHORTEST_MARGIN_NS: Final = 200_000_000
"""One window, 0.2 s: the least time in which flow of 10, 25 and 50 Hz all complete whole intervals."""

# 1 s, five windows: a piece holds the whole of a shorter place.
_LONGEST_LOCAL_NS: Final = 5 * SHORTEST_MARGIN_NS
"""A longer place is that of a lasting fault, which a part of the place may show."""


@dataclass(frozen=True, slots=True)
class FindingPlace:
    """Where a finding lies.

    Attributes
    ----------
    start_ns, stop_ns
        From the file's origin, within the time that most streams share.
    centre_ns
        Centre of pieces that are shorter than the place, ns from the origin.
    rows
        Rows (stream, start, stop) that belong to the finding whatever their timestamps; None where it names none.
    """

    start_ns: int
    stop_ns: int
    centre_ns: int
    rows: tuple[str, int, int] | None = None


@dataclass(frozen=True, slots=True)
class Piece:
    """A segment of time with both its ends, ns from the origin, and further rows that belong to it."""

    start_ns: int
    stop_ns: int
    rows: tuple[str, int, int] | None = None


def place_of(where: Where, check: str, scanned: Scan) -> FindingPlace:
    """Return where a finding lies.

    A finding that names no time concerns the whole file, and any segment may show it: pieces then lie around the window
    with most events. Faults of the layout show at the end, where rows are missing.
    """
    first, last = shared_time_ns(scanned)
    # Stream, first row, and the row after the last.
    rows: tuple[str, int, int] | None = None
    if where.stream is not None and where.index_start is not None:
        stop_row = where.index_start if where.index_stop is None else where.index_stop
        rows = where.stream, where.index_start, max(stop_row, where.index_start + 1)
    elif where.stream is not None and where.frame is not None:
        # The frame of a finding about a stream without frames is a colour frame.
        has_frames = where.stream in {"rgb", "depth", *FRAMES_OF_MAP} or where.stream.startswith("flow/")
        rows = where.stream if has_frames else "rgb", where.frame, where.frame + 1
    # The time that the place names, or that of its rows, ns from the origin.
    times: tuple[int, int] | None = None
    if where.start_us is not None:
        stop_us = where.start_us if where.stop_us is None else where.stop_us
        times = _from_origin_ns(where.start_us, scanned), _from_origin_ns(stop_us, scanned)
    elif rows is not None:
        row_times = [_time_of_row(rows[0], row, scanned) for row in (rows[1], rows[2] - 1)]
        # Timestamps may run backwards between the rows (a clock reset): the smaller of the two comes first.
        if row_times[0] is not None and row_times[1] is not None:
            times = min(row_times[0], row_times[1]), max(row_times[0], row_times[1])
    if times is None:
        # Missing rows show at the end; elsewhere checks have most to measure where events are densest.
        centre = last if check.startswith("integrity.") else _busiest_ns(scanned, first, last)
        return FindingPlace(centre, centre, centre)
    # A faulty timestamp may lie far outside the time of the other streams: they have no rows there.
    start, stop = (min(max(time, first), last) for time in times)
    named_by_rows = where.start_us is None or where.stop_us is None
    return FindingPlace(start, stop, start if named_by_rows else _busiest_ns(scanned, start, stop), rows)


def pieces_around(place: FindingPlace, longest_ns: int) -> Iterator[Piece]:
    """Yield pieces to try, each with twice the margin of the one before; only the first may exceed ``longest_ns``.

    Each holds the whole of a short place, and as much of a long one as fits around its centre.
    """
    local = place.stop_ns - place.start_ns <= _LONGEST_LOCAL_NS
    start, stop = (place.start_ns, place.stop_ns) if local else (place.centre_ns, place.centre_ns)
    rows = place.rows if local or place.rows is None else (place.rows[0], place.rows[1], place.rows[1] + 1)
    margin = SHORTEST_MARGIN_NS
    # The first piece has no bound: with a small limit there would be none at all.
    while margin == SHORTEST_MARGIN_NS or stop - start + 2 * margin <= longest_ns:
        yield Piece(start - margin, stop + margin, rows)
        margin *= 2


def shared_time_ns(scanned: Scan) -> tuple[int, int]:
    """Return the time that most streams share, ns from the origin; one stream with a wrong clock does not change it."""
    facts = scanned.facts
    spans = []
    for clock in facts.clocks.values():
        if clock.usable:
            stops = clock.times_ns if clock.ends_ns is None else clock.ends_ns
            spans.append((int(clock.times_ns[0]), int(stops.max())))
    if facts.events and facts.events.count:
        spans.append((facts.events.first_ns, facts.events.last_ns))
    if not spans:
        return 0, 0
    # Medians of starts and of stops: fewer than half of the streams with a wrong clock cannot move them.
    first, last = np.median(np.array(spans, dtype=np.float64), axis=0)
    return int(first), int(last)


def _time_of_row(stream: str, row: int, scanned: Scan) -> int | None:
    stream = FRAMES_OF_MAP.get(stream, stream)
    clock = scanned.facts.clocks.get(stream)
    if clock is not None and len(clock.times_ns):
        return int(clock.times_ns[min(row, len(clock.times_ns) - 1)])
    runs = scanned.runs.get(stream)
    if runs is None or not len(runs.cells):
        return None
    # Events are indexed by cells of the window grid; the start of the cell is exact enough, and nothing is decoded.
    cell = max(int(np.searchsorted(runs.starts, row, "right")) - 1, 0)
    return int(runs.cells[cell]) * scanned.cell_ns


def _busiest_ns(scanned: Scan, start_ns: int, stop_ns: int) -> int:
    """Return the middle of the window with most events between two times; halfway where there are none."""
    runs = scanned.runs.get("events")
    halfway = (start_ns + stop_ns) // 2
    if runs is None:
        return halfway
    middles = runs.cells * scanned.cell_ns + scanned.cell_ns // 2
    counts = np.diff(np.append(runs.starts, runs.count))
    counts[(middles < start_ns) | (middles > stop_ns)] = 0
    return int(middles[np.argmax(counts)]) if counts.any() else halfway


def _from_origin_ns(time_us: float, scanned: Scan) -> int:
    # From us on the clock of the file to ns from its origin.
    return round((time_us - scanned.facts.origin_us) * NS_PER_US)
