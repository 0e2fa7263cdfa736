"""Where a finding lies in time, the pieces of the file around it that may show it, and their rows.

The shortest pieces come first.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import FRAMES_OF_MAP, MS_TO_EVENT, spec_of, timestamps_of
from fedora_qa.record.types import Where
from fedora_qa.sequence.scan import Runs, Scan
from fedora_qa.sequence.sequence import SequenceRows

_SHORTEST_MARGIN_NS: Final = 200_000_000
"""One window, 0.2 s: the least time in which flow of 10, 25 and 50 Hz all complete whole intervals."""

# 1 s, five windows: a piece holds the whole of a shorter place.
_LONGEST_LOCAL_NS: Final = 5 * _SHORTEST_MARGIN_NS
"""A longer place is that of a lasting fault, which a part of the place may show."""

MILLISECONDS: Final = spec_of(MS_TO_EVENT).stream
"""The map from milliseconds to events. It has no timestamps, and its entries are no rows of a stream."""

_ANOTHER_UNIT: Final = 100
"""Ratio of durations from which two streams are of different units.

Units differ by 1000; a stream that ends early, or a clock reset, rarely changes a duration by 100.
"""


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
    first, last = _shared_time_ns(scanned)
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
        times = scanned.facts.from_file_us(where.start_us), scanned.facts.from_file_us(stop_us)
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
    margin = _SHORTEST_MARGIN_NS
    # The first piece has no bound: with a small limit there would be none at all.
    while margin == _SHORTEST_MARGIN_NS or stop - start + 2 * margin <= longest_ns:
        yield Piece(start - margin, stop + margin, rows)
        margin *= 2


def _shared_time_ns(scanned: Scan) -> tuple[int, int]:
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


@dataclass(frozen=True, slots=True)
class CutRows:
    """Rows of a stream of ``of`` rows. Where they reach its end, its longer datasets are copied to their own ends."""

    start: int
    stop: int
    of: int

    @property
    def to_the_end(self) -> bool:
        """Whether they reach the stream's end."""
        return self.stop >= self.of


def rows_kept(piece: Piece, sequence: SequenceRows, scanned: Scan, counts: Mapping[str, int]) -> dict[str, CutRows]:
    """Return the rows of every stream that lie in a piece.

    The time of a row is the latest timestamp up to it, as in windows, so that the rows of a piece are contiguous
    whatever the timestamps. Of flow, whole intervals are taken. A stream without usable timestamps, or with those of
    another time or unit, contributes the share of its rows that the piece is of the shared time.
    """
    kept: dict[str, CutRows] = {}
    events = scanned.facts.events
    first_ns, last_ns = _shared_time_ns(scanned)
    length_ns = max(last_ns - first_ns, 1)
    for stream, count in counts.items():
        if stream in {*FRAMES_OF_MAP, MILLISECONDS}:
            continue
        clock, runs = scanned.facts.clocks.get(stream), scanned.runs.get(stream)
        if clock is not None and clock.usable and _is_of(first_ns, last_ns, clock.times_ns[0], clock.times_ns.max()):
            # The envelope: binary search needs ascending values, and faulty timestamps do not ascend.
            starts = np.maximum.accumulate(clock.times_ns)
            stops = starts if clock.ends_ns is None else np.maximum.accumulate(clock.ends_ns)
            start = int(np.searchsorted(starts, piece.start_ns, "left"))
            # A flow interval is kept if it starts and ends within the piece; for others both times are the same.
            stop = max(start, int(np.searchsorted(stops, piece.stop_ns, "right")))
        elif stream == "events" and runs and events and _is_of(first_ns, last_ns, events.first_ns, events.last_ns):
            start = _event_row(runs, piece.start_ns, sequence, scanned)
            # A piece includes its stop: the first row at least 1 ns later ends the half-open range.
            stop = _event_row(runs, piece.stop_ns + 1, sequence, scanned)
        else:
            # Rows of unknown time are taken as evenly spread over the shared time, outwards to whole rows.
            start = int(count * (piece.start_ns - first_ns) / length_ns)
            stop = int(np.ceil(count * (piece.stop_ns - first_ns) / length_ns))
        if piece.rows is not None and FRAMES_OF_MAP.get(piece.rows[0], piece.rows[0]) == stream:
            _, first_row, stop_row = piece.rows
            # Rows that the finding names are kept even if their timestamps lie elsewhere: these may be its subject.
            start, stop = (min(start, first_row), max(stop, stop_row)) if start < stop else (first_row, stop_row)
        start = min(max(start, 0), count)
        kept[stream] = CutRows(start, min(max(stop, start), count), count)
    for stream, frames in FRAMES_OF_MAP.items():
        if stream in counts:
            # An index map has one entry for each frame, so that it keeps exactly the frames' rows.
            kept[stream] = kept.get(frames, CutRows(0, counts[stream], counts[stream]))
    if MILLISECONDS in counts:
        milliseconds, count = scanned.facts.millisecond_map, counts[MILLISECONDS]
        stop = count
        if milliseconds is not None and "events" in kept and not kept["events"].to_the_end:
            # Milliseconds count from 0 on the clock of the events, which a cut does not change: the first entry stays,
            # and the last is the first one that no event of the piece follows.
            stop = int(np.searchsorted(milliseconds.index_map.expected_left, kept["events"].stop)) + 1
        kept[MILLISECONDS] = CutRows(0, min(stop, count), count)
    return kept


def _is_of(first_ns: int, last_ns: int, own_first_ns: int, own_last_ns: int) -> bool:
    """Whether a stream's time is that of the others: both overlap, and their durations are of one unit."""
    length, own = max(last_ns - first_ns, 1), max(own_last_ns - own_first_ns, 1)
    meets = own_first_ns <= last_ns and own_last_ns >= first_ns
    return meets and 1 / _ANOTHER_UNIT < own / length < _ANOTHER_UNIT


def _event_row(runs: Runs, time_ns: int, sequence: SequenceRows, scanned: Scan) -> int:
    """Return the first row that lies at a time or later; the start of its window where timestamps cannot be decoded."""
    cell_start_ns = time_ns // scanned.cell_ns * scanned.cell_ns
    first = int(np.searchsorted(runs.cells, time_ns // scanned.cell_ns, "left"))
    bounds = np.append(runs.starts, runs.count)
    start = int(bounds[first])
    # The cell of the time holds no events: the answer is the first row of the next cell, without reading.
    if first == len(runs.cells) or int(runs.cells[first]) * scanned.cell_ns > cell_start_ns:
        return start
    try:
        times_ns = sequence.rows(timestamps_of("events"), start, int(bounds[first + 1]))
    except UnreadableRowsError:
        return start
    envelope = np.maximum.accumulate(times_ns)
    return start + int(np.searchsorted(envelope, time_ns, "left"))
